"""CommandReceiver: serves consoles over TCP, several at a time, from one thread that waits for all of them at once."""

from __future__ import annotations

import selectors
import socket
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress

from snr_sim.console.command_processor import CommandProcessor
from snr_sim.console.conversation import LINES_AT_ONCE, LINES_PER_S, Conversation
from snr_sim.console.line import Line
from snr_sim.console.wire import DEFAULT_PORT, LINE_FRAME_MAX_BYTES, PURPOSE, SECRET_IS
from snr_sim.core.loop import LoopFactory
from snr_sim.links.allowance import Allowance
from snr_sim.links.listener import Listener
from snr_sim.links.newcomers import Newcomers, crowd, source_of
from snr_sim.links.restarting import RestartingLoop
from snr_sim.links.security import as_secret, is_loopback
from snr_sim.links.session import Terms
from snr_sim.links.socket_port import Address, Claim
from snr_sim.prelude.errors import ConfigError
from snr_sim.prelude.node_api import NodeApi

CONSOLES_MAX = 8
STRANGERS_MAX = 16  # connections that have not shown yet whether they are consoles
TEND_EVERY_S = 0.1  # time-outs, keep-alives
WATCH_EVERY_S = 0.05
BUSY_EVERY_S = 0.01
OUTCOME_EVERY_S = 0.002  # the node mostly does at once what it was asked for
LINGER_S = 0.2  # how long a node's end may take to send the last answers


class CommandReceiverFactory(LoopFactory):
    """Lets consoles reach the node: `snr console HOST:PORT`, or a RemoteConsole.

    Args:
        port: 0 takes a free one, which then stands here.
        host: an address of this machine; it binds to no other.
        token: at least 16 bytes that both ends know, see `secret_from_file` and `secret_from_env`. On loopback it may
            be left out: then every user of this machine may give commands.
        name: of the loop, and the source of its tasks.

    Raises:
        ConfigError: without a token, anybody in that network could steer the node; or the token is too short.
    """

    def __init__(
        self,
        port: int = DEFAULT_PORT,
        host: str = "127.0.0.1",
        token: str | bytes | None = None,
        name: str = "console",
    ) -> None:
        super().__init__()
        if not (isinstance(port, int) and 0 <= port < 1 << 16):
            raise ConfigError(f"A console's port is {port!r}.", fix="a number from 1024 to 65535, or 0 for a free one.")
        self.token = as_secret(token, "token=")
        if self.token is None and not is_loopback(host):
            raise ConfigError(
                f"A console on {host} without a token would let anybody in that network steer this node.",
                fix='token=secret_from_file("token.txt") here, and --token-file token.txt for `snr console`.',
            )
        self.address = Address(host, port)
        self.name = name
        self._claim = Claim("A console")

    @property
    def host(self) -> str:
        """Where consoles reach it."""
        return self.address.host

    @property
    def port(self) -> int:
        """Its port; when any was asked for, the one it has, once it listens."""
        return self.address.port

    def claim(self) -> None:
        """Listens already; see PortFactory."""
        self._claim.make(self.address)

    def release(self) -> None:
        """Lets go of the port; see PortFactory."""
        self._claim.release()

    def listener(self) -> socket.socket:
        """Returns the socket that listens, for the loop to close.

        Raises:
            LinkError: the port is taken, or the host is not this machine.
        """
        return self._claim.take(self.address)

    def get(self, parent: NodeApi) -> CommandReceiver:
        """Returns the loop."""
        return CommandReceiver(self, parent, self.name)


