"""Floor, wall and post: what presses, what friction holds, and meeting them at speed."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial

from snr_sim.plants.urov.dive import Current, Payload
from snr_sim.plants.urov.pool import Gate
from snr_sim.plants.urov.urov import Urov
from snr_sim.plants.urov.vehicle import Vector, Vehicle

from .case import ROUNDS, Case
from .closed_forms import sliding, terminal_speed
from .vehicles import BASIN, DEEP, along, along_axis, go, make_urov, undamped, vehicle, weightless

FRICTION = 0.5  # coefficient of the frame on tiles
LEAD, DROPPED = (Payload(mass_kg, mass_kg * 0.000088) for mass_kg in (3.0, 6.0))
PRESSES_N = BASIN.gravity_mps2 * (LEAD.mass_kg - BASIN.density_kgm3 * LEAD.volume_m3) - 1.5
HOLDS_N = FRICTION * PRESSES_N
PUSH_N = 40.0
HARD = ((60.0, 60.0), (129.0, 130.0))  # N ahead and down, which made vehicles hop at longer steps
CREEP = "contacts that hold creep a little"

POSTS = replace(BASIN, gates=(Gate("post", (1.0, -0.75, -2.0)),))
FINE_S = 0.001


def pressing(plant: Urov) -> Vector:
    """Return what contacts push."""
    return plant.contact_n or (0.0, 0.0, 0.0)


def bottom_m(one: Vehicle) -> float:
    """Return the height of its origin when it stands on the floor."""
    return -BASIN.depth_m + 0.5 * one.size_m[2]


def contact(name: str) -> Iterator[Case]:
    """Floor and wall, which meet the mass of vehicle and water."""
    case = partial(Case, "Contact")
    one, free = vehicle(name), undamped(weightless(name))
    side = 0.5 * BASIN.length_m - 0.5 * one.size_m[0]

    def pressed(step_s: float) -> float:
        plant = go(make_urov(one, step_s, BASIN, position_m=(0.0, 0.0, bottom_m(one))), 3.0, along(2, -40.0))
        return (plant.contact_n or DEEP)[2]

    def bump(step_s: float) -> float:
        """Meet a wall with the bow; return the wall's impulse divided by the change of momentum."""
        plant = make_urov(free, step_s, BASIN, position_m=(side - 0.1, 0.0, -2.0), velocity_mps=(0.5, 0.0, 0.0))
        impulse = 0.0
        for _ in range(round(0.6 / step_s)):
            plant.step(step_s)
            impulse += step_s * pressing(plant)[0]
        return impulse / (along_axis(free, 0)[0] * (plant.velocity_mps[0] - 0.5))

    what = f"{name}: force on the floor, 40 N down less 1.5 N"
    yield case(what, 38.5, "N", pressed, 1e-3, "what 3 s leave of settling")
    what = f"{name}: impulse of a wall, by the change of momentum of vehicle and water"
    yield case(what, 1.0, "", bump, 1e-9, "rounding")


# -- meeting at speed: the same whatever the step, and never with more energy than before ------------------------------


def landing(one: Vehicle, step_s: float) -> Urov:
    """Come down on the floor at speed ahead, nose down, pushed on."""
    push = (25.0, 0.0, -40.0, 0.0, 0.0, 0.0) if one.name == "wu2018" else (40.0, 0.0, -60.0, 0.0, 0.0, 0.0)
    how = {"position_m": (-2.0, 0.0, -3.5), "attitude_rad": (0.0, 0.1, 0.0), "velocity_mps": (0.5, 0.0, -0.3)}
    return go(make_urov(one, step_s, BASIN, **how), 3.0, push)


def wall(one: Vehicle, step_s: float) -> Urov:
    """Run into a wall askew and be pushed along it."""
    how = {"position_m": (9.3, 0.0, -2.0), "attitude_rad": (0.0, 0.0, 0.4), "velocity_mps": (0.8, 0.3, 0.0)}
    return go(make_urov(one, step_s, BASIN, **how), 2.0, along(0, 20.0))


