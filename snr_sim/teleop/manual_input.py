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
    """A gamepad whose sticks count only while its right trigger, or another button, is held. Implements Sensor.

    Buttons count at any time, so the emergency stop does, too. A keyboard needs no such switch: a key that is
    released is a stick at rest.

    Args:
        gamepad: an open one.
        button: number of the button, which then does nothing else; None: the trigger.
    """

    title = "The game controller with its deadman's trigger"

    def __init__(self, gamepad: Any, button: int | None = None) -> None:
        self._gamepad, self._button = gamepad, button

    def read(self) -> GamepadReading | Stale:
        """Return the gamepad's reading, with its sticks at rest unless the switch is held.

        Raises:
            SensorLostError: the gamepad is closed.
        """
        reading: GamepadReading | Stale = self._gamepad.read()
        if isinstance(reading, Stale):
            return reading
        if self._button is None:
            is_held = len(reading.axes) > TRIGGER and reading.axes[TRIGGER] >= PRESSED_FROM
        else:
            is_held = any(reading.buttons[self._button : self._button + 1])
            buttons = [is_down and i != self._button for i, is_down in enumerate(reading.buttons)]
            reading = msgspec.structs.replace(reading, buttons=buttons)
        return reading if is_held else msgspec.structs.replace(reading, axes=[0.0] * len(reading.axes))

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
