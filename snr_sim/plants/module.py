"""The numbers a flying lunar module is made of. Which numbers, a robot says; what they do, `lander_2d.py` says."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from snr_sim.plants.gear import APOLLO_GEAR, GearLimits


@dataclass(frozen=True)
class Throttle:
    """Which shares of full thrust an engine can run at: off, a range, or full.

    Args:
        lowest: end of the range; below it the flame goes out.
        highest: other end; between it and full the nozzle wears away, so the engine leaves that out.
    """

    lowest: float
    highest: float

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
    """

    spring_npm: float
    damper_nspm: float
    friction: float


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
    """

    position_m: tuple[float, float]
    velocity_mps: tuple[float, float]
    mass_kg: float
    fuel_kg: float
    attitude_rad: float = 0.0
    rate_radps: float = 0.0


TIPPED_RAD = math.radians(60.0)  # beyond it there is no way back to the feet
