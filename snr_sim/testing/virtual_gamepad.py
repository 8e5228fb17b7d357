"""Virtual gamepad that a program controls: SDL treats it as a real one, so from SDL on all code is as on a robot."""

from __future__ import annotations

import ctypes
import ctypes.util
from pathlib import Path

from snr_sim.devices.pygame_gamepad import start_pygame
from snr_sim.prelude.errors import DeviceError

_GAME_CONTROLLER = 1  # SDL_JOYSTICK_TYPE_GAMECONTROLLER
_FULL = 32767  # SDL's number for a stick at its end


class VirtualGamepad:
    """A pad of 6 axes, 15 buttons and a hat, plugged into this process.

    Args:
        axes: how many.
        buttons: how many.
        hats: how many.

    Raises:
        MissingExtraError: pygame-ce is not installed.
        DeviceError: SDL is too old to have virtual pads (before 2.0.14), or is not found.
    """

    def __init__(self, axes: int = 6, buttons: int = 15, hats: int = 1) -> None:
        self._shape = (axes, buttons, hats)
        self._sdl = _sdl()
        self._pad: ctypes.c_void_p | None = None
        self._instance = -1
        self.plug_in()

    def plug_in(self) -> None:
        """Plug it in, if it is not."""
        if self._pad is not None:
            return
        index = self._sdl.SDL_JoystickAttachVirtual(_GAME_CONTROLLER, *self._shape)
        if index < 0:
            raise DeviceError("SDL does not let a virtual pad be plugged in.", fix="a newer pygame-ce.")
        self._instance = self._sdl.SDL_JoystickGetDeviceInstanceID(index)
        self._pad = ctypes.c_void_p(self._sdl.SDL_JoystickOpen(index))
        for axis in range(self._shape[0]):
            self.move(axis, 0.0)  # SDL puts triggers at -1; the test sets them if it needs that

    def move(self, axis: int, position: float) -> None:
        """Move an axis: -1 to 1."""
        self._sdl.SDL_JoystickSetVirtualAxis(self._pad, axis, ctypes.c_int16(round(position * _FULL)))

    def press(self, button: int, is_down: bool = True) -> None:
        """Press a button, or release it."""
        self._sdl.SDL_JoystickSetVirtualButton(self._pad, button, ctypes.c_uint8(is_down))

    def unplug(self) -> None:
        """Unplug it. Safe to call twice."""
        if self._pad is None:
            return
        for index in range(self._sdl.SDL_NumJoysticks()):
            if self._sdl.SDL_JoystickGetDeviceInstanceID(index) == self._instance:
                self._sdl.SDL_JoystickDetachVirtual(index)
                break
        self._sdl.SDL_JoystickClose(self._pad)
        self._pad = None


def _sdl() -> ctypes.CDLL:
    """Return the same SDL library that pygame has loaded: another copy would not share its pads."""
    package = Path(str(start_pygame().__file__)).parent
    places = [
        *package.parent.glob("pygame_ce.libs/libSDL2-2*"),
        *package.glob(".dylibs/libSDL2-2*"),
        package / "SDL2.dll",
    ]
    found = next((str(place) for place in places if place.is_file()), None) or ctypes.util.find_library("SDL2-2.0")
    if found is None:
        raise DeviceError("The SDL library that pygame uses was not found.", fix="pygame-ce from its own wheel.")
    sdl = ctypes.CDLL(found)
    if not hasattr(sdl, "SDL_JoystickAttachVirtual"):
        raise DeviceError("This SDL has no virtual pads.", fix="a newer pygame-ce.")
    sdl.SDL_JoystickOpen.restype = ctypes.c_void_p
    return sdl
