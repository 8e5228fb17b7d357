"""Parameters of a lunar module in flight. A robot gives their values; `lander_2d.py` uses them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Annotated

from snr_sim.plants.lander.gear import APOLLO_GEAR, GearLimits
from snr_sim.plants.parameter_limits import LIMITS, Record
from snr_sim.prelude.errors import ParameterError


@dataclass(frozen=True)
class Throttle(Record, who="The throttle's "):
    """Throttle range of an engine, as fractions of full thrust: off, a range, or full.

    Args:
        lowest: end of the range; below it the flame goes out.
        highest: other end; between it and full the nozzle erodes, so the engine skips that range.
    """

    lowest: Annotated[float, LIMITS["share"]]
    highest: Annotated[float, LIMITS["share"]]

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.lowest > self.highest:
            found = f"The throttle runs from {self.lowest:g} to {self.highest:g}."
            raise ParameterError(found, fix="give the lower end first.")

    def snap(self, command: float) -> float:
        """Return the nearest fraction that the engine can run at.

        >>> [Throttle(0.1, 0.6).snap(u) for u in (0.04, 0.06, 0.3, 0.7, 0.9)]
        [0.0, 0.1, 0.3, 0.6, 1.0]
        """
        if self.lowest <= command <= self.highest:
            return command
        if command < self.lowest:
            return self.lowest if command >= 0.5 * self.lowest else 0.0
        return 1.0 if command >= 0.5 * (self.highest + 1.0) else self.highest


@dataclass(frozen=True)
class Leg(Record, who="The leg's "):
    """One sprung, damped foot, and its grip on the ground.

    Args:
        spring_npm: force per metre of giving way, along the ground's normal; sideways the foot bends as stiffly.
        damper_nspm: force per speed, both ways.
        friction: largest fraction of the normal force that the foot holds sideways before it slides.
    """

    spring_npm: Annotated[float, LIMITS["leg_npm"]]
    damper_nspm: Annotated[float, LIMITS["leg_nspm"]]
    friction: Annotated[float, LIMITS["grip"]]


@dataclass(frozen=True)
class LunarModule(Record, who="The module's "):
    """A module that flies in the x-z plane.

    Args:
        thrust_n, exhaust_mps: of the main engine at full throttle, and its effective exhaust speed.
        throttle: fractions of full thrust that the engine can run at.
        throttle_lag_s: time constant of thrust following the command.
        gimbal_rad, gimbal_rate_radps: how far the nozzle turns to either side, and how fast.
        jets_nm: largest couple of the attitude jets. Their propellant has tanks of its own and is not counted.
        gyration_m: radius of gyration, which stays while propellant leaves: inertia is mass times its square.
        leg: each of the two.
        gear: judges the first contact.
    """

    thrust_n: Annotated[float, LIMITS["engine_n"]]
    exhaust_mps: Annotated[float, LIMITS["exhaust_mps"]]
    throttle: Throttle
    throttle_lag_s: Annotated[float, LIMITS["lag_s"]]
    gimbal_rad: Annotated[float, LIMITS["gimbal_rad"]]
    gimbal_rate_radps: Annotated[float, LIMITS["gimbal_radps"]]
    jets_nm: Annotated[float, LIMITS["couple_nm"]]
    gyration_m: Annotated[float, LIMITS["gyration_m"]]
    leg: Leg
    gravity_mps2: Annotated[float, LIMITS["pull_mps2"]]
    gear: GearLimits = field(default=APOLLO_GEAR)


def check_tank(mass_kg: float, fuel_kg: float) -> None:
    """Check that a module at its start is more than its propellant; if not, raise a ParameterError."""
    if not fuel_kg < mass_kg:
        found = f"The start's fuel_kg is {fuel_kg:g}, its mass_kg {mass_kg:g}."
        raise ParameterError(found, fix="mass_kg is all of it, the fuel too.")


@dataclass(frozen=True)
class PlaneStart(Record, who="The start's "):
    """Where a run in the plane begins.

    Args:
        position_m: x and z of the centre of mass.
        velocity_mps: vx and vz.
        attitude_rad: positive counter-clockwise, as in InertialReading; `rate_radps` is how it changes.
        mass_kg, fuel_kg: all of it, and what of that may be burned.
    """

    position_m: Annotated[tuple[float, float], LIMITS["way_m"]]
    velocity_mps: Annotated[tuple[float, float], LIMITS["flight_mps"]]
    mass_kg: Annotated[float, LIMITS["module_kg"]]
    fuel_kg: Annotated[float, LIMITS["fuel_kg"]]
    attitude_rad: Annotated[float, LIMITS["angle_rad"]] = 0.0
    rate_radps: Annotated[float, LIMITS["tumble_radps"]] = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        check_tank(self.mass_kg, self.fuel_kg)


TIPPED_RAD = math.radians(60.0)  # beyond it there is no way back to the feet
