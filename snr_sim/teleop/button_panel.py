"""A panel of buttons at the surface, such as an emergency stop; in simulation, pressed at given times.

A button is down for a moment only: the component that reads the page must remember what was pressed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from snr_sim.core.loop import Loop, LoopFactory
from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.node_api import NodeApi

PRESS_DURATION_S = 0.2  # as long as a finger stays on a button: our own choice


class ButtonPanelFactory(LoopFactory):
    """Makes the panel, which stores its page at a rate; `presses_s` are the times at which each button goes down."""

    def __init__(self, key: str, presses_s: Mapping[str, Sequence[float]], rate_hz: float) -> None:
        super().__init__()
        self.key: str = key
        self.presses_s: Mapping[str, Sequence[float]] = presses_s
        self.rate_hz: float = rate_hz

    def get(self, parent: NodeApi) -> ButtonPanel:
        """Return the loop, named as its page."""
        return ButtonPanel(self, parent, self.key, self.rate_hz)


class ButtonPanel(Loop):
    """Stores for each button whether it is down."""

    factory: ButtonPanelFactory

    def loop(self) -> None:
        """Store the buttons that are down now."""
        now_s = self.get_time_s()
        down = {
            button: any(at_s - 1e-9 <= now_s < at_s + PRESS_DURATION_S - 1e-9 for at_s in moments_s)
            for button, moments_s in self.factory.presses_s.items()
        }
        self.store_data(self.factory.key, down)


def presses_of(options: Mapping[str, str], buttons: Sequence[str]) -> dict[str, tuple[float, ...]]:
    """Return the times at which each button is pressed, from options such as `--option stop=12,30.5`.

    Raises:
        ParameterError: a value is not a time of the run.
    """
    return {button: _moments_s(button, options[button]) if button in options else () for button in buttons}


def _moments_s(button: str, text: str) -> tuple[float, ...]:
    try:
        moments_s = tuple(float(one) for one in text.split(","))
    except ValueError:
        moments_s = (math.nan,)
    if not all(0.0 <= one < math.inf for one in moments_s):
        raise ParameterError(f"--option {button}={text} is not a time in the run.", fix=f"seconds: {button}=12.5")
    return moments_s
