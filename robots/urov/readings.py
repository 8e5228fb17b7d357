"""Newest readings of the sensors: a page is accepted if its reading is plausible, otherwise the fault is reported.

A page may hold anything: a driver divides by zero, a wire corrupts a byte, a user types it at a console. An invalid
reading is dropped, and the one before it grows older.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import msgspec

from snr_sim import Page
from snr_sim.devices.commands import command_of
from snr_sim.errors import CommandError
from snr_sim.plants import Limit
from snr_sim.prelude.task import ensure_type_info
from snr_sim.signals import DepthReading, ImuReading, LeakReading, PowerReading

AHEAD_S = 0.1  # a reading is stamped by the clock of the run, so none is of times to come
NONSENSE_S = 1.0  # after a page that held no reading, the sensor is not trusted for so long
SILENT_S, SILENT_PERIODS = 0.5, 3.0  # no reading for so long, and for so many of its periods: it is stale
_ANGLE = Limit(-2.0 * math.pi, 2.0 * math.pi, "rad", "a full turn is 6.28 rad")

# Far beyond the parts' ranges: a value outside is not a measurement. Of a list, each number.
CAN_BE: dict[str, tuple[type[Any], Mapping[str, Limit]]] = {
    "depth": (
        DepthReading,
        {
            "depth_m": Limit(-10.0, 1000.0, "m", "an MS5837 ends at 300 m"),
            "pressure_pa": Limit(0.0, 2e7, "Pa", "1000 m of water have 1e7"),
            "temperature_c": Limit(-50.0, 150.0, "degrees Celsius", "the part is made for -20 to 85"),
        },
    ),
    "imu": (
        ImuReading,
        {
            "rate_radps": Limit(-100.0, 100.0, "rad/s", "an ICM-20948 ends at 35"),
            "specific_force_mps2": Limit(-500.0, 500.0, "m/s2", "an ICM-20948 ends at 157"),
            "field_ut": Limit(-1e4, 1e4, "uT", "an ICM-20948 ends at 4900"),
            "roll_rad": _ANGLE,
            "pitch_rad": _ANGLE,
            "yaw_rad": _ANGLE,
        },
    ),
    "power": (
        PowerReading,
        {
            "voltage_v": Limit(-1.0, 100.0, "V", "the module ends at 60"),
            "current_a": Limit(-500.0, 500.0, "A", "the module ends at 120"),
        },
    ),
    "leak": (LeakReading, {}),
}


def reading_of(key: str, data: Any, now_s: float) -> Any:
    """Return the reading that a page's data, which may be anything, is at a moment of the clock that stamps readings.

    A CommandError names the field that is wrong or out of range.
    """
    kind, limits = CAN_BE[key]
    if isinstance(data, msgspec.Struct):  # its types are not checked yet
        data = msgspec.structs.asdict(data)
    reading = command_of(data, kind, {name: (limit.min_value, limit.max_value) for name, limit in limits.items()})
    for name, limit in limits.items():
        value = getattr(reading, name)
        numbers = value if isinstance(value, list) else [value]
        if isinstance(value, list) and len(value) != 3:
            raise CommandError(f"{name} must have 3 numbers, not {len(value)}.", fix="store [x, y, z].")
        for number in numbers:
            if not limit.contains(number):
                raise CommandError(f"{name} is {number!r}.", fix=f"{limit.expected()}: {limit.reason}.")
    if not -math.inf < reading.stamp_s <= now_s + AHEAD_S:
        raise CommandError(
            f"stamp_s is {reading.stamp_s!r}, and the vehicle's clock shows {now_s:.2f} s.",
            fix="stamp a reading with the clock of the run, when it is measured.",
        )
    return reading


class Outputs(msgspec.Struct, frozen=True):
    """State of the outputs: the part of `PwmLoop`'s page `pwm_applied` that the vehicle uses."""

    state: str  # as of `Health`
    fault: str = ""  # its description
    reason: list[str] = []  # words of `AppliedPulses`


def outputs_of(data: Any) -> Outputs | None:
    """Return the state of the outputs; None if the page is not valid."""
    try:
        return msgspec.convert(data, ensure_type_info(Outputs))
    except msgspec.ValidationError:
        return None


class Readings:
    """Keeps, of each sensor, the newest page that held a reading; `rates_hz` says how often each is read."""

    def __init__(self, rates_hz: Mapping[str, float]) -> None:
        self.newest: dict[str, Any] = {}  # the readings
        self.pages: dict[str, Page] = {}  # those that held them
        self._silent_s = {key: max(SILENT_S, SILENT_PERIODS / rates_hz[key]) for key in CAN_BE}
        self._seen: dict[str, Page] = {}
        self._wrong: dict[str, tuple[float, str]] = {}  # time of the last invalid page, and its fault

    def take(self, key: str, page: Page | None, now_s: float) -> bool:
        """Take a sensor's newest page, if it is another than before; return whether it is."""
        if page is None or page is self._seen.get(key):
            return False
        self._seen[key] = page
        try:
            self.newest[key] = reading_of(key, page.data, now_s)
        except CommandError as error:
            self._wrong[key] = now_s, error.message
        else:
            self.pages[key] = page
        return True

    def nonsense(self, now_s: float) -> str:
        """Return a description of the sensors with recent invalid readings; empty if there are none."""
        lately = [f"{key}: {what}" for key, (at_s, what) in self._wrong.items() if now_s - at_s <= NONSENSE_S]
        return " ".join(lately)

    def stale(self, ages_s: Mapping[str, float]) -> str:
        """Return the names of sensors that have been read but have no fresh reading, from the ages of pages."""
        return ", ".join(key for key, age_s in ages_s.items() if age_s > self._silent_s[key])

    def missing(self, ages_s: Mapping[str, float]) -> list[str]:
        """Return descriptions of the sensors without a fresh reading, without which the vehicle cannot be steered."""
        never = [f"{key}: no reading yet" for key in ("depth", "imu") if key not in self.newest]
        old = [f"{key}: newest reading {ages_s[key]:.1f} s old" for key in ages_s if ages_s[key] > self._silent_s[key]]
        return never + old
