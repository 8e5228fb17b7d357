"""ConsoleClient: console connection for programs: send a command, receive the answer."""

from __future__ import annotations

import asyncio
import socket
import threading
import time
from collections.abc import Callable
from contextlib import suppress

from snr_sim.console import wire
from snr_sim.console.parsing import MAX_LINE_CHARS, CommandResult
from snr_sim.links.security import as_secret
from snr_sim.links.session import Session, SessionConfig
from snr_sim.prelude.errors import LinkError, ValueEncodingError

CONNECT_TIMEOUT_S = 3.0
ANSWER_TIMEOUT_S = 10.0
HOUSEKEEPING_PERIOD_S = 0.1
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
        on_change: Callable[[CommandResult], None] = lambda answer: None,
        on_state: Callable[[str], None] = lambda sentence: None,
    ) -> None:
        self.host: str = server_tuple[0]
        self.port: int = server_tuple[1]
        self.reason: str = "no connection has been tried yet."  # why there is no connection
        self.was_refused: bool = False  # the node rejects this client: a retry is of no use
        self.node: str = ""  # name of the node at the other end
        secret = as_secret(token, "token=")
        self._config = SessionConfig(
            "console", is_server=False, secret=secret, purpose=wire.PURPOSE, secret_is=wire.SECRET_IS
        )
        self._retry_wait_s = retry_wait_s
        self._on_change = on_change
        self._on_state = on_state
        self._changed = threading.Condition()  # guards the attributes below, and is notified of their changes
        self._pending_numbers: set[int] = set()
        self._answers: dict[int, wire.Response] = {}
        self._number = 0
        self._is_up = False
        self._is_console = False  # the other end is known to be a console, whichever end rejected the other
        self._end_count = 0  # number of connections and attempts that have ended
        self._end_count_when_up = 0  # value of `_end_count` when `wait_until_up` returned
        self._thread = threading.Thread(target=self._run, name="console client", daemon=True)

    def __enter__(self) -> ConsoleClient:
        self._events = asyncio.new_event_loop()
        self._calling = self._events.create_task(self._keep_connected())
        self._thread.start()
        return self

    def __exit__(self, *about: object) -> None:
        self._call_soon(self._calling.cancel)
        self._thread.join(CONNECT_TIMEOUT_S)

    def wait_until_up(self, timeout_s: float) -> None:
        """Return once the connection is up; raise LinkError if it is not after that time, or the node rejected it."""
        with self._changed:
            self._changed.wait_for(lambda: self._is_up or self.was_refused, timeout_s)
            if not self._is_up and self._is_console:
                raise LinkError(f"The console at {self.host}:{self.port} cannot be used: {self.reason}")
            if not self._is_up:
                raise LinkError(
                    f"No console at {self.host}:{self.port}: {self.reason}",
                    fix="check that the node runs, with CommandReceiverFactory(port) and the same port.",
                )
            self._end_count_when_up = self._end_count

    def wait_until_lost(self) -> None:
        """Return once the connection that `wait_until_up` waited for is lost, even if there is a new one by now."""
        with self._changed:
            self._changed.wait_for(lambda: self._end_count != self._end_count_when_up)

    def ask(self, line: str, timeout_s: float = ANSWER_TIMEOUT_S) -> CommandResult:
        """Send a command line to the node, and return the answer.

        Raises:
            LinkError: there is no connection, it broke, or no answer arrived in time. The command may still have run.
        """
        if len(line) > MAX_LINE_CHARS:
            return CommandResult(f"This line has {len(line)} characters; {MAX_LINE_CHARS} is the most.", is_error=True)
        try:
            line.encode()
        except UnicodeEncodeError:
            return CommandResult("This line holds text that UTF-8 cannot carry.", is_error=True)
        reply = self._exchange(lambda number: wire.CommandMessage(number, line), timeout_s)
        assert isinstance(reply, wire.Reply)
        return wire.result_from_reply(reply)

    def complete(self, line: str, timeout_s: float = 1.0) -> list[str]:
        """Return the words that can follow at the end of the line; none without a connection to the node."""
        try:
            words = self._exchange(lambda number: wire.CompleteMessage(number, line[:MAX_LINE_CHARS]), timeout_s)
        except (LinkError, UnicodeEncodeError):
            return []
        return words.words if isinstance(words, wire.CompletionsMessage) else []

    def _exchange(self, request_of: Callable[[int], wire.Request], timeout_s: float) -> wire.Response:
        with self._changed:
            if not self._is_up:
                raise LinkError(f"There is no connection to {self.host}:{self.port}: {self.reason}")
            self._number += 1
            number, end_count = self._number, self._end_count
            frame = wire.encode_request(request_of(number))
            self._pending_numbers.add(number)
            self._call_soon(self._send, frame, end_count)
            self._changed.wait_for(lambda: number in self._answers or self._end_count != end_count, timeout_s)
            self._pending_numbers.discard(number)
            if number in self._answers:
                return self._answers.pop(number)
            reason = self.reason if self._end_count != end_count else f"no answer came within {timeout_s:g} s."
            raise LinkError(f"The connection to {self.host}:{self.port} was lost before the answer: {reason}")

    def _call_soon(self, step: Callable[..., object], *args: object) -> None:
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

    async def _keep_connected(self) -> None:
        while True:
            was_up = self._note_end(await self._connect_once())
            if was_up:
                self._on_state(f"lost {self.host}:{self.port}: {self.reason}")
            if self.was_refused:
                return
            await asyncio.sleep(self._retry_wait_s)

    def _note_end(self, sentence: str) -> bool:
        """Record why a connection or attempt ended; return whether the connection was up."""
        with self._changed:
            was_up, self._is_up = self._is_up, False
            self._end_count += 1  # answers are kept: their callers may not have read them yet
            self.reason = sentence
            self._changed.notify_all()
        return was_up

    async def _connect_once(self) -> str:
        """Connect once and serve the connection while it lasts; return why it ended."""
        try:
            # Blocks this thread, which is idle: asyncio would resolve names on a thread that cannot be left.
            sock = socket.create_connection((self.host, self.port), CONNECT_TIMEOUT_S)
            reader, self._writer = await asyncio.open_connection(sock=sock)
        except (OSError, UnicodeError) as error:
            return f"{getattr(error, 'strerror', None) or error}."
        session = self._session = Session(self._config, time.monotonic(), wire.decode_response)
        try:
            await self._serve(reader)
        except OSError as error:
            session.close(f"{error.strerror or error}.")
        except asyncio.CancelledError:
            session.bye("the console was closed.")
            raise
        finally:
            await self._close()
        self.was_refused, self._is_console = session.was_refused, session.was_refused and session.peer is not None
        return session.reason

    async def _serve(self, reader: asyncio.StreamReader) -> None:
        session = self._session
        while not session.is_closed:
            self._flush()
            data = await wire.read_for(reader, HOUSEKEEPING_PERIOD_S)
            if data:
                self._receive(data)
            elif data is not None:
                session.close("the node closed it.")
            session.tick(time.monotonic())

    async def _close(self) -> None:
        """Send the last messages, and close."""
        self._flush()
        self._writer.close()
        with suppress(TimeoutError, OSError):
            async with asyncio.timeout(LINGER_S):
                await self._writer.wait_closed()
        self._writer.transport.abort()

    def _flush(self) -> None:
        self._writer.write(b"".join(map(self._session.seal, self._session.take_output())))

    def _send(self, frame: bytes, end_count: int) -> None:
        if self._is_up and self._end_count == end_count:  # still the connection on which it was asked
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

    def _take(self, message: wire.Response) -> None:
        if isinstance(message, wire.Reply) and not message.number:
            self._on_change(wire.result_from_reply(message))
            return
        with self._changed:
            if message.number in self._pending_numbers:  # and its caller still waits
                self._answers[message.number] = message
                self._changed.notify_all()
