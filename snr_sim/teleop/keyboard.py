"""The keyboard as a gamepad, for a person without one: a sensor of the same readings, from the terminal."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

from snr_sim.devices.terminal_keys import TerminalKeys
from snr_sim.prelude.errors import SensorLostError
from snr_sim.prelude.life_cycle import LifeCycle
from snr_sim.prelude.signals import GamepadReading
from snr_sim.teleop.gamepad_pilot import AXIS_COUNT, BUTTON_COUNT, BUTTONS, Stick

KEY_HOLD_S = (
    0.6  # a terminal does not report when a key is released, only repeats it: the first time after half a second
)
BUTTON_KEYS = {"1": "arm", "2": "disarm", " ": "stop", "c": "clear", "-": "mode_down", "+": "mode_up", "=": "mode_up"}
URGENT = ("stop", "disarm")  # these overtake earlier keys, and cancel "arm" and "clear"
UNDONE = ("arm", "clear")
MAX_WAITING = 8  # presses: a key that is leant on has no effect for seconds afterwards


def legend(sticks: str) -> list[str]:
    """Return lines that name keys and buttons; `sticks` names the robot's keys for its sticks."""
    return [
        "keys      1 arm  2 disarm  space emergency stop  c clear it  - + mode",
        f"          {sticks}",
        "game pad  start arms  back disarms  B emergency stop  Y clears it",
    ]


class Keyboard(LifeCycle):
    """Implements Sensor.

    Args:
        sticks: the keys that move each stick.
        typed: returns the keys typed since its last call, without waiting; None is the program's own terminal.
        now_s: clock of the person who types.
    """

    def __init__(
        self,
        sticks: Mapping[str, Stick],
        typed: Callable[[], str] | None = None,
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._terminal = TerminalKeys() if typed is None else None
        self._typed = self._terminal.typed if self._terminal is not None else typed
        self._now_s = now_s
        self._axes = {
            key: (stick.axis, side)
            for stick in sticks.values()
            for key, side in zip(stick.keys, (-1.0, 1.0), strict=True)
        }
        self._until_s: dict[str, float] = {}  # of keys that move a stick
        self._presses: list[str] = []  # of buttons, each waits for a separate reading
        self._down = ""  # the button that was down in the last reading

    def read(self) -> GamepadReading:
        """Return sticks and buttons as the keys have them.

        Raises:
            SensorLostError: it was closed.
        """
        if self.state == "closed" or self._typed is None:
            raise SensorLostError("The keyboard has been closed.", fix="read before close().")
        now_s, buttons, axes = self._now_s(), [False] * BUTTON_COUNT, [0.0] * AXIS_COUNT
        for key in self._typed().lower():
            if key in BUTTON_KEYS:
                self._press(BUTTON_KEYS[key])
            elif key in self._axes:
                self._until_s[key] = now_s + KEY_HOLD_S
        self._down = self._next_down()
        if self._down:
            buttons[BUTTONS[self._down]] = True
        for key, until_s in self._until_s.items():
            if now_s < until_s:
                axis, side = self._axes[key]
                axes[axis] += side
        return GamepadReading(axes, buttons, [], stamp_s=now_s)

    def _press(self, button: str) -> None:
        """Queue a press for its reading, in the order of typing."""
        if button in URGENT:
            self._presses = [button, *(one for one in self._presses if one not in (*UNDONE, button))]
        elif len(self._presses) < MAX_WAITING:
            self._presses.append(button)

    def _next_down(self) -> str:
        """Return the button that is down in this reading, or "".

        One press per reading; between two presses of a button it is up, because a press is detected by its edge.
        """
        if not self._presses or (self._presses[0] == self._down and self._down not in URGENT):
            return ""
        return self._presses.pop(0)

    def on_close(self) -> None:
        """Restore the terminal."""
        if self._terminal is not None:
            self._terminal.close()
