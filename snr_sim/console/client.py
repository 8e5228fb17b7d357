"""ConsoleClient: console connection for programs: send a command, receive the answer."""

from __future__ import annotations

import asyncio
import socket
import threading
import time
from collections.abc import Callable
from contextlib import suppress

from snr_sim.console.table import Answer
from snr_sim.console.wire import (
    PURPOSE,
    SECRET_IS,
    Command,
    Complete,
    Reply,
    Words,
    answer_of,
    asked,
    decode_answered,
    read_for,
)
from snr_sim.console.words import LINE_MAX_CHARS
from snr_sim.links.security import as_secret
from snr_sim.links.session import Session, Terms
from snr_sim.prelude.errors import LinkError, ValueEncodingError

CONNECT_TIMEOUT_S = 3.0
ANSWER_TIMEOUT_S = 10.0
TEND_EVERY_S = 0.1
LINGER_S = 0.3  # maximum time in which a closing client sends its last messages


class ConsoleClient:
    """Keeps a connection to a node, and reconnects when it is lost. Use it in a `with`.

    Args:
        server_tuple: host and port of the node's CommandReceiver.
        token: that of the node, if it has one.
        retry_wait_s: delay between two attempts to connect.
        on_change: called with the answer of a watched page, on another thread.
        on_state: called with a sentence when the connection is up or lost, on another thread.

    Example:
        with ConsoleClient(("127.0.0.1", 54321)) as console:
            print(console.ask("dump depth_m").data["data"])

    Raises:
        ConfigError: the token is too short.
    """

    def __init__(
        self,
        server_tuple: tuple[str, int],
        token: str | bytes | None = None,
        retry_wait_s: float = 0.5,
        on_change: Callable[[Answer], None] = lambda answer: None,
        on_state: Callable[[str], None] = lambda sentence: None,
    ) -> None:
        self.host, self.port = server_tuple
        self.reason = "nobody has been called yet."  # why there is no connection
        self.was_refused = False  # the node rejects this client: a retry is of no use
        self.node = ""  # name of the node at the other end
        self._terms = Terms(
            "console", is_server=False, secret=as_secret(token, "token="), purpose=PURPOSE, secret_is=SECRET_IS
        )
        self._retry_wait_s = retry_wait_s
        self._on_change = on_change
        self._on_state = on_state
        self._changed = threading.Condition()  # guards the attributes below, and is notified of their changes
        self._asked: set[int] = set()
        self._answers: dict[int, Reply | Words] = {}
        self._number = 0
        self._is_up = False
        self._has_met = False  # the other end is known to be a console, whichever end rejected the other
        self._calls = 0  # number of connections and attempts that have ended
        self._line = 0  # value of `_calls` when `wait_until_up` returned
        self._thread = threading.Thread(target=self._run, name="console client", daemon=True)

    def __enter__(self) -> ConsoleClient:
        self._events = asyncio.new_event_loop()
        self._calling = self._events.create_task(self._call_again_and_again())
        self._thread.start()
        return self

    def __exit__(self, *about: object) -> None:
        self._soon(self._calling.cancel)
        self._thread.join(CONNECT_TIMEOUT_S)

    def wait_until_up(self, timeout_s: float) -> None:
        """Return once the connection is up.

        Raises:
            LinkError: it is not up after that time, or the node rejected it.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._is_up or self.was_refused, timeout_s)
            if not self._is_up and self._has_met:
                raise LinkError(f"The console at {self.host}:{self.port} cannot be used: {self.reason}")
            if not self._is_up:
                raise LinkError(
                    f"No console at {self.host}:{self.port}: {self.reason}",
                    fix="does the node run, with CommandReceiverFactory(port)? The same port?",
                )
            self._line = self._calls

    def wait_until_lost(self) -> None:
        """Return once the connection that `wait_until_up` waited for is lost, even if there is a new one by now."""
        with self._changed:
            self._changed.wait_for(lambda: self._calls != self._line)

    def ask(self, line: str, timeout_s: float = ANSWER_TIMEOUT_S) -> Answer:
        """Send a command line to the node, and return the answer.

        Raises:
            LinkError: there is no connection, it broke, or no answer arrived in time. The command may still have run.
        """
        if len(line) > LINE_MAX_CHARS:
            return Answer(f"This line has {len(line)} characters; {LINE_MAX_CHARS} is the most.", is_error=True)
        try:
            line.encode()
        except UnicodeEncodeError:
            return Answer("This line holds text that UTF-8 cannot carry.", is_error=True)
        reply = self._exchange(lambda number: asked(Command(number, line)), timeout_s)
        assert isinstance(reply, Reply)
        return answer_of(reply)

    def complete(self, line: str, timeout_s: float = 1.0) -> list[str]:
        """Return the words that can follow at the end of the line; none without a connection to the node."""
        try:
            words = self._exchange(lambda number: asked(Complete(number, line[:LINE_MAX_CHARS])), timeout_s)
        except (LinkError, UnicodeEncodeError):
            return []
        return words.words if isinstance(words, Words) else []

    def _exchange(self, frame_of: Callable[[int], bytes], timeout_s: float) -> Reply | Words:
        with self._changed:
            if not self._is_up:
                raise LinkError(f"There is no line to {self.host}:{self.port}: {self.reason}")
            self._number += 1
            number, calls = self._number, self._calls
            frame = frame_of(number)
            self._asked.add(number)
            self._soon(self._send, frame, calls)
            self._changed.wait_for(lambda: number in self._answers or self._calls != calls, timeout_s)
            self._asked.discard(number)
            if number in self._answers:
                return self._answers.pop(number)
            why = self.reason if self._calls != calls else f"no answer came within {timeout_s:g} s."
            raise LinkError(f"The line to {self.host}:{self.port} was lost before the answer: {why}")

    def _soon(self, step: Callable[..., object], *args: object) -> None:
        """Schedule a call on the client's own thread, if it still runs."""
        with suppress(RuntimeError):
            self._events.call_soon_threadsafe(step, *args)

    # On the client's own thread

    def _run(self) -> None:
        try:
            self._events.run_until_complete(self._calling)
        except asyncio.CancelledError:
            self._note_end("the console was closed.")
        finally:
            self._events.close()

    async def _call_again_and_again(self) -> None:
        while True:
            was_up = self._note_end(await self._call())
            if was_up:
                self._on_state(f"lost {self.host}:{self.port}: {self.reason}")
            if self.was_refused:
                return
            await asyncio.sleep(self._retry_wait_s)

    def _note_end(self, sentence: str) -> bool:
        """Record why a connection or attempt ended; return whether the connection was up."""
        with self._changed:
            was_up, self._is_up = self._is_up, False
            self._calls += 1  # answers are kept: their callers may not have read them yet
            self.reason = sentence
            self._changed.notify_all()
        return was_up

    async def _call(self) -> str:
        """Connect once and serve the connection while it lasts; return why it ended."""
        try:
            # Blocks this thread, which is idle: asyncio would resolve names on a thread that cannot be left.
            sock = socket.create_connection((self.host, self.port), CONNECT_TIMEOUT_S)
            reader, self._writer = await asyncio.open_connection(sock=sock)
        except (OSError, UnicodeError) as error:
            return f"{getattr(error, 'strerror', None) or error}."
        session = self._session = Session(self._terms, time.monotonic(), decode_answered)
        try:
            await self._serve(reader)
        except OSError as error:
            session.lost(f"{error.strerror or error}.")
        except asyncio.CancelledError:
            session.bye("the console was closed.")
            raise
        finally:
            await self._hang_up()
        self.was_refused, self._has_met = session.was_refused, session.was_refused and session.peer is not None
        return session.reason

    async def _serve(self, reader: asyncio.StreamReader) -> None:
        session = self._session
        while not session.is_closed:
            self._flush()
            data = await read_for(reader, TEND_EVERY_S)
            if data:
                self._receive(data)
            elif data is not None:
                session.lost("the node closed it.")
            session.tick(time.monotonic())

    async def _hang_up(self) -> None:
        """Send the last messages, and close."""
        self._flush()
        self._writer.close()
        with suppress(TimeoutError, OSError):
            async with asyncio.timeout(LINGER_S):
                await self._writer.wait_closed()
        self._writer.transport.abort()

    def _flush(self) -> None:
        self._writer.write(b"".join(map(self._session.seal, self._session.take_output())))

    def _send(self, frame: bytes, calls: int) -> None:
        if self._is_up and self._calls == calls:  # still the connection on which it was asked
            self._writer.write(self._session.seal(frame))

    def _receive(self, data: bytes) -> None:
        session = self._session
        for message in session.receive(data, time.monotonic()):
            try:
                self._take(message)
            except ValueEncodingError as error:
                session.refuse(str(error))
        if session.is_up and not self._is_up:
            with self._changed:
                self.node = session.peer_node
                self._is_up = True
                self._changed.notify_all()
            self._on_state(f"connected to {self.node} at {self.host}:{self.port}")

    def _take(self, message: Reply | Words) -> None:
        if isinstance(message, Reply) and not message.number:
            self._on_change(answer_of(message))
            return
        with self._changed:
            if message.number in self._asked:  # and its caller still waits
                self._answers[message.number] = message
                self._changed.notify_all()
