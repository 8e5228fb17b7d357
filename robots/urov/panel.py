"""The panel at the surface: a red button that stops, and one beside it that resets. In simulation, pressed as asked.

    snr run urov_gate --controller mission.py --option stop=12 --option reset=20

A button is down for a moment only: who reads the page must remember what was pressed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from snr_sim import Loop, LoopFactory
from snr_sim.prelude.node_api import NodeApi

PRESSED_S = 0.2  # as long as a finger stays on a button: our own choice


class PanelFactory(LoopFactory):
    """Makes the panel.

    Args:
        presses_s: for each button the moments at which it goes down.
        rate_hz: how often its page is stored.
    """

    def __init__(self, presses_s: Mapping[str, Sequence[float]], rate_hz: float) -> None:
        super().__init__()
        self.presses_s = presses_s
        self.rate_hz = rate_hz

    def get(self, parent: NodeApi) -> Panel:
        """Returns the loop 'panel'."""
        return Panel(self, parent, "panel", self.rate_hz)


class Panel(Loop):
    """Stores page 'panel': for each button, whether it is down."""

    factory: PanelFactory

    def loop(self) -> None:
        """Stores what is down now."""
        now_s = self.get_time_s()
        down = {
            button: any(at_s - 1e-9 <= now_s < at_s + PRESSED_S - 1e-9 for at_s in moments_s)
            for button, moments_s in self.factory.presses_s.items()
        }
        self.store_data("panel", down)
