"""The numbers a flying lunar module is made of. Which numbers, a robot says; what they do, `lander_2d.py` says."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from snr_sim.plants.lander.gear import APOLLO_GEAR, GearLimits
from snr_sim.plants.urov.plausible import check_fields
from snr_sim.prelude.errors import ParameterError


@dataclass(frozen=True)
class Throttle:
    """Which shares of full thrust an engine can run at: off, a range, or full.

    Args:
        lowest: end of the range; below it the flame goes out.
        highest: other end; between it and full the nozzle wears away, so the engine leaves that out.

    Raises:
        ParameterError: they are no such shares.
    """

    lowest: float
    highest: float

    def __post_init__(self) -> None:
        check_fields(self, "The throttle's ", {"lowest": "share", "highest": "share"}, {})
        if self.lowest > self.highest:
            raise ParameterError(
                f"The throttle runs from {self.lowest:g} to {self.highest:g}.", fix="give the lower end first."
            )

    def snap(self, command: float) -> float:
        """Returns the nearest share that the engine can run at.

        >>> [Throttle(0.1, 0.6).snap(u) for u in (0.04, 0.06, 0.3, 0.7, 0.9)]
        [0.0, 0.1, 0.3, 0.6, 1.0]
        """
        if self.lowest <= command <= self.highest:
            return command
        if command < self.lowest:
            return self.lowest if command >= 0.5 * self.lowest else 0.0
        return 1.0 if command >= 0.5 * (self.highest + 1.0) else self.highest


@dataclass(frozen=True)
class Leg:
    """One sprung, damped foot, and its grip on the ground.

    Args:
        spring_npm: force per metre of giving way, along the ground's normal; sideways the foot bends as stiffly.
        damper_nspm: force per speed, both ways.
        friction: largest share of the normal force that the foot holds sideways before it slides.

    Raises:
        ParameterError: a number cannot be.
    """

    spring_npm: float
    damper_nspm: float
    friction: float

    def __post_init__(self) -> None:
        numbers = {"spring_npm": "leg_npm", "damper_nspm": "leg_nspm", "friction": "grip"}
        check_fields(self, "The leg's ", numbers, {})


@dataclass(frozen=True)
class LunarModule:
    """A module that flies in the x-z plane.

    Args:
        thrust_n: of the main engine at full throttle.
        exhaust_mps: its effective exhaust speed.
        throttle: shares of it that the engine can run at.
        throttle_lag_s: time constant of thrust following the command.
        gimbal_rad: how far the nozzle turns to either side.
        gimbal_rate_radps: how fast.
        jets_nm: largest couple of the attitude jets. Their propellant has tanks of its own and is not counted.
        gyration_m: radius of gyration, which stays while propellant leaves: inertia is mass times its square.
        leg: each of the two.
        gear: judges the first contact.
        gravity_mps2: pulls down.

    Raises:
        ParameterError: a number cannot be.
    """

    thrust_n: float
    exhaust_mps: float
    throttle: Throttle
    throttle_lag_s: float
    gimbal_rad: float
    gimbal_rate_radps: float
    jets_nm: float
    gyration_m: float
    leg: Leg
    gravity_mps2: float
    gear: GearLimits = field(default=APOLLO_GEAR)

    def __post_init__(self) -> None:
        numbers = {
            "thrust_n": "engine_n",
            "exhaust_mps": "exhaust_mps",
            "throttle_lag_s": "lag_s",
            "gimbal_rad": "gimbal_rad",
            "gimbal_rate_radps": "gimbal_radps",
            "jets_nm": "couple_nm",
            "gyration_m": "gyration_m",
            "gravity_mps2": "pull_mps2",
        }
        check_fields(self, "The module's ", numbers, {})


MASSES = {"mass_kg": "module_kg", "fuel_kg": "fuel_kg"}  # of a start, with their limits


def check_tank(mass_kg: float, fuel_kg: float) -> None:
    """Checks that a module at its start is more than its propellant.

    Raises:
        ParameterError: it is not.
    """
    if not fuel_kg < mass_kg:
        raise ParameterError(
            f"The start's fuel_kg is {fuel_kg:g}, its mass_kg {mass_kg:g}.", fix="mass_kg is all of it, the fuel too."
        )


@dataclass(frozen=True)
class PlaneStart:
    """Where a run in the plane begins.

    Args:
        position_m: x and z of the centre of mass.
        velocity_mps: vx and vz.
        attitude_rad: positive counter-clockwise, as in InertialReading.
        rate_radps: of attitude.
        mass_kg: all of it.
        fuel_kg: of the mass, what may be burned.

    Raises:
        ParameterError: a number cannot be.
    """

    position_m: tuple[float, float]
    velocity_mps: tuple[float, float]
    mass_kg: float
    fuel_kg: float
    attitude_rad: float = 0.0
    rate_radps: float = 0.0

    def __post_init__(self) -> None:
        numbers = {**MASSES, "attitude_rad": "angle_rad", "rate_radps": "tumble_radps"}
        vectors = {"position_m": "way_m", "velocity_mps": "flight_mps"}
        check_fields(self, "The start's ", numbers, vectors, axes=("x", "z"))
        check_tank(self.mass_kg, self.fuel_kg)


TIPPED_RAD = math.radians(60.0)  # beyond it there is no way back to the feet
