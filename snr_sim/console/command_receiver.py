"""CommandReceiver: serves consoles over TCP, several at a time, by the links' protocol with another purpose."""

from __future__ import annotations

import asyncio
import time
from collections import deque
from contextlib import suppress
from typing import NamedTuple

from snr_sim.console import wire
from snr_sim.console.commands import TABLE
from snr_sim.console.parsing import CommandResult
from snr_sim.console.session import ConsoleSession
from snr_sim.links.newcomers import Newcomers, largest_group, source_of
from snr_sim.links.server_loop import ServerLoop, ServerLoopFactory
from snr_sim.links.session import Session as WireSession
from snr_sim.links.session import SessionConfig
from snr_sim.links.token_bucket import TokenBucket
from snr_sim.prelude.node_api import NodeApi

MAX_OUTPUT_BYTES = 1 << 17  # from this size on, no lines are answered and no bytes read until the console has read
LINES_PER_S = 500.0  # of all consoles together: limits their load on the node's computer
LINES_AT_ONCE = 100.0
MAX_CONSOLES = 8
MAX_UNAUTHENTICATED = 16  # connections that are not authenticated as consoles yet
# A client that sends without end is read so slowly that it costs the node a few per cent of a core.
BYTES_PER_S = 1 << 18
READS_PER_S = 1000.0
HOUSEKEEPING_PERIOD_S = 0.1  # time-outs, keep-alives
WATCH_POLL_PERIOD_S = 0.05
BUSY_POLL_PERIOD_S = 0.01
OUTCOME_POLL_PERIOD_S = 0.002  # the node usually carries out a command at once
LINGER_S = 0.2  # maximum time in which a closing node sends the last answers
HANG_UP_S = 0.5  # maximum wait for the other end to close a connection that is over


class CommandReceiverFactory(ServerLoopFactory):
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
        port: int = wire.DEFAULT_PORT,
        host: str = "127.0.0.1",
        token: str | bytes | None = None,
        name: str = "console",
    ) -> None:
        fix = 'token=secret_from_file("token.txt") here, and --token-file token.txt for `snr console`.'
        super().__init__(port, host, token, name, who="A console", token_fix=fix)

    def get(self, parent: NodeApi) -> CommandReceiver:
        """Return the loop."""
        return CommandReceiver(self, parent)


class ConsoleProtocol:
    """A node's end of the connection to one console: bytes and time in, bytes out. Shares the token bucket with others.

    All its parts are bounded: received bytes that are not decoded yet, command lines that wait, answers that are not
    read.
    """

    def __init__(self, config: SessionConfig, session: ConsoleSession, now_s: float, token_bucket: TokenBucket) -> None:
        self.wire: WireSession = WireSession(config, now_s, wire.decode_request)
        self.output: bytearray = bytearray()
        self.session: ConsoleSession = session
        self._token_bucket = token_bucket
        self._waiting_number = 0  # of the command whose result is not known yet
        self._requests: deque[wire.Request] = deque()
        self._flush()

    @property
    def is_over(self) -> bool:
        """Whether nothing more is to be read; `output` may still have to be sent."""
        return self.wire.is_closed

    @property
    def wants_bytes(self) -> bool:
        """Whether all earlier data is handled and the console has read the answers."""
        return not (self._requests or self.is_over or len(self.output) > MAX_OUTPUT_BYTES)

    @property
    def is_busy(self) -> bool:
        """Whether there is work as soon as the token bucket permits."""
        return bool(self._requests) and len(self.output) <= MAX_OUTPUT_BYTES and not self.session.is_waiting

    def receive(self, data: bytes, now_s: float) -> None:
        """Handle received bytes."""
        self._requests += self.wire.receive(data, now_s)
        self._flush()

    def work(self, now_s: float) -> None:
        """Answer waiting lines, show watched pages that have changed, and do periodic work."""
        outcome = self.session.outcome(now_s)
        if outcome is not None:
            self._send(wire.encode_reply(self._waiting_number, outcome))
        while self.is_busy and not self.is_over and self._token_bucket.take(now_s):
            self._answer(self._requests.popleft())
        if self._requests and len(self.output) <= MAX_OUTPUT_BYTES:
            self.wire.reset_idle_timer(now_s)  # this end does not read, so it cannot notice a silent console
        if self.wire.is_up and len(self.output) <= MAX_OUTPUT_BYTES:
            for answer in self.session.changes(now_s):
                self._send(wire.encode_reply(0, answer))
        self.wire.tick(now_s)
        self._flush()

    def end(self, reason: str) -> None:
        """Send the goodbye message; a client that waits for a command's result is notified that none will arrive."""
        if self.wire.is_up and self.session.is_waiting:
            text = f"The connection closes before the command has a result: {reason} Try: dump, on a new connection."
            self._send(wire.encode_reply(self._waiting_number, CommandResult(text, is_error=True)))
        self.wire.bye(reason)
        self._flush()

    def refuse(self, reason: str) -> None:
        """End the connection as rejected, with a reason."""
        self.wire.refuse(reason)
        self._flush()

    def _answer(self, request: wire.Request) -> None:
        if isinstance(request, wire.CommandMessage):
            answer = self.session.execute(request.line)
            if self.session.is_waiting:
                self._waiting_number = request.number
            else:
                self._send(wire.encode_reply(request.number, answer))
        else:
            self._send(wire.encode_completions(request.number, self.session.complete(request.line)))

    def _flush(self) -> None:
        for frame in self.wire.take_output():
            self._send(frame)

    def _send(self, frame: bytes) -> None:
        self.output += self.wire.seal(frame)


