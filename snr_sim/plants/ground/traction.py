"""Two driven wheels on a floor: they roll as long as friction can make them, and slide when it cannot.

A wheel does not slide sideways, and forward the floor passes under it as fast as it turns. Three speeds of a body (two
of its centre of mass, and its turning) follow from two wheels on one axle, and so do the impulses of the wheels that
bring them about in a step. Where an impulse is larger than friction allows, the wheel gets as much as that, in its
direction (Coulomb's friction; the load of a wheel is that at rest).
"""

from __future__ import annotations

import math

from snr_sim.plants.ground.explorer import Explorer

Speeds = tuple[float, float, float]  # of the centre of mass along x and y, world frame [m/s], and of turning [rad/s]

GRAVITY_MPS2 = 9.80665


class Traction:
    """The wheels of a vehicle."""

    def __init__(self, explorer: Explorer, step_s: float) -> None:
        self._arm_m = -explorer.axle_m  # from the axle to the centre of mass
        self._half_track_m = 0.5 * explorer.track_m
        self._mass_kg, self._inertia_kgm2 = explorer.mass_kg, explorer.inertia_kgm2
        load_n = 0.5 * explorer.axle_share * explorer.mass_kg * GRAVITY_MPS2
        self._max_impulse_ns = explorer.grip * load_n * step_s
        self._half_step_s = 0.5 * step_s

    def rolling(self, left_mps: float, right_mps: float) -> tuple[float, float]:
        """Return the speed of the middle of the axle [m/s] and of turning [rad/s], of wheels that do not slide."""
        return 0.5 * (left_mps + right_mps), 0.5 * (right_mps - left_mps) / self._half_track_m

    def drive(self, heading_rad: float, speeds: Speeds, left_mps: float, right_mps: float) -> Speeds:
        """Return the speeds of a body after a step, from heading and speeds before it.

        `left_mps` and `right_mps` are the mean speeds of the wheels' treads in the step.
        """
        forward, turn = self.rolling(left_mps, right_mps)
        middle = heading_rad + self._half_step_s * turn  # the chord of an arc has the heading of its middle
        cos, sin = math.cos(middle), math.sin(middle)
        vx, vy, old_turn = speeds
        push = self._mass_kg * (forward - (cos * vx + sin * vy))
        side = self._mass_kg * (turn * self._arm_m - (cos * vy - sin * vx))
        twist = self._inertia_kgm2 * (turn - old_turn)
        differ = 0.5 * (twist + self._arm_m * side) / self._half_track_m
        left, right, across = 0.5 * push - differ, 0.5 * push + differ, 0.5 * side
        left_share, right_share = self._granted(left, across), self._granted(right, across)
        if left_share == right_share == 1.0:
            return cos * forward - sin * turn * self._arm_m, sin * forward + cos * turn * self._arm_m, turn
        left, right = left_share * left, right_share * right
        push, side = left + right, (left_share + right_share) * across
        twist = self._half_track_m * (right - left) - self._arm_m * side
        return (
            vx + (cos * push - sin * side) / self._mass_kg,
            vy + (sin * push + cos * side) / self._mass_kg,
            old_turn + twist / self._inertia_kgm2,
        )

    def _granted(self, along_ns: float, across_ns: float) -> float:
        needed = math.sqrt(along_ns * along_ns + across_ns * across_ns)
        return 1.0 if needed <= self._max_impulse_ns else self._max_impulse_ns / needed