class CommandReceiver(RestartingLoop):
    """A loop on a thread of its own, in lock step too: consoles live in the world's time, and add no moments."""

    factory: CommandReceiverFactory
    is_reloaded_with_all = False

    def __init__(self, factory: CommandReceiverFactory, parent: NodeApi, name: str) -> None:
        super().__init__(factory, parent, name, max_tick_rate_hz=0)
        self._terms = Terms(
            parent.name,
            is_server=True,
            secret=factory.token,
            purpose=PURPOSE,
            max_frame_bytes=LINE_FRAME_MAX_BYTES,
            secret_is=SECRET_IS,
        )
        self._processor = CommandProcessor(parent, name)
        self._allowance = Allowance(LINES_PER_S, LINES_AT_ONCE)
        self._newcomers = Newcomers()
        self._lines: list[Line] = []
        self.forged = 0  # lines that something between node and console has changed

    def begin(self) -> None:
        """Listens, and starts the thread.

        Raises:
            LinkError: the port is taken, or the host is not this machine.
        """
        self._open()
        self.parent.start_loop(self, on_thread=True)

    def _open_ports(self, ports: ExitStack) -> None:
        sock = self.factory.listener()
        ports.callback(sock.close)
        self._selector = selectors.DefaultSelector()
        ports.callback(self._selector.close)
        self._wake_in, self._wake_out = socket.socketpair()
        for end in (self._wake_in, self._wake_out):
            ports.callback(end.close)
            end.setblocking(False)
        self._listener = Listener(sock, self._selector, self.log)
        self._selector.register(self._wake_out, selectors.EVENT_READ)
        ports.callback(self._drop_all)

    def stop(self) -> None:
        """Asks for no more rounds; ends the one that waits."""
        super().stop()
        if self._backing is not None:
            with suppress(OSError):
                self._wake_in.send(b"\0")

    def _round(self) -> None:
        """Waits until something happens, and does what is to be done about it."""
        for key, events in self._selector.select(self._patience_s()):
            if key.fileobj is self._listener.sock:
                self._accept()
            elif isinstance(key.data, Line) and events & selectors.EVENT_READ:
                self._guarded(key.data, self._read)
        self._listener.tend(time.monotonic())
        for line in list(self._lines):
            self._guarded(line, self._tend)

    def _patience_s(self) -> float:
        patience_s = WATCH_EVERY_S if any(line.conversation.is_watching for line in self._lines) else TEND_EVERY_S
        if any(line.conversation.is_busy for line in self._lines):
            patience_s = BUSY_EVERY_S
        if any(line.conversation.is_waiting for line in self._lines):
            patience_s = OUTCOME_EVERY_S
        now_s = time.monotonic()
        moments_s = [line.due_s for line in self._lines]
        return max(0.0, min([now_s + patience_s, *moments_s]) - now_s)

    def _guarded(self, line: Line, act: Callable[[Line], None]) -> None:
        """Does something for one console; what goes wrong costs that console its line, and never the node its life."""
        try:
            act(line)
        except Exception:
            self.log.exception("a console's line failed")
            line.is_broken = True
        if line.is_done(time.monotonic()):
            self._drop(line)

    def _accept(self) -> None:
        come = self._listener.accept(time.monotonic())
        if come is None:
            return
        sock, (host, *_) = come
        if not self._newcomers.may_greet(host, time.monotonic()):
            sock.close()
            return
        strangers = [line for line in self._lines if not line.is_known]
        if len(strangers) >= STRANGERS_MAX:
            self._drop(crowd(strangers, lambda line: source_of(line.host))[0])
        conversation = Conversation(self._terms, self._processor.session(), time.monotonic(), self._allowance)
        self._lines.append(Line(sock, conversation, host))

    def _read(self, line: Line) -> None:
        was_known = line.is_known
        line.read()
        if line.is_known and not was_known:
            if sum(other.is_known for other in self._lines) > CONSOLES_MAX:
                line.conversation.refuse(f"{CONSOLES_MAX} consoles are connected to this node, which is the most.")
            else:
                self._newcomers.know(line.host)
                self.log.info("a console has connected")

    def _tend(self, line: Line) -> None:
        """Answers, sends, and has `select` wait for what this line can do next."""
        wanted = line.tend(time.monotonic())
        if wanted == line.watched:
            return
        if not wanted:
            self._selector.unregister(line.sock)
        elif not line.watched:
            self._selector.register(line.sock, wanted, line)
        else:
            self._selector.modify(line.sock, wanted, line)
        line.watched = wanted

    def _drop(self, line: Line) -> None:
        if line in self._lines:
            self._lines.remove(line)
            if line.conversation.wire.was_forged:
                self.forged += 1
                if self.forged == 1:  # told once: it can happen again and again
                    self.log.warning("a console's line was closed: %s", line.conversation.wire.reason)
            if line.watched:
                self._selector.unregister(line.sock)
            line.sock.close()

    def _drop_all(self) -> None:
        for line in list(self._lines):
            self._drop(line)

    def _see_off(self) -> None:
        """Sends the last answers and says goodbye, not for longer than a moment."""
        self._listener.close()
        give_up_s = time.monotonic() + LINGER_S
        node = self.parent
        reason = f"node '{node.name}' ended: {node.exit_reason or 'no reason given'}."
        if not node.is_over:  # reloaded, or removed
            reason = f"node '{node.name}' makes its console anew, or takes it out."
        for line in self._lines:
            line.conversation.end(reason)
        while self._lines and (now_s := time.monotonic()) < give_up_s:
            for line in list(self._lines):
                self._guarded(line, self._tend)
            for key, _ in self._selector.select(min(TEND_EVERY_S, give_up_s - now_s) if self._lines else 0.0):
                if isinstance(key.data, Line):
                    self._guarded(key.data, self._read)
