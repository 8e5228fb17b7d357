"""ServerLoop: serves people at a port, with asyncio on a thread of the node: consoles, and live pages.

It uses wall time in lock step too, because a person does not type in virtual time, so it adds no moments to a run. What
a person asks for enters the node's inbox, so it is recorded and replayed.
"""

from __future__ import annotations

import asyncio
from contextlib import ExitStack, suppress

from snr_sim.core.node import Node
from snr_sim.links.restarting import RestartingLoop
from snr_sim.links.security import as_secret, is_loopback
from snr_sim.links.socket_port import Address, ListenerFactory
from snr_sim.prelude.errors import ConfigError
from snr_sim.prelude.node_api import NodeApi


class ServerLoopFactory(ListenerFactory):
    """Makes a ServerLoop; `who` names it in messages, and `token_fix` states how a user passes a token.

    Raises:
        ConfigError: the port is invalid, the token too short, or missing where the network can reach the port.
    """

    def __init__(self, port: int, host: str, token: str | bytes | None, name: str, *, who: str, token_fix: str) -> None:
        super().__init__(Address(host, port), who)
        if not (isinstance(port, int) and 0 <= port < 1 << 16):
            raise ConfigError(
                f"{port!r} is not a valid port of {who[0].lower()}{who[1:]}.",
                fix="use a number from 1024 to 65535, or 0 for a free one.",
            )
        self.token: bytes | None = as_secret(token, "token=")
        if self.token is None and not is_loopback(host):
            raise ConfigError(
                f"{who} on {host} needs a token of your own: without it, any computer in that network could steer this "
                "node.",
                fix=token_fix,
            )
        self.name: str = name


class ServerLoop(RestartingLoop):
    """Loop on a thread of its own that listens, and serves until it is stopped."""

    factory: ServerLoopFactory
    parent: Node

    def __init__(self, factory: ServerLoopFactory, parent: NodeApi) -> None:
        assert isinstance(parent, Node)  # never in a loop's process, since its executor is a thread
        super().__init__(factory, parent, factory.name, max_tick_rate_hz=0)
        self._ending = asyncio.Event()  # set when clients are no longer to be served
        self._events: asyncio.AbstractEventLoop | None = None

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
        """Stop, and return once clients have been notified, or after the time limit."""
        self.stop()
        super().join()

    def _round(self) -> None:
        asyncio.run(self._run())

    async def _run(self) -> None:
        self._ending, self._events = asyncio.Event(), asyncio.get_running_loop()
        if not self.is_terminated():  # before there was an event to set
            await self._serve()

    async def _serve(self) -> None:
        """Serve clients until `_ending` is set."""
        raise NotImplementedError
