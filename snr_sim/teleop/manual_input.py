"""Input devices of a person: a gamepad, with an optional dead-man switch, and the keyboard."""

from __future__ import annotations

import time
from collections.abc import Callable
from itertools import zip_longest
from typing import Any

import msgspec

from snr_sim.prelude.device import Stale
from snr_sim.prelude.errors import MissingExtraError
from snr_sim.prelude.life_cycle import LifeCycle
from snr_sim.prelude.signals import GamepadReading

TRIGGER = 5  # axis of the right trigger on an Xbox controller under Linux: -1 at rest, 1 pressed
PRESSED_FROM = 0.5  # from here on; SDL reports 0 for a trigger that has not been touched yet


class DeadmanSwitch(LifeCycle):
    """A gamepad whose sticks count only while its right trigger is held. Implements Sensor.

    Buttons count at any time, so the emergency stop does, too. A keyboard needs no such switch: a key that is
    released is a stick at rest. The gamepad is open.
    """

    title = "The game controller with its deadman's trigger"

    def __init__(self, gamepad: Any) -> None:
        self._gamepad = gamepad

    def read(self) -> GamepadReading | Stale:
        """Return the gamepad's reading, with its sticks at rest unless the trigger is held.

        Raises:
            SensorLostError: the gamepad is closed.
        """
        reading: GamepadReading | Stale = self._gamepad.read()
        if isinstance(reading, Stale) or (len(reading.axes) > TRIGGER and reading.axes[TRIGGER] >= PRESSED_FROM):
            return reading
        return msgspec.structs.replace(reading, axes=[0.0] * len(reading.axes))

    def on_close(self) -> None:
        """Close the gamepad."""
        self._gamepad.close()


class ManualInput(LifeCycle):
    """A gamepad if one is plugged in, else the keyboard, whose buttons always count. Implements Sensor.

    Readings are stamped by the clock `now_s`.
    """

    def __init__(
        self,
        open_gamepad: Callable[[], Any],
        open_keyboard: Callable[[], Any],
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._now_s = now_s
        try:
            self._gamepad: Any = open_gamepad()
        except MissingExtraError:
            self._gamepad = None
        self._keyboard = open_keyboard()

    def read(self) -> GamepadReading:
        """Return the gamepad's sticks, or the keyboard's if there is none, and the buttons of both.

        So space stops the vehicle, even if another device is mistaken for a gamepad.
        """
        keys: GamepadReading = msgspec.structs.replace(self._keyboard.read(), stamp_s=self._now_s())
        if self._gamepad is None:
            return keys
        gamepad: GamepadReading | Stale = self._gamepad.read()
        if isinstance(gamepad, Stale):
            return msgspec.structs.replace(keys, is_connected=False)
        either = [
            of_gamepad or of_keys for of_gamepad, of_keys in zip_longest(gamepad.buttons, keys.buttons, fillvalue=False)
        ]
        return msgspec.structs.replace(gamepad, buttons=either, stamp_s=keys.stamp_s)

    def on_close(self) -> None:
        """Close both."""
        if self._gamepad is not None:
            self._gamepad.close()
        self._keyboard.close()
