"""Two tracks on a floor: they pull along their line and resist sideways, each up to what friction allows.

A track has a length, so one that turns slides sideways at both ends. The floor's pressure on it acts in three points,
a third each: in the middle and at 3/8 of its length before and behind it. So it resists turning with the moment of a
line of even pressure, friction * weight * length / 4 (Wong, Theory of Ground Vehicles, chapter 6, skid-steering).
Friction along a track and across it have limits of their own.

Each limit belongs to one speed of the body: of the left and right track along their lines, of the three points across,
and of soil that is pushed. Impulses up to their limits bring each speed to its goal, one after another until none
changes (sequential impulses, as in `impulses_2d.py`).
"""

from __future__ import annotations

import math

from snr_sim.plants.ground.dozer import Dozer
from snr_sim.plants.ground.traction import GRAVITY_MPS2
from snr_sim.plants.ground.wall_contacts import Speeds

MAX_ITERATIONS = 200
SAME_MPS = 1e-12  # a change that ends the iteration


class Tracks:
    """The tracks of a vehicle.

    Args:
        dozer: its numbers.
        step_s: of integration.
    """

    def __init__(self, dozer: Dozer, step_s: float) -> None:
        self._step_s = step_s
        mass_kg, inertia_kgm2 = dozer.mass_kg, dozer.inertia_kgm2
        weight_n, half_m, arm_m = mass_kg * GRAVITY_MPS2, 0.5 * dozer.track_m, 0.375 * dozer.track_length_m
        pull_ns = step_s * min(dozer.max_pull_n, 0.5 * dozer.grip_along * weight_n)
        side_ns = step_s * dozer.grip_across * weight_n / 3.0
        self._per_kg, self._per_kgm2 = 1.0 / mass_kg, 1.0 / inertia_kgm2
        # Of each row: the share of forward, sideways and turning speed, and its limit.
        self._rows = [
            (1.0, 0.0, -half_m, pull_ns), (1.0, 0.0, half_m, pull_ns),
            (0.0, 1.0, arm_m, side_ns), (0.0, 1.0, 0.0, side_ns), (0.0, 1.0, -arm_m, side_ns),
        ]  # fmt: skip

    def drive(
        self,
        heading_rad: float,
        speeds: Speeds,
        left_mps: float,
        right_mps: float,
        soil_n: float = 0.0,
        soil_m: float = 0.0,
    ) -> Speeds:
        """Return the speeds of the body after a step.

        Args:
            heading_rad: of it in the middle of the step.
            speeds: before.
            left_mps, right_mps: mean speeds of the tracks in the step.
            soil_n: with which soil resists to being pushed forward.
            soil_m: how far to the left of the middle that is.
        """
        cos, sin = math.cos(heading_rad), math.sin(heading_rad)
        vx, vy, turn = speeds
        ahead, side = cos * vx + sin * vy, cos * vy - sin * vx
        rows, goals = self._rows, [left_mps, right_mps, 0.0, 0.0, 0.0]
        if soil_n > 0.0:
            rows, goals = [*rows, (1.0, 0.0, -soil_m, soil_n * self._step_s)], [*goals, 0.0]
        impulses = [0.0] * len(rows)
        for _ in range(MAX_ITERATIONS):
            largest = 0.0
            for i, (a, b, c, limit) in enumerate(rows):
                per_ns = (a + b) * self._per_kg + c * c * self._per_kgm2
                old = impulses[i]
                new = old + (goals[i] - (a * ahead + b * side + c * turn)) / per_ns
                new = limit if new > limit else -limit if new < -limit else new
                more = new - old
                if more:
                    impulses[i] = new
                    ahead += a * more * self._per_kg
                    side += b * more * self._per_kg
                    turn += c * more * self._per_kgm2
                    largest = max(largest, abs(more))
            if largest * self._per_kg < SAME_MPS:
                break
        return cos * ahead - sin * side, sin * ahead + cos * side, turn
