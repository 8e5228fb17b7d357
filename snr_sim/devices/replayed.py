"""A sensor that returns a recorded sensor's readings at their recorded times."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import msgspec

from snr_sim.prelude.device import Stale
from snr_sim.prelude.errors import DeviceError, SensorLostError
from snr_sim.prelude.life_cycle import LifeCycle
from snr_sim.prelude.task import Page, ensure_type_info

_ROUNDING_S = 1e-6


class ReplayedSensor(LifeCycle):
    """Returns the newest page that was stored by now. Implements `Sensor`.

    Where the recording has no new page, the sensor had no reading, and this one has none either.

    Args:
        key: of the pages.
        pages: pages of the recorded sensor, in order.
        reading_type: struct of its readings.
        now_s: the clock of this run.
    """

    def __init__(
        self, key: str, pages: Sequence[Page], reading_type: type[msgspec.Struct], now_s: Callable[[], float]
    ) -> None:
        self.title: str = f"The recorded sensor '{key}'"
        self._pages, self._type, self._now_s = pages, reading_type, now_s
        self._next = 0

    def read(self) -> Any:
        """Return the newest reading, or `Stale` where there was none; a page of other data raises a DeviceError."""
        if self.state == "closed":
            raise SensorLostError(f"{self.title} was closed.", fix="open another.")
        now_s, before = self._now_s() + _ROUNDING_S, self._next
        while self._next < len(self._pages) and self._pages[self._next].created_at_s <= now_s:
            self._next += 1
        if self._next > before:
            return self._reading(self._pages[self._next - 1])
        since_s = self._pages[before - 1].created_at_s if before else None
        if before == len(self._pages):
            return Stale(f"the recording of it ended at {since_s} s.", since_s)
        return Stale(f"in the recording it had none until {self._pages[before].created_at_s:g} s.", since_s)

    def _reading(self, page: Page) -> Any:
        try:
            return msgspec.convert(page.data, ensure_type_info(self._type))
        except msgspec.ValidationError as error:
            raise DeviceError(
                f"{self.title}: the page of {page.created_at_s:g} s holds no {self._type.__name__}: {error}.",
                fix="replay with the version of the robot that recorded the run.",
            ) from error
