"""Thrust along one axis from rest, terminal speeds, and coming to rest."""

from __future__ import annotations

from collections.abc import Iterator

from snr_sim.plants.urov.urov import Urov
from snr_sim.plants.urov.vehicle import Vector, Vehicle
from snr_sim.prelude.wrench import AXES

from .case import Case
from .closed_forms import coasting, step_response, terminal_speed
from .swimming import CORNER, DEEP, SETS, TILTED, along, go, mass_along, swim, weightless

FLAT_OUT_N = 129.3  # two thrusters ahead and two astern at 16 V, along x
LEFT = "what is left of the way to it in 12 s"


def steps() -> Iterator[Case]:
    """Thrust along one axis from rest, and coming to rest."""
    for name in SETS:
        one = weightless(name)
        for axis, push in ((0, 40.0), (1, 40.0), (2, 40.0), (3, 2.0), (4, 2.0), (5, 2.0)):
            mass, a, b = mass_along(one, axis), one.linear_damping[axis], one.quadratic_damping[axis]
            unit, rate = ("N", "m/s") if axis < 3 else ("N m", "rad/s")
            speed, way = step_response(mass, a, b, push, 1.0)

            def after(
                step_s: float, time_s: float, one: Vehicle = one, axis: int = axis, push: float = push, **how: Vector
            ) -> Urov:
                return go(swim(one, step_s, **how), time_s, along(axis, push))

            what = f"{name}, {AXES[axis]} {push:g} {unit}"
            yield Case(
                "Thrust along one axis", f"{what}: after 1 s", speed, rate,
                lambda h, after=after, axis=axis: after(h, 1.0).through_water[axis], 1e-4,
            )  # fmt: skip
            if axis < 3:
                yield Case(
                    "Thrust along one axis", f"{what}: way in 1 s", way, "m",
                    lambda h, after=after, axis=axis: after(h, 1.0).position_m[axis] - DEEP[axis], 1e-4,
                )  # fmt: skip
            if axis in (0, 1, 2, 5):
                yield Case(
                    "Thrust along one axis", f"{what}: the same tilted by 45 deg, in the far corner", speed, rate,
                    lambda h, after=after, axis=axis: after(
                        h, 1.0, attitude_rad=TILTED, position_m=CORNER
                    ).through_water[axis], 1e-4,
                )  # fmt: skip
            yield Case(
                "Thrust along one axis", f"{what}: terminal", terminal_speed(a, b, push), rate,
                lambda h, after=after, axis=axis: after(h, 12.0).through_water[axis], 1e-5, LEFT,
            )  # fmt: skip
            left = coasting(mass, a, b, 1.0, 5.0)

            def coast(step_s: float, one: Vehicle = one, axis: int = axis) -> float:
                begin = along(axis, 1.0)
                return go(swim(one, step_s, velocity_mps=begin[:3], rate_radps=begin[3:]), 5.0).through_water[axis]

            yield Case(
                "Coming to rest", f"{name}, {AXES[axis]}: what 5 s leave of 1 {rate}", left, rate, coast, 1e-3,
                "midpoint rule at 10 ms, while drag takes a tenth of the speed in a step",
            )  # fmt: skip
        full = terminal_speed(one.linear_damping[0], one.quadratic_damping[0], FLAT_OUT_N)
        yield Case(
            "Thrust along one axis", f"{name}: flat out, {FLAT_OUT_N} N", full, "m/s",
            lambda h, one=one: go(swim(one, h), 12.0, along(0, FLAT_OUT_N)).through_water[0], 1e-5, LEFT,
        )  # fmt: skip
