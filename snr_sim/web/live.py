"""LiveLoop: serves the live page of the machines of a node."""

from __future__ import annotations

import asyncio
from collections import deque
from pathlib import Path

from snr_sim.behaviors.endpoint import MachineEndpoint
from snr_sim.prelude.node_api import NodeApi
from snr_sim.web.live_machine import LiveMachine
from snr_sim.web.moments import MAX_MOMENTS
from snr_sim.web.session import MachinePage
from snr_sim.web.timeline import PAGE_SOURCE
from snr_sim.web.web_loop import WebLoop, WebLoopFactory


class LiveLoopFactory(WebLoopFactory):
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
        fix = "--live-token-file FILE with at least 16 characters in it, or leave --live-host out."
        super().__init__(port, host, token, name, who="A live page", token_fix=fix)
        self.title: str = title
        self.folder: Path | None = None

    def get(self, parent: NodeApi) -> LiveLoop:
        """Return the loop."""
        return LiveLoop(self, parent)


class LiveLoop(WebLoop):
    """Loop that serves pages."""

    factory: LiveLoopFactory
    is_robot_component = False

    def begin(self) -> None:
        """Listen, and start the thread.

        Raises:
            LinkError: the port is taken, or the host is not this machine.
        """
        for one in self.parent.components.values():
            if isinstance(one, MachineEndpoint):
                one.recent = deque(maxlen=MAX_MOMENTS)  # before it begins, if this loop is the first component
        super().begin()

    async def _serve(self) -> None:
        from snr_sim.web.server import serve  # slow to import, and not installed everywhere

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
