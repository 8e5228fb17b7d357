"""What a dive begins with, and what happens to it: currents, loads, leaks and failures, by the clock."""

from __future__ import annotations

import math
from dataclasses import dataclass

from snr_sim.plants.tether import Tether
from snr_sim.plants.vehicle import Vector
from snr_sim.prelude.errors import ParameterError

FASTEST = 100.0  # m/s, rad/s: nothing begins a dive faster
STILL: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Load:
    """Something small that hangs at the vehicle for a while. It has mass, so it also makes the vehicle sluggish.

    Args:
        mass_kg: of it.
        volume_m3: of the water it displaces; a kilogram of lead has 0.000088.
        place_m: body frame.
        from_s: when it is taken up.
        until_s: when it is let go.
    """

    mass_kg: float
    volume_m3: float = 0.0
    place_m: Vector = STILL
    from_s: float = 0.0
    until_s: float = math.inf

    def __post_init__(self) -> None:
        if not (0.0 < self.mass_kg < math.inf and 0.0 <= self.volume_m3 < math.inf):
            raise ParameterError(
                f"A load of {self.mass_kg} kg and {self.volume_m3} m3.", fix="give a mass above 0 and a volume, or 0."
            )
        if not self.from_s < self.until_s:
            raise ParameterError(f"A load from {self.from_s} s until {self.until_s} s.", fix="let it go later.")


@dataclass(frozen=True)
class Leak:
    """Water that comes into the hull.

    Args:
        from_s: when it begins.
        rate_lps: litres a second.
        most_l: when the hull is full.
        place_m: where it gathers, body frame.
    """

    from_s: float
    rate_lps: float
    most_l: float = 2.0
    place_m: Vector = STILL

    def __post_init__(self) -> None:
        if not (0.0 <= self.rate_lps < math.inf and 0.0 <= self.most_l < math.inf):
            raise ParameterError(f"A leak of {self.rate_lps} l/s into {self.most_l} l.", fix="give 0 or more.")

    def water_l(self, time_s: float) -> float:
        """Returns how much is in."""
        return min(self.most_l, max(0.0, time_s - self.from_s) * self.rate_lps)


@dataclass(frozen=True)
class ThrusterFault:
    """A thruster that breaks.

    Args:
        at_s: when.
        thruster: its number, from 0.
        fault: 'off', 'weak', 'stuck' or 'none', as in `Propulsion.fail`.
        share: of its force that a weak one keeps.
    """

    at_s: float
    thruster: int
    fault: str = "off"
    share: float = 0.5


@dataclass(frozen=True)
class Current:
    """The speed of all water from a moment on.

    It changes at once, and the vehicle keeps its own speed over ground: the pressure that makes real water speed up,
    and would carry the vehicle along, is left out.

    Args:
        from_s: when it begins.
        velocity_mps: world frame.
    """

    from_s: float
    velocity_mps: Vector


@dataclass(frozen=True)
class Dive:
    """Where a run begins, and what happens in it.

    Args:
        position_m: of the vehicle's origin, world frame; z is 0 at the surface and negative below.
        attitude_rad: roll, pitch and yaw, about x, y, z in this order of naming: yaw is turned first.
        velocity_mps: world frame.
        rate_radps: body frame.
        currents: in the order of their times; before the first, the water is still.
        loads: what hangs at the vehicle.
        leak: if there is one.
        faults: of thrusters.
        tether: if there is one.

    Raises:
        ParameterError: a number is not finite, or currents are out of order.
    """

    position_m: Vector = (0.0, 0.0, -1.0)
    attitude_rad: Vector = STILL
    velocity_mps: Vector = STILL
    rate_radps: Vector = STILL
    currents: tuple[Current, ...] = ()
    loads: tuple[Load, ...] = ()
    leak: Leak | None = None
    faults: tuple[ThrusterFault, ...] = ()
    tether: Tether | None = None

    def __post_init__(self) -> None:
        for name in ("position_m", "attitude_rad", "velocity_mps", "rate_radps"):
            if not math.isfinite(sum(getattr(self, name))):
                raise ParameterError(f"A dive begins with {name} = {getattr(self, name)}.", fix="give finite numbers.")
        if math.hypot(*self.velocity_mps, *self.rate_radps) > FASTEST:
            raise ParameterError(
                f"A dive begins at {self.velocity_mps} m/s and {self.rate_radps} rad/s.", fix=f"stay below {FASTEST:g}."
            )
        for current in self.currents:
            if not math.isfinite(sum(current.velocity_mps)):
                raise ParameterError(f"A current of {current.velocity_mps} m/s.", fix="give finite numbers.")
        times = [current.from_s for current in self.currents]
        if times != sorted(times):
            raise ParameterError(f"Currents begin at {times} s.", fix="name them in the order of their times.")

    def times_s(self) -> list[float]:
        """Returns the moments at which something happens, in order, each once."""
        moments = {current.from_s for current in self.currents} | {fault.at_s for fault in self.faults}
        for load in self.loads:
            moments |= {load.from_s, load.until_s}
        return sorted(moments - {math.inf})

    def current_at(self, time_s: float) -> Vector:
        """Returns the speed of the water, world frame."""
        begun = [current.velocity_mps for current in self.currents if current.from_s <= time_s]
        return begun[-1] if begun else STILL

    def loads_at(self, time_s: float) -> list[Load]:
        """Returns what hangs at the vehicle."""
        return [load for load in self.loads if load.from_s <= time_s < load.until_s]
