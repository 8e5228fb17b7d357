"""Estimate of the vertical lander's present motion from delayed radar readings.

A reading is delayed and noisy, and no sensor measures the mass. The engine's commands supply much of it: the mass
follows from all commands so far, the motion since the reading from the last one. The prediction from the last
estimate is more accurate than one noisy reading, so the two are blended.
"""

from __future__ import annotations

from snr_sim.plants import Motion, propagate
from snr_sim.signals import RadarReading

from .parameters import LanderParameters

MIN_GAIN = 0.15  # weight of a new reading in the estimate, after many readings; less is smoother and slower


class StatePredictor:
    """Keeps track of height, velocity and mass."""

    def __init__(self, parameters: LanderParameters) -> None:
        self.engine = parameters.engine
        self.throttle = 0.0
        self.estimate_s = 0.0
        self.readings = 0
        self.estimate = Motion(0.0, 0.0, parameters.mass_kg)

    def predict(self, radar: RadarReading, now_s: float) -> Motion:
        """Return the best estimate of the present motion from a reading of a moment ago and all before."""
        thrust, exhaust, gravity = self.engine
        push = self.throttle * thrust
        expected = propagate(self.estimate, push, exhaust, gravity, now_s - self.estimate_s)
        age_s = now_s - radar.stamp_s
        mass_then = expected.mass_kg + push / exhaust * age_s
        measured = propagate(Motion(radar.altitude_m, radar.velocity_mps, mass_then), push, exhaust, gravity, age_s)
        self.readings += 1
        gain = max(MIN_GAIN, 1.0 / self.readings)
        self.estimate = Motion(
            expected.height_m + gain * (measured.height_m - expected.height_m),
            expected.velocity_mps + gain * (measured.velocity_mps - expected.velocity_mps),
            expected.mass_kg,
        )
        self.estimate_s = now_s
        return self.estimate

    def set_throttle(self, throttle: float) -> float:
        """Store the throttle that the engine applies from now on, clamped to 0 to 1; return it."""
        self.throttle = min(1.0, max(0.0, throttle))
        return self.throttle

    def throttle_for(self, acceleration_mps2: float) -> float:
        """Return the throttle that gives an upward acceleration against gravity; not limited."""
        return self.estimate.mass_kg * (acceleration_mps2 + self.engine.gravity_mps2) / self.engine.thrust_n
