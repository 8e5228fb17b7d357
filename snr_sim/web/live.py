"""LiveLoop: serves the live page of the machines of a node, on a thread of the node's process.

Like a console it uses wall time in lock step too: a person does not edit in virtual time, so it adds no moments to a
run. What a page asks for enters the node's inbox, so it is recorded and replayed.
"""

from __future__ import annotations

import asyncio
from collections import deque
from contextlib import ExitStack, suppress
from dataclasses import replace
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

from snr_sim.behaviors.endpoint import MachineEndpoint
from snr_sim.core.node import Node
from snr_sim.links.restarting import RestartingLoop
from snr_sim.links.security import as_secret, is_loopback
from snr_sim.links.socket_port import Address, ListenerFactory
from snr_sim.prelude.errors import ConfigError, MissingExtraError
from snr_sim.prelude.node_api import NodeApi
from snr_sim.web.access import Access
from snr_sim.web.live_machine import LiveMachine
from snr_sim.web.machine_page import MachinePage
from snr_sim.web.moments import MAX_MOMENTS
from snr_sim.web.timeline import PAGE_SOURCE


class LiveLoopFactory(ListenerFactory):
    """Makes a loop that serves a page for each machine of its node.

    Args:
        port: 0 takes a free one.
        host: an address of this machine; it binds to this one only.
        token: at least 16 characters; a new random one if not given. Another host than loopback needs one.
        title: of the pages.
        name: of the loop.

    Attributes:
        folder: of the run, once it is known; without one, pages show the present only.

    Raises:
        ConfigError: the address or the token cannot be used.
        MissingExtraError: the packages of the extra 'web' are not installed.
    """

    def __init__(
        self,
        port: int = 0,
        host: str = "127.0.0.1",
        token: str | bytes | None = None,
        title: str = "",
        name: str = PAGE_SOURCE,
    ) -> None:
        super().__init__(Address(host, port), "A live page")
        if not (isinstance(port, int) and 0 <= port < 1 << 16):
            raise ConfigError(
                f"{port!r} is not a valid port of a live page.",
                fix="use a number from 1024 to 65535, or 0 for a free one.",
            )
        secret = as_secret(token, "token=")
        if secret is None and not is_loopback(host):
            raise ConfigError(
                f"A live page on {host} needs a token of your own: any computer in that network can reach it.",
                fix="--live-token-file FILE with at least 16 characters in it, or leave --live-host out.",
            )
        if host in ("0.0.0.0", "::", ""):
            raise ConfigError(
                f"A live page cannot be on all addresses ({host!r}): requests are accepted for one name only.",
                fix="one address of this computer: `ip address` shows them.",
            )
        check_packages()
        tokens = {} if secret is None else {"token": secret.decode("ascii", "replace")}
        self._access = Access(host, port, **tokens)
        self.title: str = title
        self.name: str = name
        self.folder: Path | None = None

    def get(self, parent: NodeApi) -> LiveLoop:
        """Return the loop."""
        return LiveLoop(self, parent, self.name)

    @property
    def is_loopback(self) -> bool:
        """Whether only this computer can reach it."""
        return is_loopback(self.host)

    @property
    def access(self) -> Access:
        """Its address and tokens."""
        return replace(self._access, port=self.port)  # which is known once it listens


def check_packages() -> None:
    """Check that what serves pages is installed.

    Raises:
        MissingExtraError: it is not.
    """
    for package in ("starlette", "uvicorn", "websockets"):
        if find_spec(package) is None:
            raise MissingExtraError(package, "web")


class LiveLoop(RestartingLoop):
    """Loop on a thread of its own that serves pages."""

    factory: LiveLoopFactory
    parent: Node
    is_robot_component = False

    def __init__(self, factory: LiveLoopFactory, parent: NodeApi, name: str) -> None:
        assert isinstance(parent, Node)  # never in a loop's process, since its executor is a thread
        super().__init__(factory, parent, name, max_tick_rate_hz=0)
        self._ending = asyncio.Event()
        self._events: asyncio.AbstractEventLoop | None = None

    def begin(self) -> None:
        """Listen, and start the thread.

        Raises:
            LinkError: the port is taken, or the host is not this machine.
        """
        import_module("snr_sim.web.server")  # takes 0.2 s, in which the robot's thread would wait for it later
        for one in self.parent.components.values():
            if isinstance(one, MachineEndpoint):
                one.recent = deque(maxlen=MAX_MOMENTS)  # before it begins, if this loop is the first component
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
        """Stop, and return once browsers have been notified, or after the time limit."""
        self.stop()
        super().join()

    def _round(self) -> None:
        """Serve pages until the loop is stopped."""
        asyncio.run(self._serve())

    async def _serve(self) -> None:
        from snr_sim.web.server import serve  # slow to import, and not installed everywhere

        self._ending = asyncio.Event()
        self._events = asyncio.get_running_loop()
        if self.is_terminated():
            return
        node, factory = self.parent, self.factory
        names = [name for name, one in node.components.items() if isinstance(one, MachineEndpoint)]
        machines = [LiveMachine(node, name, factory.title, factory.folder) for name in names]
        pages = [MachinePage(one) for one in machines]
        ending = asyncio.create_task(self._send_gone(pages))
        try:
            await serve(pages, factory.access, self._sock, self._ending)
        finally:
            ending.cancel()
            for one in machines:
                one.close()

    async def _send_gone(self, pages: list[MachinePage]) -> None:
        await self._ending.wait()
        node = self.parent
        reason = f"The run has ended: {node.exit_reason or 'no reason given'}." if node.is_finished else "It ends."
        for page in pages:
            page.gone(reason)
