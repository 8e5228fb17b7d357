"""A real game controller, through pygame-ce: the only module that imports that package.

SDL, which pygame uses, reports pads only while its video part runs. A robot has no window, so that part runs without
a screen (SDL's "dummy" driver) unless the program has opened a window before.
"""

from __future__ import annotations

import importlib
import os
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from snr_sim.prelude.device import Stale
from snr_sim.prelude.errors import MissingExtraError, SensorLostError
from snr_sim.prelude.life_cycle import LifeCycle
from snr_sim.prelude.signals import GamepadReading

if TYPE_CHECKING:
    from types import ModuleType

    from pygame.joystick import JoystickType

_SETTINGS = {
    "PYGAME_HIDE_SUPPORT_PROMPT": "1",  # standard output is reserved for the program
    "SDL_VIDEODRIVER": "dummy",
    "SDL_AUDIODRIVER": "dummy",
    "SDL_JOYSTICK_ALLOW_BACKGROUND_EVENTS": "1",  # without a window there is no focus
    "SDL_NO_SIGNAL_HANDLERS": "1",  # SDL would replace the node's handler of SIGTERM
}


def start_pygame() -> ModuleType:
    """Return pygame, initialised to report pads; raise a MissingExtraError if it is not installed.

    Variables that the environment already has are kept.
    """
    for name, value in _SETTINGS.items():
        os.environ.setdefault(name, value)
    try:
        pygame = importlib.import_module("pygame")  # slow to import, and only a real pad needs it
    except ImportError:
        raise MissingExtraError("pygame-ce", "pad") from None
    pygame.display.init()
    pygame.joystick.init()
    return pygame


class PygameGamepad(LifeCycle):
    """A game controller. Implements `Sensor`; one that was unplugged is found again automatically.

    Args:
        index: its number if there are several: 0 is the first.
        now_s: the clock that stamps readings.

    Raises:
        MissingExtraError: pygame-ce is not installed.
    """

    def __init__(self, index: int = 0, now_s: Callable[[], float] = time.monotonic) -> None:
        self._now_s = now_s
        self._pygame = start_pygame()
        self._has_screen = self._pygame.display.get_driver() != "dummy"
        self._index = index
        self.title: str = f"Game controller {index}"

    def read(self) -> GamepadReading | Stale:
        """Return sticks and buttons; `Stale` without a pad; raise a SensorLostError once it is closed."""
        if self.state == "closed":
            raise SensorLostError("This pad has been closed.", fix="call read() before close().")
        pygame = self._pygame
        pygame.event.pump()  # makes SDL update the list of pads and their sticks
        if not self._has_screen:
            pygame.event.clear()  # no other code reads events
        count = pygame.joystick.get_count()
        if count <= self._index:
            return Stale(
                f"Game controller {self._index} is not connected ({count} are). It is found when it is plugged in."
            )
        # Opened each time, which costs 1 us if it is open already: a pad that was lost and came back has a new index.
        return _reading_of(pygame.joystick.Joystick(self._index), self._now_s())


def _reading_of(pad: JoystickType, stamp_s: float) -> GamepadReading:
    return GamepadReading(
        [pad.get_axis(i) for i in range(pad.get_numaxes())],
        [bool(pad.get_button(i)) for i in range(pad.get_numbuttons())],
        [[int(one) for one in pad.get_hat(i)] for i in range(pad.get_numhats())],
        stamp_s=stamp_s,
    )
