"""CommandReceiver: serves consoles over TCP, several at a time, on a thread of the node."""

from __future__ import annotations

import asyncio
import time
from contextlib import ExitStack, suppress
from typing import NamedTuple

from snr_sim.console.commands import TABLE
from snr_sim.console.conversation import LINES_AT_ONCE, LINES_PER_S, Conversation
from snr_sim.console.session import Session
from snr_sim.console.wire import DEFAULT_PORT, LINE_FRAME_MAX_BYTES, PURPOSE, READ_BYTES, SECRET_IS, read_for
from snr_sim.core.node import Node
from snr_sim.links.allowance import Allowance
from snr_sim.links.newcomers import Newcomers, crowd, source_of
from snr_sim.links.restarting import RestartingLoop
from snr_sim.links.security import as_secret, is_loopback
from snr_sim.links.session import Terms
from snr_sim.links.socket_port import Address, ListenerFactory
from snr_sim.prelude.errors import ConfigError
from snr_sim.prelude.node_api import NodeApi

CONSOLES_MAX = 8
STRANGERS_MAX = 16  # connections that are not authenticated as consoles yet
# A client that sends without end is read so slowly that it costs the node a few per cent of a core.
BYTES_PER_S = 1 << 18
READS_PER_S = 1000.0
TEND_EVERY_S = 0.1  # time-outs, keep-alives
WATCH_EVERY_S = 0.05
BUSY_EVERY_S = 0.01
OUTCOME_EVERY_S = 0.002  # the node usually carries out a command at once
LINGER_S = 0.2  # maximum time in which a closing node sends the last answers
HANG_UP_S = 0.5  # maximum wait for the other end to close a connection that is over


class CommandReceiverFactory(ListenerFactory):
    """Makes a loop that lets consoles connect to the node: `snr console HOST:PORT`, or a RemoteConsole.

    Args:
        port: 0 takes a free one; the attribute then has the actual port.
        host: an address of this machine; it binds to this one only.
        token: at least 16 bytes, the same on both ends; see `secret_from_file` and `secret_from_env`. Optional on
            loopback: without it, every user of this machine may send commands.
        name: of the loop, and source of its tasks.

    Raises:
        ConfigError: the port would accept any client in the network without a token; or the token is too short.
    """

    def __init__(
        self,
        port: int = DEFAULT_PORT,
        host: str = "127.0.0.1",
        token: str | bytes | None = None,
        name: str = "console",
    ) -> None:
        super().__init__(Address(host, port), "A console")
        if not (isinstance(port, int) and 0 <= port < 1 << 16):
            raise ConfigError(f"A console's port is {port!r}.", fix="a number from 1024 to 65535, or 0 for a free one.")
        self.token = as_secret(token, "token=")
        if self.token is None and not is_loopback(host):
            raise ConfigError(
                f"A console on {host} without a token would let anybody in that network steer this node.",
                fix='token=secret_from_file("token.txt") here, and --token-file token.txt for `snr console`.',
            )
        self.name = name

    def get(self, parent: NodeApi) -> CommandReceiver:
        """Return the loop."""
        return CommandReceiver(self, parent, self.name)


class Line(NamedTuple):
    """A connection to a console, and its state."""

    conversation: Conversation
    writer: asyncio.StreamWriter
    host: str  # address of the client
    task: asyncio.Task[None] | None

    @property
    def is_known(self) -> bool:
        """Whether the client is known to be a console."""
        return self.conversation.wire.is_up

    def flush(self) -> None:
        """Send what waits, once the client has accepted what was sent before: so what waits is bounded."""
        output = self.conversation.output
        if output and not self.writer.transport.get_write_buffer_size():
            self.writer.write(bytes(output))
            output.clear()


