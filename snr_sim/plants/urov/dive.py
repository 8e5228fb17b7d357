"""What a dive begins with, and what happens to it: currents, loads, leaks and failures, by the clock."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from snr_sim.plants.parameter_limits import LIMITS, Record, check_number, check_record, format_value, is_number
from snr_sim.plants.urov.propulsion import FAULTS
from snr_sim.plants.urov.tether import Tether
from snr_sim.plants.urov.vehicle import Vector
from snr_sim.prelude.errors import ParameterError, suggest

STILL: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Payload:
    """Small payload that is attached to the vehicle for a while. It has mass, so it also makes the vehicle sluggish.

    Args:
        volume_m3: of the water it displaces; a kilogram of lead has 0.000088.
        position_m: body frame.
        start_s, end_s: when it is attached, and released.
    """

    mass_kg: Annotated[float, LIMITS["load_kg"]]
    volume_m3: Annotated[float, LIMITS["load_m3"]] = 0.0
    position_m: Annotated[Vector, LIMITS["body_position_m"]] = STILL
    start_s: Annotated[float, LIMITS["time_s"]] = 0.0
    end_s: float = math.inf

    def __post_init__(self) -> None:
        check_record(self, "The load's ")
        if not is_number(self.end_s) or not self.start_s < self.end_s:
            raise ParameterError(
                f"The load's end_s is {format_value(self.end_s)}, and it is taken up at {self.start_s:g} s.",
                fix="release it later, or leave out end_s to never release it.",
            )


@dataclass(frozen=True)
class Leak(Record, who="The leak's "):
    """Water that leaks into the hull.

    Args:
        rate_lps: litres a second, from `start_s` on.
        max_l: when the hull is full.
        position_m: where it gathers, body frame.
    """

    start_s: Annotated[float, LIMITS["time_s"]]
    rate_lps: Annotated[float, LIMITS["leak_lps"]]
    max_l: Annotated[float, LIMITS["leak_l"]] = 2.0
    position_m: Annotated[Vector, LIMITS["body_position_m"]] = STILL

    def water_l(self, time_s: float) -> float:
        """Return how much is in."""
        return min(self.max_l, max(0.0, time_s - self.start_s) * self.rate_lps)


@dataclass(frozen=True)
class ThrusterFault:
    """A thruster that breaks.

    Args:
        at_s: when.
        thruster: its name, or its number from 0.
        fault: 'off', 'weak', 'stuck' or 'none', as in `Propulsion.fail`.
        effectiveness: fraction of its force that a weak one keeps.
    """

    at_s: Annotated[float, LIMITS["time_s"]]
    thruster: int | str
    fault: str = "off"
    effectiveness: Annotated[float, LIMITS["share"]] = 0.5

    def __post_init__(self) -> None:
        check_record(self, "The thruster fault's ")
        if not isinstance(self.fault, str) or self.fault not in FAULTS:
            raise ParameterError(
                f"A thruster cannot be {format_value(self.fault)}.", fix=suggest(str(self.fault), FAULTS)
            )

    def number_in(self, names: Sequence[str]) -> int:
        """Return the thruster's number among a vehicle's; raise a ParameterError that lists these if it has none."""
        if isinstance(self.thruster, str):
            found = names.index(self.thruster) if self.thruster in names else -1
        else:
            found = int(self.thruster) if is_number(self.thruster) and self.thruster % 1 == 0 else -1
        if not 0 <= found < len(names):
            raise ParameterError(
                f"The dive has thruster {format_value(self.thruster)} fail at {self.at_s:g} s, and there is no such "
                "thruster.",
                fix=f"by name, {suggest(str(self.thruster), names)} Or by number: 0 to {len(names) - 1}.",
            )
        return found


@dataclass(frozen=True)
class Current(Record, who="The current's "):
    """The speed of all water from a moment on.

    It changes at once, and the vehicle keeps its own speed over ground: the pressure that makes real water speed up,
    and would carry the vehicle along, is left out.

    Args:
        velocity_mps: world frame, from `start_s` on.
    """

    start_s: Annotated[float, LIMITS["time_s"]]
    velocity_mps: Annotated[Vector, LIMITS["speed_mps"]]


@dataclass(frozen=True)
class Dive:
    """Where a run begins, and what happens in it.

    Args:
        position_m: of the vehicle's origin, world frame; z is 0 at the surface and negative below. Above it, up to
            100 m, the vehicle falls freely, without the drag of air.
        attitude_rad: roll, pitch and yaw, about x, y, z in this order of naming: yaw is turned first.
        velocity_mps: world frame.
        rate_radps: body frame.
        currents: in the order of their times; before the first, the water is still.
        loads: what hangs at the vehicle.

    Raises:
        ParameterError: a number is out of range, or currents are out of order.
    """

    position_m: Annotated[Vector, LIMITS["position_m"]] = (0.0, 0.0, -1.0)
    attitude_rad: Annotated[Vector, LIMITS["angle_rad"]] = STILL
    velocity_mps: Annotated[Vector, LIMITS["start_mps"]] = STILL
    rate_radps: Annotated[Vector, LIMITS["start_radps"]] = STILL
    currents: Annotated[tuple[Current, ...], "Current(...)"] = ()
    loads: Annotated[tuple[Payload, ...], "Payload(...)"] = ()
    leak: Annotated[Leak | None, "a dive has one Leak, or None."] = None
    faults: Annotated[tuple[ThrusterFault, ...], "ThrusterFault(...)"] = ()
    tether: Annotated[Tether | None, "a dive has one Tether, or None."] = None

    def __post_init__(self) -> None:
        check_record(self, "The dive's ")
        check_number("The dive's position_m", self.position_m[2], LIMITS["height_m"], "z")
        times = [current.start_s for current in self.currents]
        if times != sorted(times):
            raise ParameterError(f"Currents begin at {times} s.", fix="name them in the order of their times.")

    def times_s(self) -> list[float]:
        """Return the moments at which something happens, in order, each once."""
        moments = {current.start_s for current in self.currents} | {fault.at_s for fault in self.faults}
        for load in self.loads:
            moments |= {load.start_s, load.end_s}
        return sorted(moments - {math.inf})

    def current_at(self, time_s: float) -> Vector:
        """Return the speed of the water, world frame."""
        begun = [current.velocity_mps for current in self.currents if current.start_s <= time_s]
        return begun[-1] if begun else STILL

    def loads_at(self, time_s: float) -> list[Payload]:
        """Return what hangs at the vehicle."""
        return [load for load in self.loads if load.start_s <= time_s < load.end_s]
