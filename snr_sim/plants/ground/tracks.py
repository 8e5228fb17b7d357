"""Two tracks on a floor: they pull along their line and resist sideways, each up to what friction allows.

A track has a length, so one that turns slides sideways at both ends. The floor's pressure on it acts in three points,
a third each: in the middle and at 3/8 of its length before and behind it. So it resists turning with the moment of a
line of even pressure, friction * weight * length / 4 (Wong, Theory of Ground Vehicles, chapter 6, skid-steering).
Friction along a track and across it have limits of their own.

Each limit belongs to one speed of the body: of the left and right track along their lines, of the three points across,
and of soil that is pushed. An impulse up to the limit brings that speed to its goal, or towards it. At a given rate of
turning, the speeds ahead and to the side are clamped medians, and the moment of all impulses follows from them. The
moment falls as the rate rises, so one rate agrees with its own moment: this one is searched for.
"""

from __future__ import annotations

import math
from itertools import combinations
from typing import NamedTuple

from snr_sim.plants.ground.dozer import Dozer
from snr_sim.plants.ground.traction import GRAVITY_MPS2
from snr_sim.plants.ground.wall_contacts import Speeds

SAME_RADPS = 1e-12  # rates of turning that are the same
MAX_TRIALS = 100  # of rates; no step of 1500 random vehicles needed more than 13


class Grip(NamedTuple):
    """One limit. Its impulse acts on a speed of the body, ahead or to the left, and at an arm on its turning."""

    goal_mps: float  # of the speed plus the arm times the rate of turning
    arm_m: float
    limit_mps: float  # the largest impulse, per mass of the body


class Tracks:
    """The tracks of a vehicle."""

    def __init__(self, dozer: Dozer, step_s: float) -> None:
        self._per_kg = step_s / dozer.mass_kg
        self._mass_per_inertia = dozer.mass_kg / dozer.inertia_kgm2
        self._half_m, arm_m = 0.5 * dozer.track_m, 0.375 * dozer.track_length_m
        self._pull_mps = min(dozer.max_pull_n * self._per_kg, 0.5 * dozer.grip_along * GRAVITY_MPS2 * step_s)
        across_mps = dozer.grip_across * GRAVITY_MPS2 * step_s / 3.0
        self._across = [Grip(0.0, arm, across_mps) for arm in (arm_m, 0.0, -arm_m)]

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
        along = [Grip(left_mps, -self._half_m, self._pull_mps), Grip(right_mps, self._half_m, self._pull_mps)]
        if soil_n > 0.0:
            along.append(Grip(0.0, -soil_m, soil_n * self._per_kg))
        ahead, side, turn = self._solve((cos * vx + sin * vy, cos * vy - sin * vx, turn), along)
        return cos * ahead - sin * side, sin * ahead + cos * side, turn

    def _solve(self, free: Speeds, along: list[Grip]) -> Speeds:
        """Return the speeds ahead, to the left and of turning, from those without any impulse."""
        low, high = -math.inf, math.inf
        # The moment jumps where two grips reach their goals together. Mostly it changes its sign there: both tracks
        # roll, or nothing turns.
        pairs = [(a, b) for b, a in combinations(along, 2) if a.arm_m != b.arm_m]
        for jump in (*((a.goal_mps - b.goal_mps) / (a.arm_m - b.arm_m) for a, b in pairs), 0.0):
            if low < jump < high:
                if self._at_rate(jump - SAME_RADPS, free, along)[2] < 0.0:
                    high = jump - SAME_RADPS
                elif self._at_rate(jump + SAME_RADPS, free, along)[2] > 0.0:
                    low = jump + SAME_RADPS
                else:
                    return (*self._at_rate(jump, free, along)[:2], jump)
        # Between jumps it is a chain of straight lines, on which Newton's method ends; bisection keeps it from cycling.
        turn = min(high, max(low, free[2]))
        for _ in range(MAX_TRIALS):
            ahead, side, excess, slope = self._at_rate(turn, free, along)
            low, high = (turn, high) if excess > 0.0 else (low, turn)
            new = turn - excess / slope
            if abs(new - turn) <= SAME_RADPS:
                break
            turn = new if low < new < high else 0.5 * (low + high)
        return ahead, side, turn

    def _at_rate(self, turn: float, free: Speeds, along: list[Grip]) -> tuple[float, float, float, float]:
        """Return the speeds ahead and to the left at a rate of turning, and how the moment of the impulses fits it.

        The last two are by how much the rate that the moment brings about exceeds the given one, and the slope of this.
        """
        speeds, moment, slope = [], 0.0, 0.0
        for speed, grips in ((free[0], along), (free[1], self._across)):
            kinks = [(goal - arm * turn, arm, limit) for goal, arm, limit in grips]
            kinks.sort()
            for _, _, limit in kinks:
                speed += limit
            for goal, arm, limit in kinks:  # all of them push forward, until one reaches its goal
                back = speed - goal
                if back <= 0.0:
                    moment += arm * limit
                elif back < 2.0 * limit:
                    moment += arm * (limit - back)
                    slope -= arm * arm
                    speed = goal
                else:
                    moment -= arm * limit
                    speed -= 2.0 * limit
            speeds.append(speed)
        excess = free[2] + self._mass_per_inertia * moment - turn
        return speeds[0], speeds[1], excess, self._mass_per_inertia * slope - 1.0
