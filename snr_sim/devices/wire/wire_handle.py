"""The port or bus of one device: opened when the device is configured, and closed with it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Generic, TypeVar

from snr_sim.prelude.errors import DeviceError

WireT = TypeVar("WireT", bound=Any)


class WireHandle(Generic[WireT]):
    """A wire that may be open; `device`, by its `title`, is named in the error of one that is not."""

    def __init__(self, open_wire: Callable[[], WireT], device: Any) -> None:
        self._open_wire, self._device = open_wire, device
        self._wire: WireT | None = None

    def open(self) -> WireT:
        """Open the wire again, and return it."""
        self.close()
        self._wire = self._open_wire()
        return self._wire

    def get(self) -> WireT:
        """Return the open wire; raise a DeviceError if it is not."""
        if self._wire is None:
            raise DeviceError(f"{self._device.title} is not open.", fix="call configure() first.")
        return self._wire

    def close(self) -> None:
        """Close the wire. Safe to call twice."""
        wire, self._wire = self._wire, None
        if wire is not None:
            wire.close()