def post(one: Vehicle, step_s: float) -> Urov:
    """Run into a gate's post with one shoulder."""
    return go(make_urov(one, step_s, POSTS, position_m=(0.4, 0.1, -2.0), velocity_mps=(0.8, 0.0, 0.0)), 1.5)


def drop(one: Vehicle, step_s: float) -> Urov:
    """Sink to the floor with lead on it, tilted."""
    how = {"position_m": (0.0, 0.0, -3.3), "attitude_rad": (0.3, 0.2, 0.0), "velocity_mps": (0.4, 0.0, 0.0)}
    return go(make_urov(one, step_s, BASIN, loads=(DROPPED,), **how), 3.0)


MEETINGS: dict[Callable[[Vehicle, float], Urov], str] = {
    landing: "lands at speed, pushed on: where it is after 3 s",
    wall: "runs into a wall askew at 0.85 m/s: where it is after 2 s",
    post: "runs into a post at 0.8 m/s: where it is after 1.5 s",
    drop: "dropped with 6 kg of lead, tilted: where it is after 3 s",
}


@cache
def finely(name: str, meet: Callable[[Vehicle, float], Urov]) -> Vector:
    """Return where steps of 1 ms lead to."""
    return meet(vehicle(name), FINE_S).position_m


def gained_j(one: Vehicle, step_s: float) -> float:
    """Return the most energy that a vehicle without drag has more, after it has touched the floor, than before.

    While it touches, energy is also in the contact's deformation.
    """
    how = {"attitude_rad": (0.3, 0.4, 0.2), "velocity_mps": (0.8, 0.3, -0.5), "rate_radps": (0.5, -0.5, 0.7)}
    plant = make_urov(one, step_s, BASIN, position_m=(-5.0, 0.0, -3.4), loads=(DROPPED,), **how)
    heavy_n = BASIN.gravity_mps2 * (DROPPED.mass_kg - BASIN.density_kgm3 * DROPPED.volume_m3)
    min_energy, max_gain, touched = math.inf, 0.0, False
    for _ in range(round(3.0 / step_s)):
        plant.step(step_s)
        energy = plant.kinetic_energy_j + heavy_n * plant.position_m[2]
        if plant.contact_n is not None:
            touched = True
            continue
        max_gain = max(max_gain, energy - min_energy) if touched else max_gain
        min_energy, touched = min(min_energy, energy), False
    return max_gain


def meeting(name: str) -> Iterator[Case]:
    """Landing, bumping into a wall and a post, and being dropped."""
    case = partial(Case, "Meeting floor, wall and post, beside steps of 1 ms")

    def apart(step_s: float, meet: Callable[[Vehicle, float], Urov]) -> float:
        return math.dist(meet(vehicle(name), step_s).position_m, finely(name, meet))

    for meet, what in MEETINGS.items():
        reason = "free steps before it, and how far into a part of a millisecond it touches"
        yield case(f"{name}: {what}", 0.0, "m", partial(apart, meet=meet), 1e-3, reason)
    what = f"{name}: dropped tumbling, undamped: energy gained from one flight to the next"
    yield case(what, 0.0, "J", partial(gained_j, undamped(weightless(name))), 1e-4, ROUNDS)


# -- heavy on the floor: what friction holds in a current, how it slides where that is too strong, and how it stops ----


def grounded(one: Vehicle, step_s: float, speed_mps: float = 0.0) -> Urov:
    """Return a plant with lead on the floor, in a current ahead."""
    flow = (Current(0.0, (speed_mps, 0.0, 0.0)),)
    return make_urov(one, step_s, BASIN, position_m=(-5.0, 0.0, bottom_m(one)), loads=(LEAD,), currents=flow)


