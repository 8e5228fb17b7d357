"""Away from everything solid: thrust, weight and buoyancy, turning, currents, a tether, and all of it at once."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import cache, partial

import numpy as np

from snr_sim.plants.urov.dive import Current, Payload
from snr_sim.plants.urov.tether import Tether
from snr_sim.plants.urov.urov import Urov
from snr_sim.plants.urov.vehicle import Six, Vector, Vehicle
from snr_sim.prelude.angles import roll_pitch_yaw_rad
from snr_sim.prelude.wrench import AXES

from .case import LEFT, ROUNDS, Case
from .closed_forms import coasting, pendulum_period, steady_circle, step_response, terminal_speed
from .fossen_rk4 import Fossen, rotation
from .vehicles import (
    CORNER,
    DEEP,
    SEA,
    TILTED,
    along,
    along_axis,
    go,
    make_urov,
    neutral,
    trimmed,
    undamped,
    vehicle,
    weightless,
)

FLAT_OUT_N = 129.3  # two thrusters ahead and two astern at 16 V, along x
MIXED_FLOW = (0.3, -0.2, 0.1)


def steps(name: str) -> Iterator[Case]:
    """Thrust along one axis from rest, terminal speeds, and coming to rest."""
    case = partial(Case, "Thrust along one axis")
    one = weightless(name)

    def along_one(axis: int, push: float) -> Iterator[Case]:
        mass, a, b = along_axis(one, axis)
        unit, rate = ("N", "m/s") if axis < 3 else ("N m", "rad/s")
        speed, way = step_response(mass, a, b, push, 1.0)

        def after(step_s: float, time_s: float, **how: Vector) -> Urov:
            return go(make_urov(one, step_s, **how), time_s, along(axis, push))

        def tilted(step_s: float) -> float:
            return after(step_s, 1.0, attitude_rad=TILTED, position_m=CORNER).through_water[axis]

        def coast(step_s: float) -> float:
            begin = along(axis, 1.0)
            return go(make_urov(one, step_s, velocity_mps=begin[:3], rate_radps=begin[3:]), 5.0).through_water[axis]

        what = f"{name}, {AXES[axis]} {push:g} {unit}"
        yield case(f"{what}: after 1 s", speed, rate, lambda h: after(h, 1.0).through_water[axis], 1e-4)
        if axis < 3:
            yield case(f"{what}: way in 1 s", way, "m", lambda h: after(h, 1.0).position_m[axis] - DEEP[axis], 1e-4)
        if axis in (0, 1, 2, 5):
            yield case(f"{what}: the same tilted by 45 deg, in the far corner", speed, rate, tilted, 1e-4)
        terminal = terminal_speed(a, b, push)
        yield case(f"{what}: terminal", terminal, rate, lambda h: after(h, 12.0).through_water[axis], 1e-5, LEFT)
        yield Case(
            "Coming to rest", f"{name}, {AXES[axis]}: what 5 s leave of 1 {rate}", coasting(mass, a, b, 1.0, 5.0), rate,
            coast, 1e-3, "midpoint rule at 10 ms, while drag takes a tenth of the speed in a step",
        )  # fmt: skip

    for axis, push in enumerate((40.0, 40.0, 40.0, 2.0, 2.0, 2.0)):
        yield from along_one(axis, push)
    full = terminal_speed(one.linear_damping[0], one.quadratic_damping[0], FLAT_OUT_N)
    yield case(
        f"{name}: flat out, {FLAT_OUT_N} N", full, "m/s",
        lambda h: go(make_urov(one, h), 12.0, along(0, FLAT_OUT_N)).through_water[0], 1e-5, LEFT,
    )  # fmt: skip


def period(plant: Urov, axis: int, swings: int = 1) -> float:
    """Return the mean time of a full swing in roll (0) or pitch (1), from where its rate changes sign."""
    turns, before = [], plant.rate_radps[axis]
    while len(turns) <= 2 * swings:
        plant.step(plant.step_s)
        now = plant.rate_radps[axis]
        if before * now < 0.0:
            turns.append(plant.time_s - plant.step_s * now / (now - before))
        before = now
    return (turns[2 * swings] - turns[0]) / swings


def righting(name: str) -> Iterator[Case]:
    """Buoyancy above the centre of mass, and against the weight."""
    case = partial(Case, "Weight and buoyancy")
    one, as_is = neutral(name), trimmed(name)
    free = undamped(one)
    stiffness = SEA.density_kgm3 * SEA.gravity_mps2 * one.volume_m3 * one.centre_of_buoyancy_m[2]

    def small_swing(axis: int) -> Case:
        mass, damping, _ = along_axis(one, 3 + axis)
        share = damping / (2.0 * math.sqrt(stiffness * mass))
        tilt = along(axis, math.radians(0.05))[:3]
        return case(
            f"{name}: period of a small {AXES[3 + axis]}, damping {share:.3f}",
            2.0 * math.pi * math.sqrt(mass / stiffness / (1.0 - share * share)), "s",
            lambda h: period(make_urov(one, h, attitude_rad=tilt), axis), 5e-4,
            "quadratic drag at 0.05 deg, and where the rate changes sign between two steps",
        )  # fmt: skip

    def swing_energy(step_s: float) -> float:
        plant = make_urov(free, step_s, attitude_rad=(2.0, 0.4, 0.0))
        begin = stiffness * rotation(np.array(plant.attitude))[2, 2]
        go(plant, 20.0)
        now = stiffness * rotation(np.array(plant.attitude))[2, 2]
        return (plant.kinetic_energy_j + begin - now) / (stiffness - begin)

    def rise(step_s: float, *loads: Payload) -> float:
        return go(make_urov(as_is, step_s, loads=loads), 3.0).position_m[2] - DEEP[2]

    yield small_swing(0)
    yield small_swing(1)
    swing = math.radians(120.0)
    yield case(
        f"{name}: period of a roll from 120 deg, undamped", pendulum_period(along_axis(one, 3)[0], stiffness, swing),
        "s", lambda h: period(make_urov(free, h, attitude_rad=(swing, 0.0, 0.0)), 0), 2e-4,
    )  # fmt: skip
    what = f"{name}: energy gained by a swing from 115 deg in 20 s, undamped"
    yield case(what, 0.0, "of it", swing_energy, 1e-4, ROUNDS)
    mass, a, b = along_axis(as_is, 2)
    yield case(f"{name}: rise by its 1.5 N in 3 s", step_response(mass, a, b, 1.5, 3.0)[1], "m", rise, 1e-4)
    lead = Payload(2.0, 2.0 * 0.000088)
    net = 1.5 - 9.81 * (lead.mass_kg - SEA.density_kgm3 * lead.volume_m3)
    sunk = -step_response(mass + lead.mass_kg, a, b, -net, 3.0)[1]
    yield case(f"{name}: way in 3 s with 2 kg of lead", sunk, "m", lambda h: rise(h, lead), 1e-4)
    low = 0.085  # thrust line under the centre of mass, m

    def pitch_up(step_s: float) -> float:
        plant = go(make_urov(one, step_s), 40.0, (2.0, 0.0, 0.0, 0.0, -2.0 * low, 0.0))
        return math.degrees(-roll_pitch_yaw_rad(plant.attitude)[1])

    nose_up = math.degrees(math.asin(2.0 * low / stiffness))
    what = f"{name}, neutral: nose up by 2 N ahead, {low} m below"
    yield case(what, nose_up, "deg", pitch_up, 5e-3, "what 40 s leave of the swing to it")
    share = 1.0 - 1.5 / (SEA.density_kgm3 * SEA.gravity_mps2 * as_is.volume_m3)
    floats = (0.5 - share) * as_is.size_m[2] - as_is.centre_of_buoyancy_m[2]
    yield case(
        f"{name}: height of its origin when it floats", floats, "m",
        lambda h: go(make_urov(as_is, h, position_m=(0.0, 0.0, floats - 0.002)), 15.0).position_m[2], 5e-3,
        "what 15 s leave of bobbing",
    )  # fmt: skip


def lifted_out() -> Iterator[Case]:
    """Falling through air."""
    yield Case(
        "Weight and buoyancy", "lifted out and released: fall in 0.5 s", -0.5 * SEA.gravity_mps2 * 0.25, "m",
        lambda h: go(make_urov(vehicle("benzon2022"), h, position_m=(0.0, 0.0, 3.0)), 0.5).position_m[2] - 3.0, 1e-9,
        "rounding",
    )  # fmt: skip


def conserved(name: str) -> Iterator[Case]:
    """Energy and momentum of a tumbling vehicle and its water, without drag."""
    case = partial(Case, "What is conserved")

    def tumble(step_s: float) -> tuple[float, float]:
        how = {"velocity_mps": (1.0, 0.5, 0.3), "rate_radps": (0.5, 0.7, 0.9)}
        plant = make_urov(undamped(weightless(name)), step_s, **how)

        def momentum() -> np.ndarray:
            return rotation(np.array(plant.attitude)) @ (plant.mass_matrix @ plant.through_water)[:3]

        energy, linear = plant.kinetic_energy_j, momentum()
        go(plant, 20.0)
        gained = float(np.linalg.norm(momentum() - linear) / np.linalg.norm(linear))
        return plant.kinetic_energy_j / energy - 1.0, gained

    what = f"{name}: energy gained tumbling for 20 s, undamped"
    yield case(what, 0.0, "of it", lambda h: tumble(h)[0], 2e-5, ROUNDS)
    yield case(f"{name}: change of momentum, as a vector", 0.0, "of it", lambda h: tumble(h)[1], 5e-5, ROUNDS)


def current(name: str) -> Iterator[Case]:
    """Water that moves as a whole."""
    case = partial(Case, "Current")
    one, as_is, flow = weightless(name), trimmed(name), (0.3, 0.0, 0.0)

    def carried(step_s: float, by: Vehicle, velocity_mps: Vector, time_s: float = 3.0) -> Vector:
        return go(make_urov(by, step_s, currents=(Current(0.0, velocity_mps),)), time_s).velocity_mps

    def off_course(step_s: float) -> float:
        """Tumble in moving water, and in still water with the same speed through it: both must part evenly."""
        make = partial(make_urov, undamped(one), step_s, rate_radps=(0.3, 0.2, 1.0))
        moving = go(make(velocity_mps=(0.5, 0.0, 0.0), currents=(Current(0.0, flow),)), 10.0)
        still = go(make(velocity_mps=(0.2, 0.0, 0.0)), 10.0)
        apart = np.array(moving.position_m) - np.array(still.position_m)
        return float(np.linalg.norm(apart - 10.0 * np.array(flow)))

    drift = 0.3 - coasting(*along_axis(one, 0), 0.3, 3.0)
    yield case(f"{name}: drift after 3 s in 0.3 m/s", drift, "m/s", lambda h: carried(h, one, flow)[0], 1e-4)
    what = f"{name}: tumbling in a current and in still water, difference of the paths after 10 s"
    yield case(what, 0.0, "m", off_course, 1e-9, "rounding")
    yield case(
        f"{name}: lifted, after 3 s, by a current of 0.2 m/s upwards",
        0.2 - coasting(*along_axis(one, 2), 0.2, 3.0), "m/s", lambda h: carried(h, one, (0.0, 0.0, 0.2))[2], 1e-4,
    )  # fmt: skip
    rises = terminal_speed(one.linear_damping[2], one.quadratic_damping[2], 1.5)
    yield case(
        f"{name}: with its 1.5 N in a current of 0.3 m/s downwards", rises - 0.3, "m/s",
        lambda h: carried(h, as_is, (0.0, 0.0, -0.3), 30.0)[2], 1e-5, "what is left of the way to it in 30 s",
    )  # fmt: skip


def munk(name: str) -> Iterator[Case]:
    """The moment on a body that goes askew, and the circle that it leads to without heading hold."""
    case = partial(Case, "Added mass that differs by axis")
    one = weightless(name)
    added = np.diag(one.added_mass)
    askew = (added[0] - added[1]) * 1.0 * 0.2 / along_axis(one, 5)[0]

    def circle(step_s: float) -> float:
        plant = go(make_urov(one, step_s, rate_radps=(0.0, 0.0, 0.05)), 60.0, along(0, 40.0))
        u, v, _, _, _, r = plant.through_water
        return math.hypot(u, v) / abs(r)

    yield case(
        f"{name}: yaw acceleration at 1 m/s ahead and 0.2 to the left (Munk)", float(askew), "rad/s2",
        lambda h: go(make_urov(undamped(one), h, velocity_mps=(1.0, 0.2, 0.0)), h).rate_radps[2] / h, 1e-3,
        "it is the mean of a step, not its begin",
    )  # fmt: skip
    u, v, r = steady_circle(one, 40.0)
    what = f"{name}: radius of the circle it falls into by 40 N ahead"
    yield case(what, math.hypot(u, v) / abs(r), "m", circle, 1e-3, "what 60 s leave of the way into it")


def tether() -> Iterator[Case]:
    """The cheap tether: its drag, and its stretch."""
    case = partial(Case, "Tether")
    one = weightless("benzon2022")
    line = Tether((0.0, 0.0, -50.0), 20.0, attachment_m=(0.0, 0.0, 0.0))
    drag = 0.5 * 0.5 * SEA.density_kgm3 * line.across * line.diameter_m * 20.0 * 0.3**2

    def pull(step_s: float) -> float:
        """Force of the tether alone at the first moment: acceleration with it less that without it."""
        make = partial(make_urov, one, step_s, position_m=(20.0, 0.0, -50.0), currents=(Current(0.0, (0.0, 0.3, 0.0)),))
        with_it, alone = (plant.read("imu").specific_force_mps2[1] for plant in (make(tether=line), make()))
        return along_axis(one, 1)[0] * (with_it - alone)

    yield case("20 m across 0.3 m/s: share at the vehicle", drag, "N", pull, 1e-9, "rounding")
    bare = replace(line, across=0.0, along=0.0)
    yield case(
        "20 m, pulled with 50 N: length", 20.0 + 50.0 / line.stiffness_npm, "m",
        lambda h: go(make_urov(one, h, position_m=(19.5, 0.0, -50.0), tether=bare), 40.0, along(0, 50.0)).position_m[0],
        1e-4, "what 40 s leave of bouncing",
    )  # fmt: skip


def together(name: str) -> Iterator[Case]:
    """Everything at once, against the second opinion."""
    case = partial(Case, "All at once: 20 s of a wrench on six axes in a current, beside fossen_rk4.py")
    yield case(f"{name}: position", 0.0, "m", lambda h: mixed_error(name, h)[0], 5e-4)
    yield case(f"{name}: attitude", 0.0, "rad", lambda h: mixed_error(name, h)[1], 3e-4)


lopsided_together = partial(together, "lopsided")


def mixed_wrench(time_s: float) -> Six:
    """Return a wrench that moves all axes."""
    return (
        20.0 * math.sin(0.5 * time_s), 10.0 * math.cos(0.7 * time_s), 5.0 * math.sin(1.1 * time_s),
        0.5 * math.sin(0.9 * time_s), 0.3 * math.cos(1.3 * time_s), math.sin(0.4 * time_s + 1.0),
    )  # fmt: skip


def lopsided() -> Vehicle:
    """Return a vehicle whose matrices are full: no axis mirrors another, and its mass is off centre."""
    one = neutral("benzon2022")
    rng = np.random.default_rng(4)
    skew = np.diag([1.0, 1.0, 1.0, 0.15, 0.15, 0.15]) @ rng.normal(size=(6, 6))
    inertia = one.inertia_kgm2 + np.array([[0.0, 0.02, -0.01], [0.02, 0.0, 0.015], [-0.01, 0.015, 0.0]])
    return replace(
        one, name="lopsided", added_mass=one.added_mass + 2.0 * skew @ skew.T, inertia_kgm2=inertia,
        centre_of_mass_m=(0.02, -0.01, -0.03), net_buoyancy_n=None,
    )  # fmt: skip


def mixed(name: str) -> Vehicle:
    """Return the vehicle of a name, the lopsided one included."""
    return lopsided() if name == "lopsided" else replace(neutral(name), net_buoyancy_n=None)


@cache
def second_opinion(name: str) -> np.ndarray:
    """Return where 20 s of the mixed wrench lead to in a current, by fossen_rk4.py."""
    start = np.array([*CORNER, 1.0, *(0.0,) * 9])
    fossen = Fossen(mixed(name), np.array(MIXED_FLOW))
    return fossen.run(start, lambda t: np.array(mixed_wrench(t)), 20.0, 0.01)


@cache
def mixed_error(name: str, step_s: float) -> tuple[float, float]:
    """Return how far the plant is from the second opinion after 20 s: position [m], attitude [rad]."""
    plant = make_urov(mixed(name), step_s, position_m=CORNER, currents=(Current(0.0, MIXED_FLOW),))
    for i in range(round(20.0 / step_s)):
        go(plant, step_s, mixed_wrench((i + 0.5) * step_s))
    end = second_opinion(name)
    turn = rotation(end[3:7]).T @ rotation(np.array(plant.attitude))
    angle = 0.5 * math.hypot(turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1])
    return float(np.linalg.norm(np.array(plant.position_m) - end[:3])), angle
