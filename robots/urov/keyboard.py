"""The keyboard as a game controller, for who has none: a Sensor of the same readings, from the terminal.

w s   ahead, astern     a d   left, right        1 2   arm, disarm       space   emergency stop
i k   up, down          j l   turn left, right   - +   mode down, up     c       clear the stop
"""

from __future__ import annotations

import time
from collections.abc import Callable
from itertools import zip_longest
from typing import Any

import msgspec

from snr_sim.devices.terminal_keys import TerminalKeys
from snr_sim.prelude.device import Stale
from snr_sim.prelude.errors import MissingExtra, SensorLost
from snr_sim.prelude.life_cycle import LifeCycle
from snr_sim.prelude.signals import PadReading

from .pad_pilot import AXES, AXIS_COUNT, BUTTON_COUNT, BUTTONS

# A terminal does not tell when a key is let go, only repeats it: the first time after half a second.
KEPT_S = 0.6
STICK_KEYS = {
    "w": ("surge", -1.0), "s": ("surge", 1.0), "a": ("sway", -1.0), "d": ("sway", 1.0),
    "i": ("heave", -1.0), "k": ("heave", 1.0), "j": ("yaw", -1.0), "l": ("yaw", 1.0),
}  # fmt: skip
LEGEND = (
    "keys      1 arm  2 disarm  space emergency stop  c clear it  - + mode",
    "          w s ahead, astern  a d left, right  i k up, down  j l turn",
    "game pad  start arms  back disarms  B emergency stop  Y clears it",
)
URGENT = ("stop", "disarm")  # these overtake what was typed before them, and undo it
UNDONE = ("arm", "clear")
MOST_WAITING = 8  # presses: whoever leans on a key is not obeyed for seconds afterwards
BUTTON_KEYS = {"1": "arm", "2": "disarm", " ": "stop", "c": "clear", "-": "mode_down", "+": "mode_up", "=": "mode_up"}


class Keyboard(LifeCycle):
    """Keeps the promise of Sensor.

    Args:
        typed: returns what was typed since it was asked last, at once; None is the program's own terminal.
        now_s: tells the time by which a person types.
    """

    def __init__(self, typed: Callable[[], str] | None = None, now_s: Callable[[], float] = time.monotonic) -> None:
        self._terminal = TerminalKeys() if typed is None else None
        self._typed = self._terminal.typed if self._terminal is not None else typed
        self._now_s = now_s
        self._until_s: dict[str, float] = {}  # of keys that move a stick
        self._presses: list[str] = []  # of buttons, that wait for a reading of their own
        self._down = ""  # the button that was down in the last reading

    def read(self) -> PadReading:
        """Returns sticks and buttons as the keys have them.

        Raises:
            SensorLost: it was closed.
        """
        if self.state == "closed" or self._typed is None:
            raise SensorLost("The keyboard has been closed.", fix="read before close().")
        now_s, buttons, axes = self._now_s(), [False] * BUTTON_COUNT, [0.0] * AXIS_COUNT
        for key in self._typed().lower():
            if key in BUTTON_KEYS:
                self._press(BUTTON_KEYS[key])
            elif key in STICK_KEYS:
                self._until_s[key] = now_s + KEPT_S
        self._down = self._next_down()
        if self._down:
            buttons[BUTTONS[self._down]] = True
        for key, until_s in self._until_s.items():
            if now_s < until_s:
                stick, side = STICK_KEYS[key]
                axes[AXES[stick]] += side
        return PadReading(axes, buttons, [], stamp_s=now_s)

    def _press(self, button: str) -> None:
        """Has a press wait for its reading, in the order of typing."""
        if button in URGENT:
            self._presses = [button, *(one for one in self._presses if one not in (*UNDONE, button))]
        elif len(self._presses) < MOST_WAITING:
            self._presses.append(button)

    def _next_down(self) -> str:
        """Returns the button that is down in this reading, or "".

        One press a reading, and the same button is let go between two of its own: a press is seen by its beginning.
        """
        if not self._presses or (self._presses[0] == self._down and self._down not in URGENT):
            return ""
        return self._presses.pop(0)

    def on_close(self) -> None:
        """Gives the terminal back."""
        if self._terminal is not None:
            self._terminal.close()


class Hands(LifeCycle):
    """A game controller if one is plugged in, else the keyboard; its buttons always count. Keeps the promise of Sensor.

    Args:
        open_pad: opens the controller.
        open_keyboard: opens the keyboard.
        now_s: the clock that readings are stamped by.
    """

    def __init__(
        self,
        open_pad: Callable[[], Any],
        open_keyboard: Callable[[], Any] = Keyboard,
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._now_s = now_s
        try:
            self._pad: Any = open_pad()
        except MissingExtra:
            self._pad = None
        self._keyboard = open_keyboard()

    def read(self) -> PadReading:
        """Returns the controller's sticks, or the keyboard's if there is none; and the buttons of both.

        So space stops the vehicle, whatever may be plugged in and taken for a controller.
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
        """Lets go of both."""
        if self._pad is not None:
            self._pad.close()
        self._keyboard.close()