@cache
def pushed(name: str, step_s: float, ahead_n: float, down_n: float) -> tuple[float, float]:
    """Return speed and largest pressure in the sixth second of being pushed over the floor."""
    one = vehicle(name)
    begin = make_urov(one, step_s, BASIN, position_m=(-9.0, 0.0, bottom_m(one)))
    plant = go(begin, 5.0, (ahead_n, 0.0, -down_n, 0.0, 0.0, 0.0))
    max_n = max(pressing(go(plant, step_s))[2] for _ in range(round(1.0 / step_s)))
    return plant.velocity_mps[0], max(0.0, max_n)


def friction(name: str) -> Iterator[Case]:
    """Holding, sliding on and sliding out."""
    case = partial(Case, "Friction on the floor")
    one = vehicle(name)
    mass, a, b = along_axis(one.trimmed(BASIN.density_kgm3, BASIN.gravity_mps2), 0)
    threshold = terminal_speed(a, b, HOLDS_N)
    almost = 0.98 * threshold

    def moved(step_s: float, share: float) -> float:
        plant = go(grounded(one, step_s, share * threshold), 6.0)
        begin = plant.position_m[0]
        return (go(plant, 4.0).position_m[0] - begin) / 4.0

    def slowed(step_s: float) -> float:
        """Push it along and release it; return the speed lost in 0.2 s, as a fraction of what it should be."""
        plant = go(go(grounded(one, step_s), 1.0), 2.0, along(0, PUSH_N))
        begin = plant.velocity_mps[0]
        end = go(plant, 0.2, along(0, 0.0)).velocity_mps[0]
        return (begin - end) / (begin - sliding(mass + LEAD.mass_kg, a, b, HOLDS_N, begin, 0.2))

    yield case(
        f"{name}: presses on the floor with", PRESSES_N, "N", lambda h: pressing(go(grounded(one, h), 3.0))[2], 1e-3,
        "what 3 s leave of settling",
    )  # fmt: skip
    what = f"{name}: creeps in 98 % of the current that moves it, {threshold:.3f} m/s"
    yield case(what, 0.0, "m/s", lambda h: moved(h, 0.98), 2e-4, CREEP)
    yield case(
        f"{name}: friction against 98 % of that current", -(a * almost + b * almost * math.fabs(almost)), "N",
        lambda h: pressing(go(grounded(one, h, almost), 6.0))[0], 1e-3, CREEP,
    )  # fmt: skip
    what = f"{name}: slides in 120 % of that current"
    yield case(what, 0.2 * threshold, "m/s", lambda h: moved(h, 1.2), 2e-3, "what 6 s leave of the way to it")
    yield case(
        f"{name}: speed along the floor under {PUSH_N:g} N", terminal_speed(a, b, PUSH_N - HOLDS_N), "m/s",
        lambda h: go(go(grounded(one, h), 1.0), 5.0, along(0, PUSH_N)).velocity_mps[0], 2e-3,
        "pressure that is still settling",
    )  # fmt: skip
    for ahead_n, down_n in HARD:
        presses_n, run = down_n - 1.5, partial(pushed, name, ahead_n=ahead_n, down_n=down_n)
        how = f"under {ahead_n:g} N ahead and {down_n:g} N down"
        yield case(
            f"{name}: speed along the floor {how}", terminal_speed(a, b, ahead_n - FRICTION * presses_n), "m/s",
            lambda h, run=run: run(h)[0], 2e-3,
            "the push down leans ahead with the vehicle, which the friction tilts a little",
        )  # fmt: skip
        yield case(
            f"{name}: presses at most {how}", presses_n, "N", lambda h, run=run: run(h)[1], 1e-3,
            "the push leans with the vehicle",
        )  # fmt: skip
    what = f"{name}: speed lost in 0.2 s of sliding out, by friction and drag"
    reason = "when the push ends, the pressure oscillates for 0.1 s"
    yield case(what, 1.0, "", slowed, 5e-3, reason)
