"""A game controller whose sticks count only while its right trigger is held: hands that have gone do not fly.

`--option deadman=yes`. Buttons count at any time, so the emergency stop does, too. A keyboard needs none: a key that is
let go is a stick that is let go.
"""

from __future__ import annotations

from typing import Any

import msgspec

from snr_sim.prelude.device import Stale
from snr_sim.prelude.life_cycle import LifeCycle
from snr_sim.prelude.signals import PadReading

TRIGGER = 5  # its axis on an Xbox controller under Linux: -1 at rest, 1 pressed
HELD = 0.5  # from here on; SDL says 0 of a trigger that has not been touched yet


class Deadman(LifeCycle):
    """Keeps the promise of Sensor.

    Args:
        pad: the controller, open.
    """

    title = "The game controller with its deadman's trigger"

    def __init__(self, pad: Any) -> None:
        self._pad = pad

    def read(self) -> PadReading | Stale:
        """Returns what the pad reads, with its sticks at rest unless the trigger is held.

        Raises:
            SensorLost: the pad is closed.
        """
        reading: PadReading | Stale = self._pad.read()
        if isinstance(reading, Stale) or (len(reading.axes) > TRIGGER and reading.axes[TRIGGER] >= HELD):
            return reading
        return msgspec.structs.replace(reading, axes=[0.0] * len(reading.axes))

    def on_close(self) -> None:
        """Closes the pad."""
        self._pad.close()