class ConsoleConnection(NamedTuple):
    """A connection to a console, and its state."""

    protocol: ConsoleProtocol
    writer: asyncio.StreamWriter
    host: str  # address of the client
    task: asyncio.Task[None] | None

    @property
    def is_known(self) -> bool:
        """Whether the client is known to be a console."""
        return self.protocol.wire.is_up

    def flush(self) -> None:
        """Send what waits, once the client has accepted what was sent before: so what waits is bounded."""
        output = self.protocol.output
        if output and not self.writer.transport.get_write_buffer_size():
            self.writer.write(bytes(output))
            output.clear()


class CommandReceiver(ServerLoop):
    """Loop that serves consoles."""

    factory: CommandReceiverFactory
    is_reloaded_with_all = False

    def __init__(self, factory: CommandReceiverFactory, parent: NodeApi) -> None:
        super().__init__(factory, parent)
        self._config = SessionConfig(
            parent.name,
            is_server=True,
            secret=factory.token,
            purpose=wire.PURPOSE,
            max_frame_bytes=wire.MAX_LINE_FRAME_BYTES,
            secret_is=wire.SECRET_IS,
        )
        self._new_names: set[str] = set()
        self._token_bucket = TokenBucket(LINES_PER_S, LINES_AT_ONCE)
        self._newcomers = Newcomers()
        self._connections: list[ConsoleConnection] = []
        self._forged = 0  # connections whose data was changed between the two ends

    async def _serve(self) -> None:
        # For errors of asyncio itself, for example no descriptor left to accept a connection; it retries by itself.
        asyncio.get_running_loop().set_exception_handler(
            lambda _, about: self.log.warning("%s: %s", about["message"], about.get("exception"))
        )
        server = await asyncio.start_server(self._on_connection, sock=self._sock, limit=wire.READ_BYTES)
        await self._ending.wait()
        server.close()
        tasks = [connection.task for connection in self._connections if connection.task is not None]
        for task in tasks:
            task.cancel()
        if tasks:
            await asyncio.wait(tasks, timeout=LINGER_S)

    async def _on_connection(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Serve one connection. An error ends that connection, and never the node."""
        host, now_s = writer.get_extra_info("peername")[0], time.monotonic()
        if not self._newcomers.may_greet(host, now_s):
            writer.transport.abort()
            return
        unauthenticated = [connection for connection in self._connections if not connection.is_known]
        if len(unauthenticated) >= MAX_UNAUTHENTICATED:
            self._drop(largest_group(unauthenticated, lambda connection: source_of(connection.host))[0])
        session = ConsoleSession(self.parent, TABLE, self.name, self._new_names)
        protocol = ConsoleProtocol(self._config, session, now_s, self._token_bucket)
        connection = ConsoleConnection(protocol, writer, host, asyncio.current_task())
        self._connections.append(connection)
        try:
            await self._serve_connection(connection, reader)
        except asyncio.CancelledError:
            node = self.parent
            ended = f"ended: {node.exit_reason or 'no reason given'}."
            protocol.end(f"node '{node.name}' {ended if node.is_finished else 'reloads or removes its console.'}")
            await _close(connection, reader)
        except OSError:
            pass  # the console is gone
        except Exception:
            self.log.exception("a console's line failed")
        finally:
            self._drop(connection)

    async def _serve_connection(self, connection: ConsoleConnection, reader: asyncio.StreamReader) -> None:
        """Handle and answer messages until one end closes the connection."""
        protocol, resume_s = connection.protocol, 0.0
        while not protocol.is_over:
            poll_timeout_s = _poll_timeout_s(protocol)
            rest_s = resume_s - time.monotonic()
            if rest_s > 0 or not protocol.wants_bytes:
                await asyncio.sleep(min(poll_timeout_s, rest_s) if rest_s > 0 else poll_timeout_s)
            elif data := await wire.read_for(reader, poll_timeout_s):
                resume_s = time.monotonic() + max(len(data) / BYTES_PER_S, 1 / READS_PER_S)
                self._take(connection, data)
            elif data is not None:
                return
            protocol.work(time.monotonic())
            connection.flush()
        await _close(connection, reader)

    def _take(self, connection: ConsoleConnection, data: bytes) -> None:
        was_known = connection.is_known
        connection.protocol.receive(data, time.monotonic())
        if not connection.is_known or was_known:
            return
        if sum(other.is_known for other in self._connections) > MAX_CONSOLES:
            connection.protocol.refuse(f"{MAX_CONSOLES} consoles are connected to this node, the maximum.")
        else:
            self._newcomers.remember(connection.host)
            self.log.info("a console has connected")

    def _drop(self, connection: ConsoleConnection) -> None:
        connection.writer.transport.abort()
        if connection not in self._connections:
            return
        self._connections.remove(connection)
        if connection.protocol.wire.was_forged:
            self._forged += 1
            if self._forged == 1:  # logged once: it can happen again and again
                self.log.warning("a console's connection was closed: %s", connection.protocol.wire.reason)


def _poll_timeout_s(protocol: ConsoleProtocol) -> float:
    """Return how long the connection can wait for data before the next work is due."""
    if protocol.session.is_waiting:
        return OUTCOME_POLL_PERIOD_S
    if protocol.is_busy or protocol.output:
        return BUSY_POLL_PERIOD_S
    return WATCH_POLL_PERIOD_S if protocol.session.is_watching else HOUSEKEEPING_PERIOD_S


async def _close(connection: ConsoleConnection, reader: asyncio.StreamReader) -> None:
    """Send the rest and wait for the other end to close: closing first could discard what was sent."""
    with suppress(TimeoutError, OSError):
        async with asyncio.timeout(HANG_UP_S):
            connection.writer.write(bytes(connection.protocol.output))
            connection.writer.write_eof()
            while await reader.read(wire.READ_BYTES):
                pass