class CommandReceiver(RestartingLoop):
    """Loop on a thread of its own, in lock step too: consoles run in real time, and add no events to virtual time."""

    factory: CommandReceiverFactory
    parent: Node
    is_reloaded_with_all = False

    def __init__(self, factory: CommandReceiverFactory, parent: NodeApi, name: str) -> None:
        assert isinstance(parent, Node)  # never in a loop's process, since its backing is a thread
        super().__init__(factory, parent, name, max_tick_rate_hz=0)
        self._terms = Terms(
            parent.name,
            is_server=True,
            secret=factory.token,
            purpose=PURPOSE,
            max_frame_bytes=LINE_FRAME_MAX_BYTES,
            secret_is=SECRET_IS,
        )
        self._new_names: set[str] = set()
        self._allowance = Allowance(LINES_PER_S, LINES_AT_ONCE)
        self._newcomers = Newcomers()
        self._lines: list[Line] = []
        self._ending = asyncio.Event()  # set when consoles are no longer to be served
        self._events: asyncio.AbstractEventLoop | None = None
        self.forged = 0  # connections whose data was changed between the two ends

    def begin(self) -> None:
        """Listen, and start the thread.

        Raises:
            LinkError: the port is taken, or the host is not this machine.
        """
        self._open()
        self.parent.start_loop(self, on_thread=True)

    def _open_ports(self, ports: ExitStack) -> None:
        self._sock = self.factory.listener()
        ports.callback(self._sock.close)

    def stop(self) -> None:
        """Request the end of the loop; return at once, also when called from another thread."""
        super().stop()
        if self._events is not None:
            with suppress(RuntimeError):  # it has already ended
                self._events.call_soon_threadsafe(self._ending.set)

    def join(self) -> None:
        """Stop, and return once consoles have received the goodbye, or after the time limit."""
        self.stop()
        super().join()

    def _round(self) -> None:
        """Serve consoles until the loop is stopped."""
        asyncio.run(self._serve())

    async def _serve(self) -> None:
        self._ending = asyncio.Event()
        self._events = events = asyncio.get_running_loop()
        # For errors of asyncio itself, for example no descriptor left to accept a connection; it retries by itself.
        events.set_exception_handler(
            lambda _, about: self.log.warning("%s: %s", about["message"], about.get("exception"))
        )
        if self.is_terminated():  # before there was a task to cancel
            return
        server = await asyncio.start_server(self._connected, sock=self._sock, limit=READ_BYTES)
        await self._ending.wait()
        server.close()
        tasks = [line.task for line in self._lines if line.task is not None]
        for task in tasks:
            task.cancel()
        if tasks:
            await asyncio.wait(tasks, timeout=LINGER_S)

    async def _connected(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Serve one connection. An error ends that connection, and never the node."""
        host, now_s = writer.get_extra_info("peername")[0], time.monotonic()
        if not self._newcomers.may_greet(host, now_s):
            writer.transport.abort()
            return
        strangers = [line for line in self._lines if not line.is_known]
        if len(strangers) >= STRANGERS_MAX:
            self._drop(crowd(strangers, lambda line: source_of(line.host))[0])
        session = Session(self.parent, TABLE, self.name, self._new_names)
        conversation = Conversation(self._terms, session, now_s, self._allowance)
        line = Line(conversation, writer, host, asyncio.current_task())
        self._lines.append(line)
        try:
            await self._talk(line, reader)
        except asyncio.CancelledError:
            conversation.end(self._farewell())
            await _hang_up(line, reader)
        except OSError:
            pass  # the console is gone
        except Exception:
            self.log.exception("a console's line failed")
        finally:
            self._drop(line)

    async def _talk(self, line: Line, reader: asyncio.StreamReader) -> None:
        """Handle and answer messages until one end closes the connection."""
        conversation, resume_s = line.conversation, 0.0
        while not conversation.is_over:
            patience_s = _patience_s(conversation)
            rest_s = resume_s - time.monotonic()
            if rest_s > 0 or not conversation.wants_bytes:
                await asyncio.sleep(min(patience_s, rest_s) if rest_s > 0 else patience_s)
            elif data := await read_for(reader, patience_s):
                resume_s = time.monotonic() + max(len(data) / BYTES_PER_S, 1 / READS_PER_S)
                self._take(line, data)
            elif data is not None:
                return
            conversation.work(time.monotonic())
            line.flush()
        await _hang_up(line, reader)

    def _take(self, line: Line, data: bytes) -> None:
        was_known = line.is_known
        line.conversation.receive(data, time.monotonic())
        if not line.is_known or was_known:
            return
        if sum(other.is_known for other in self._lines) > CONSOLES_MAX:
            line.conversation.refuse(f"{CONSOLES_MAX} consoles are connected to this node, which is the most.")
        else:
            self._newcomers.know(line.host)
            self.log.info("a console has connected")

    def _drop(self, line: Line) -> None:
        line.writer.transport.abort()
        if line not in self._lines:
            return
        self._lines.remove(line)
        if line.conversation.wire.was_forged:
            self.forged += 1
            if self.forged == 1:  # logged once: it can happen again and again
                self.log.warning("a console's line was closed: %s", line.conversation.wire.reason)

    def _farewell(self) -> str:
        node = self.parent
        if node.is_over:
            return f"node '{node.name}' ended: {node.exit_reason or 'no reason given'}."
        return f"node '{node.name}' makes its console anew, or takes it out."


def _patience_s(conversation: Conversation) -> float:
    """Return how long the connection can wait for data before the next work is due."""
    if conversation.session.is_waiting:
        return OUTCOME_EVERY_S
    if conversation.is_busy or conversation.output:
        return BUSY_EVERY_S
    return WATCH_EVERY_S if conversation.session.is_watching else TEND_EVERY_S


async def _hang_up(line: Line, reader: asyncio.StreamReader) -> None:
    """Send the rest and wait for the other end to close: closing first could discard what was sent."""
    with suppress(TimeoutError, OSError):
        async with asyncio.timeout(HANG_UP_S):
            line.writer.write(bytes(line.conversation.output))
            line.writer.write_eof()
            while await reader.read(READ_BYTES):
                pass
