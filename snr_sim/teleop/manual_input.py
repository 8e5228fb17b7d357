"""Input devices of a person: a gamepad, with an optional dead-man switch, and the keyboard."""

from __future__ import annotations

import time
from collections.abc import Callable
from itertools import zip_longest
from typing import Any

import msgspec

from snr_sim.prelude.device import Stale
from snr_sim.prelude.errors import MissingExtra
from snr_sim.prelude.life_cycle import LifeCycle
from snr_sim.prelude.signals import PadReading

TRIGGER = 5  # axis of the right trigger on an Xbox controller under Linux: -1 at rest, 1 pressed
HELD = 0.5  # from here on; SDL reports 0 for a trigger that has not been touched yet


class DeadmanSwitch(LifeCycle):
    """A gamepad whose sticks count only while its right trigger is held. Implements Sensor.

    Buttons count at any time, so the emergency stop does, too. A keyboard needs no such switch: a key that is
    released is a stick at rest.

    Args:
        pad: the gamepad, open.
    """

    title = "The game controller with its deadman's trigger"

    def __init__(self, pad: Any) -> None:
        self._pad = pad

    def read(self) -> PadReading | Stale:
        """Return the gamepad's reading, with its sticks at rest unless the trigger is held.

        Raises:
            SensorLost: the gamepad is closed.
        """
        reading: PadReading | Stale = self._pad.read()
        if isinstance(reading, Stale) or (len(reading.axes) > TRIGGER and reading.axes[TRIGGER] >= HELD):
            return reading
        return msgspec.structs.replace(reading, axes=[0.0] * len(reading.axes))

    def on_close(self) -> None:
        """Close the gamepad."""
        self._pad.close()


class ManualInput(LifeCycle):
    """A gamepad if one is plugged in, else the keyboard, whose buttons always count. Implements Sensor.

    Args:
        open_pad: opens the gamepad.
        open_keyboard: opens the keyboard.
        now_s: the clock that stamps readings.
    """

    def __init__(
        self,
        open_pad: Callable[[], Any],
        open_keyboard: Callable[[], Any],
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._now_s = now_s
        try:
            self._pad: Any = open_pad()
        except MissingExtra:
            self._pad = None
        self._keyboard = open_keyboard()

    def read(self) -> PadReading:
        """Return the gamepad's sticks, or the keyboard's if there is none, and the buttons of both.

        So space stops the vehicle, even if another device is mistaken for a gamepad.
        """
        keys: PadReading = msgspec.structs.replace(self._keyboard.read(), stamp_s=self._now_s())
        if self._pad is None:
            return keys
        pad: PadReading | Stale = self._pad.read()
        if isinstance(pad, Stale):
            return msgspec.structs.replace(keys, is_connected=False)
        either = [of_pad or of_keys for of_pad, of_keys in zip_longest(pad.buttons, keys.buttons, fillvalue=False)]
        return msgspec.structs.replace(pad, buttons=either, stamp_s=keys.stamp_s)

    def on_close(self) -> None:
        """Close both."""
        if self._pad is not None:
            self._pad.close()
        self._keyboard.close()
