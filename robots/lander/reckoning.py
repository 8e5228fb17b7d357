"""Where the vertical lander is now, from a radar that tells where it was.

A reading is old when it arrives, and nothing measures the mass. But both follow from what the engine was told: the mass
from all commands so far, the way since the reading from the last one.
"""

from __future__ import annotations

from snr_sim.plants.descent import Motion, after
from snr_sim.prelude.signals import RadarReading

from .parameters import LanderParameters


class Reckoning:
    """Keeps track of height, velocity and mass.

    Args:
        parameters: of the lander.
    """

    def __init__(self, parameters: LanderParameters) -> None:
        self.engine = parameters.engine
        self.mass_kg = parameters.mass_kg
        self.throttle = 0.0
        self.told_s = 0.0

    def now(self, radar: RadarReading, now_s: float) -> Motion:
        """Returns the present motion from a reading of a moment ago."""
        flow = self.throttle * self.engine.thrust_n / self.engine.exhaust_mps
        self.mass_kg -= flow * (now_s - self.told_s)
        self.told_s = now_s
        age_s = now_s - radar.stamp_s
        then = Motion(radar.altitude_m, radar.velocity_mps, self.mass_kg + flow * age_s)
        thrust = self.throttle * self.engine.thrust_n
        here = after(then, thrust, self.engine.exhaust_mps, self.engine.gravity_mps2, age_s)
        return here._replace(mass_kg=self.mass_kg)

    def told(self, throttle: float) -> float:
        """Notes what the engine is told from now on, as it will do it; returns it."""
        self.throttle = min(1.0, max(0.0, throttle))
        return self.throttle

    def throttle_for(self, acceleration_mps2: float) -> float:
        """Returns the throttle that gives an upward acceleration against gravity; not limited."""
        return self.mass_kg * (acceleration_mps2 + self.engine.gravity_mps2) / self.engine.thrust_n
