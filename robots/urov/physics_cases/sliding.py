"""Heavy on the floor: what friction holds in a current, how it slides where that is too strong, and how it stops."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cache

from snr_sim.plants.urov.dive import Current, Load
from snr_sim.plants.urov.urov import Urov
from snr_sim.plants.urov.vehicle import Vehicle

from .case import Case
from .closed_forms import sliding, terminal_speed
from .swimming import BASIN, SETS, along, go, mass_along, swim, vehicle

GROUP = "Friction on the floor"
FRICTION = 0.5  # coefficient of the frame on tiles
LEAD = Load(3.0, 3.0 * 0.000088)
PRESSES_N = BASIN.gravity_mps2 * (LEAD.mass_kg - BASIN.density_kgm3 * LEAD.volume_m3) - 1.5
HOLDS_N = FRICTION * PRESSES_N
PUSH_N = 40.0
HARD = ((60.0, 60.0), (129.0, 130.0))  # N ahead and down, which made vehicles hop at longer steps
CREEP = "contacts that hold creep a little"


def grounded(one: Vehicle, step_s: float, speed_mps: float = 0.0) -> Urov:
    """Returns a plant with lead on the floor, in a current ahead."""
    bottom = -BASIN.depth_m + 0.5 * one.size_m[2]
    flow = (Current(0.0, (speed_mps, 0.0, 0.0)),)
    return swim(one, step_s, BASIN, position_m=(-5.0, 0.0, bottom), loads=(LEAD,), currents=flow)


@cache
def pushed(name: str, step_s: float, ahead_n: float, down_n: float) -> tuple[float, float]:
    """Returns speed and largest pressure in the sixth second of being pushed over the floor."""
    one = vehicle(name)
    bottom = -BASIN.depth_m + 0.5 * one.size_m[2]
    plant = go(swim(one, step_s, BASIN, position_m=(-9.0, 0.0, bottom)), 5.0, (ahead_n, 0.0, -down_n, 0.0, 0.0, 0.0))
    most = 0.0
    for _ in range(round(1.0 / step_s)):
        most = max(most, (go(plant, step_s).contact_n or (0.0, 0.0, 0.0))[2])
    return plant.velocity_mps[0], most


def friction() -> Iterator[Case]:
    """Holding, sliding on and sliding out."""
    for name in SETS:
        one = vehicle(name).trimmed(BASIN.density_kgm3, BASIN.gravity_mps2)
        a, b = one.linear_damping[0], one.quadratic_damping[0]
        threshold = terminal_speed(a, b, HOLDS_N)

        def moved(step_s: float, share: float, one: Vehicle = one, threshold: float = threshold) -> float:
            plant = go(grounded(one, step_s, share * threshold), 6.0)
            begin = plant.position_m[0]
            return (go(plant, 4.0).position_m[0] - begin) / 4.0

        yield Case(
            GROUP, f"{name}: presses on the floor with", PRESSES_N, "N",
            lambda h, one=one: (go(grounded(one, h), 3.0).contact_n or (0.0, 0.0, 0.0))[2], 1e-3,
            "what 3 s leave of settling",
        )  # fmt: skip
        yield Case(
            GROUP, f"{name}: creeps in 98 % of the current that moves it, {threshold:.3f} m/s", 0.0, "m/s",
            lambda h, moved=moved: moved(h, 0.98), 2e-4, CREEP,
        )  # fmt: skip
        yield Case(
            GROUP, f"{name}: friction against 98 % of that current", -drag(a, b, 0.98 * threshold), "N",
            lambda h, one=one, threshold=threshold: (
                go(grounded(one, h, 0.98 * threshold), 6.0).contact_n or (0.0, 0.0, 0.0)
            )[0], 1e-3, CREEP,
        )  # fmt: skip
        yield Case(
            GROUP, f"{name}: slides in 120 % of that current", 0.2 * threshold, "m/s",
            lambda h, moved=moved: moved(h, 1.2), 2e-3, "what 6 s leave of the way to it",
        )  # fmt: skip
        yield Case(
            GROUP, f"{name}: speed along the floor under {PUSH_N:g} N", terminal_speed(a, b, PUSH_N - HOLDS_N), "m/s",
            lambda h, one=one: go(go(grounded(one, h), 1.0), 5.0, along(0, PUSH_N)).velocity_mps[0], 2e-3,
            "pressure that is still settling",
        )  # fmt: skip
        for ahead_n, down_n in HARD:
            presses_n = down_n - 1.5
            how = f"under {ahead_n:g} N ahead and {down_n:g} N down"
            yield Case(
                GROUP, f"{name}: speed along the floor {how}", terminal_speed(a, b, ahead_n - FRICTION * presses_n),
                "m/s", lambda h, name=name, ahead_n=ahead_n, down_n=down_n: pushed(name, h, ahead_n, down_n)[0], 2e-3,
                "the push down leans ahead with the vehicle, which the friction tilts a little",
            )  # fmt: skip
            yield Case(
                GROUP, f"{name}: presses at most {how}", presses_n, "N",
                lambda h, name=name, ahead_n=ahead_n, down_n=down_n: pushed(name, h, ahead_n, down_n)[1], 1e-3,
                "the push leans with the vehicle",
            )  # fmt: skip
        mass = mass_along(one, 0) + LEAD.mass_kg

        def slowed(step_s: float, one: Vehicle = one, mass: float = mass, a: float = a, b: float = b) -> float:
            """Pushes it along and lets go; returns the speed lost in 0.2 s, as a share of what it should be."""
            plant = go(go(grounded(one, step_s), 1.0), 2.0, along(0, PUSH_N))
            begin = plant.velocity_mps[0]
            end = go(plant, 0.2, along(0, 0.0)).velocity_mps[0]
            return (begin - end) / (begin - sliding(mass, a, b, HOLDS_N, begin, 0.2))

        yield Case(
            GROUP, f"{name}: speed lost in 0.2 s of sliding out, by friction and drag", 1.0, "", slowed, 5e-3,
            "the push let go, the pressure swings for a tenth of a second",
        )  # fmt: skip


def drag(a: float, b: float, speed_mps: float) -> float:
    """Returns the drag at a speed."""
    return a * speed_mps + b * speed_mps * math.fabs(speed_mps)
