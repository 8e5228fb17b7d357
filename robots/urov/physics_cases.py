"""Cases in which the vehicle's motion is known without a simulation, and what the plant makes of them.

Each case runs at 2, 5 and 10 ms. The reference is a closed form, a conserved quantity, the root of steady equations or
the second opinion in fossen_rk4.py; `allowed` is how far the plant may be from it, and `why` says what that leaves room
for. `physics_table.py` makes the page PHYSICS.md of them, and tests/plants/test_urov_physics.py holds the plant to it.

The vehicles: a set as it is ('benzon2022', 'wu2018'), 'neutral' (ballasted to weigh nothing in water), 'weightless'
(neutral, and its buoyancy where its mass is), 'undamped' (weightless without drag).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from fossen_rk4 import Fossen, rotation

from snr_sim.plants.dive import Current, Dive, Load
from snr_sim.plants.pool import Pool
from snr_sim.plants.tether import Tether
from snr_sim.plants.urov import Urov
from snr_sim.plants.urov_state import WrenchCommand
from snr_sim.plants.vehicle import Six, Vector, Vehicle
from snr_sim.plants.vehicle_file import read_vehicle
from snr_sim.prelude.angles import roll_pitch_yaw_rad
from snr_sim.prelude.wrench import AXES

STEPS_S = (0.002, 0.005, 0.01)
SETS = ("benzon2022", "wu2018")
SEA = Pool(length_m=2000.0, width_m=2000.0, depth_m=200.0)
DEEP: Vector = (0.0, 0.0, -50.0)
CORNER: Vector = (950.0, -930.0, -120.0)  # far from the origin of the world
TILTED: Vector = (math.radians(45.0), math.radians(20.0), math.radians(130.0))
FLAT_OUT_N = 129.3  # two thrusters ahead and two astern at 16 V, along x
BASIN = Pool(length_m=20.0, width_m=20.0, depth_m=4.0)

SECOND_ORDER = "error of the midpoint rule, of second order in the step"
LEFT = "what is left of the way to it in 12 s"
ROUNDING = "what the rounds leave of the midpoint rule's equation"


@dataclass(frozen=True)
class Case:
    """One number that is known.

    Args:
        group: heading of the page it stands under.
        name: what is measured.
        reference: what it should be.
        unit: of it.
        run: gives what it is, for a step.
        allowed: largest error, a share of the reference; if that is 0, in the unit.
        why: what `allowed` leaves room for.
    """

    group: str
    name: str
    reference: float
    unit: str
    run: Callable[[float], float]
    allowed: float
    why: str = SECOND_ORDER

    def error(self, ours: float) -> float:
        """Returns the error as `allowed` counts it."""
        return ours / self.reference - 1.0 if self.reference else ours


# -- vehicles and their motion ----------------------------------------------------------------------------------------


@cache
def vehicle(name: str) -> Vehicle:
    """Returns a set of numbers as it is in its file."""
    return read_vehicle(Path(__file__).parent / "vehicles" / f"{name}.toml")


def neutral(name: str) -> Vehicle:
    """Returns it ballasted to weigh nothing in water."""
    return replace(vehicle(name), net_buoyancy_n=0.0).trimmed(SEA.density_kgm3, SEA.gravity_mps2)


def weightless(name: str) -> Vehicle:
    """Returns it neutral, with its buoyancy where its mass is: nothing acts but what a case asks for."""
    return replace(neutral(name), centre_of_buoyancy_m=(0.0, 0.0, 0.0))


def undamped(one: Vehicle) -> Vehicle:
    """Returns it in water without drag."""
    none: Six = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    return replace(one, linear_damping=none, quadratic_damping=none)


def swim(one: Vehicle, step_s: float, pool: Pool = SEA, **how: object) -> Urov:
    """Returns a plant; `how` it begins is as in Dive, and deep down if nothing else is said."""
    dive = Dive(**{"position_m": DEEP, **how})  # type: ignore[arg-type]
    return Urov(one, pool, lambda seed: dive, step_s=step_s)


def go(plant: Urov, time_s: float, wrench: Six | None = None) -> Urov:
    """Lets time pass, under another wrench if one is given."""
    if wrench is not None:
        plant.write("wrench", WrenchCommand(list(wrench[:3]), list(wrench[3:])))
    for _ in range(round(time_s / plant.step_s)):
        plant.step(plant.step_s)
    return plant


def along(axis: int, value: float) -> Six:
    """Returns six numbers, one of them not 0."""
    x, y, z, k, m, n = (value if i == axis else 0.0 for i in range(6))
    return x, y, z, k, m, n


def mass_along(one: Vehicle, axis: int) -> float:
    """Returns mass or inertia of vehicle and water, for vehicles whose origin is their centre of mass."""
    dry = one.mass_kg if axis < 3 else float(one.inertia_kgm2[axis - 3, axis - 3])
    return dry + float(one.added_mass[axis, axis])


# -- one axis ---------------------------------------------------------------------------------------------------------


def step_response(mass: float, a: float, b: float, push: float, time_s: float) -> tuple[float, float]:
    """Returns speed and way from rest under a constant push, against drag a u + b u |u|."""
    u1 = (math.sqrt(a * a + 4.0 * b * push) - a) / (2.0 * b)
    u2 = u1 + a / b
    k = b * (u1 + u2) / mass
    e = math.exp(-k * time_s)
    return u1 * (1.0 - e) / (1.0 + u1 / u2 * e), u1 * time_s - (u1 + u2) / k * math.log(
        (1.0 + u1 / u2) / (1.0 + u1 / u2 * e)
    )


def terminal_speed(a: float, b: float, push: float) -> float:
    """Returns the speed at which drag is the push."""
    return (math.sqrt(a * a + 4.0 * b * push) - a) / (2.0 * b)


def coasting(mass: float, a: float, b: float, speed: float, time_s: float) -> float:
    """Returns what is left of a speed."""
    if a == 0.0:
        return speed / (1.0 + b * speed * time_s / mass)
    return a / (math.exp(a * time_s / mass) * (a / speed + b) - b)


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


# -- weight and buoyancy ----------------------------------------------------------------------------------------------


def period(plant: Urov, axis: int, swings: int = 1) -> float:
    """Returns the mean time of a full swing in roll (0) or pitch (1), from where its rate changes sign."""
    turns, before = [], plant.rate_radps[axis]
    while len(turns) <= 2 * swings:
        plant.step(plant.step_s)
        now = plant.rate_radps[axis]
        if before * now < 0.0:
            turns.append(plant.time_s - plant.step_s * now / (now - before))
        before = now
    return (turns[2 * swings] - turns[0]) / swings


def pendulum_period(mass: float, stiffness: float, swing_rad: float) -> float:
    """Returns the period of an undamped pendulum at any swing, by the arithmetic-geometric mean."""
    a, b = 1.0, math.cos(0.5 * swing_rad)
    while abs(a - b) > 1e-15:
        a, b = 0.5 * (a + b), math.sqrt(a * b)
    return 2.0 * math.pi * math.sqrt(mass / stiffness) / a


def righting() -> Iterator[Case]:
    """Buoyancy above the centre of mass, and against the weight."""
    group = "Weight and buoyancy"
    for name in SETS:
        one = neutral(name)
        stiffness = SEA.density_kgm3 * SEA.gravity_mps2 * one.volume_m3 * one.centre_of_buoyancy_m[2]
        for axis in (0, 1):
            mass, damping = mass_along(one, 3 + axis), one.linear_damping[3 + axis]
            share = damping / (2.0 * math.sqrt(stiffness * mass))
            tilt = along(axis, math.radians(0.05))
            yield Case(
                group, f"{name}: period of a small {AXES[3 + axis]}, damping {share:.3f}",
                2.0 * math.pi * math.sqrt(mass / stiffness / (1.0 - share * share)), "s",
                lambda h, one=one, tilt=tilt, axis=axis: period(swim(one, h, attitude_rad=tilt[:3]), axis), 5e-4,
                "quadratic drag at 0.05 deg, and where the rate changes sign between two steps",
            )  # fmt: skip
        free = replace(one, linear_damping=(0.0,) * 6, quadratic_damping=(0.0,) * 6)
        swing = math.radians(120.0)
        yield Case(
            group, f"{name}: period of a roll from 120 deg, undamped",
            pendulum_period(mass_along(one, 3), stiffness, swing), "s",
            lambda h, free=free, swing=swing: period(swim(free, h, attitude_rad=(swing, 0.0, 0.0)), 0), 2e-4,
        )  # fmt: skip

        def swing_energy(step_s: float, free: Vehicle = free, stiffness: float = stiffness) -> float:
            plant = swim(free, step_s, attitude_rad=(2.0, 0.4, 0.0))
            begin = stiffness * rotation(np.array(plant.attitude))[2, 2]
            go(plant, 20.0)
            now = stiffness * rotation(np.array(plant.attitude))[2, 2]
            return (plant.kinetic_energy_j + begin - now) / (stiffness - begin)

        yield Case(
            group, f"{name}: energy gained by a swing from 115 deg in 20 s, undamped", 0.0, "of it", swing_energy, 1e-4,
            ROUNDING,
        )  # fmt: skip
        as_is = vehicle(name).trimmed(SEA.density_kgm3, SEA.gravity_mps2)
        a, b = one.linear_damping[2], one.quadratic_damping[2]
        rise = step_response(mass_along(as_is, 2), a, b, 1.5, 3.0)[1]
        yield Case(
            group, f"{name}: rise by its 1.5 N in 3 s", rise, "m",
            lambda h, as_is=as_is: go(swim(as_is, h), 3.0).position_m[2] - DEEP[2], 1e-4,
        )  # fmt: skip
        lead = Load(2.0, 2.0 * 0.000088)
        net = 1.5 - 9.81 * (lead.mass_kg - SEA.density_kgm3 * lead.volume_m3)
        sunk = -step_response(mass_along(as_is, 2) + lead.mass_kg, a, b, -net, 3.0)[1]
        yield Case(
            group, f"{name}: way in 3 s with 2 kg of lead", sunk, "m",
            lambda h, as_is=as_is, lead=lead: go(swim(as_is, h, loads=(lead,)), 3.0).position_m[2] - DEEP[2], 1e-4,
        )  # fmt: skip
        low = 0.085  # thrust line under the centre of mass, m
        nose_up = math.degrees(math.asin(2.0 * low / stiffness))

        def pitch_up(step_s: float, one: Vehicle = one, low: float = low) -> float:
            plant = go(swim(one, step_s), 40.0, (2.0, 0.0, 0.0, 0.0, -2.0 * low, 0.0))
            return math.degrees(-roll_pitch_yaw_rad(plant.attitude)[1])

        yield Case(
            group, f"{name}, neutral: nose up by 2 N ahead, {low} m below", nose_up, "deg",
            pitch_up, 5e-3, "what 40 s leave of the swing to it",
        )  # fmt: skip
        share = 1.0 - 1.5 / (SEA.density_kgm3 * SEA.gravity_mps2 * as_is.volume_m3)
        floats = (0.5 - share) * as_is.size_m[2] - as_is.centre_of_buoyancy_m[2]
        yield Case(
            group, f"{name}: height of its origin when it floats", floats, "m",
            lambda h, as_is=as_is, floats=floats: go(
                swim(as_is, h, position_m=(0.0, 0.0, floats - 0.002)), 15.0
            ).position_m[2], 5e-3, "what 15 s leave of bobbing",
        )  # fmt: skip
    one = vehicle("benzon2022")
    yield Case(
        group, "lifted out and let go: fall in 0.5 s", -0.5 * SEA.gravity_mps2 * 0.25, "m",
        lambda h: go(swim(one, h, position_m=(0.0, 0.0, 3.0)), 0.5).position_m[2] - 3.0, 1e-9, "rounding",
    )  # fmt: skip


# -- what is conserved ------------------------------------------------------------------------------------------------


def conserved() -> Iterator[Case]:
    """Energy and momentum of a tumbling vehicle and its water, without drag."""
    for name in SETS:
        one = undamped(weightless(name))

        def tumble(step_s: float, one: Vehicle = one) -> tuple[float, float]:
            plant = swim(one, step_s, velocity_mps=(1.0, 0.5, 0.3), rate_radps=(0.5, 0.7, 0.9))

            def momentum() -> np.ndarray:
                return rotation(np.array(plant.attitude)) @ (plant.mass_matrix @ plant.through_water)[:3]

            energy, linear = plant.kinetic_energy_j, momentum()
            go(plant, 20.0)
            gained = float(np.linalg.norm(momentum() - linear) / np.linalg.norm(linear))
            return plant.kinetic_energy_j / energy - 1.0, gained

        yield Case(
            "What is conserved", f"{name}: energy gained tumbling for 20 s, undamped", 0.0, "of it",
            lambda h, tumble=tumble: tumble(h)[0], 2e-5, ROUNDING,
        )  # fmt: skip
        yield Case(
            "What is conserved", f"{name}: change of momentum, as a vector", 0.0, "of it",
            lambda h, tumble=tumble: tumble(h)[1], 5e-5, ROUNDING,
        )  # fmt: skip


# -- current ----------------------------------------------------------------------------------------------------------


def current() -> Iterator[Case]:
    """Water that moves as a whole."""
    flow = (0.3, 0.0, 0.0)
    for name in SETS:
        one = weightless(name)
        a, b = one.linear_damping[0], one.quadratic_damping[0]
        slip = coasting(mass_along(one, 0), a, b, 0.3, 3.0)
        yield Case(
            "Current", f"{name}: drift after 3 s in 0.3 m/s", 0.3 - slip, "m/s",
            lambda h, one=one: go(swim(one, h, currents=(Current(0.0, flow),)), 3.0).velocity_mps[0], 1e-4,
        )  # fmt: skip
        spinning = undamped(one)

        def off_course(step_s: float, one: Vehicle = spinning) -> float:
            """Tumbles in moving water, and in still water with the same speed through it: both must part evenly."""
            moving = swim(
                one, step_s, rate_radps=(0.3, 0.2, 1.0), velocity_mps=(0.5, 0.0, 0.0), currents=(Current(0.0, flow),)
            )
            still = swim(one, step_s, rate_radps=(0.3, 0.2, 1.0), velocity_mps=(0.2, 0.0, 0.0))
            go(moving, 10.0)
            go(still, 10.0)
            apart = np.array(moving.position_m) - np.array(still.position_m)
            return float(np.linalg.norm(apart - 10.0 * np.array(flow)))

        yield Case(
            "Current", f"{name}: tumbling in a current and in still water, part from its way in 10 s", 0.0, "m",
            off_course, 1e-9, "rounding",
        )  # fmt: skip


# -- added mass that is not the same along all axes -------------------------------------------------------------------


def steady_circle(one: Vehicle, push: float) -> tuple[float, float, float]:
    """Returns speed ahead, sideways and rate of the circle that a push ahead ends in, by Newton's method."""
    mx, my = mass_along(one, 0), mass_along(one, 1)

    def unbalanced(state: np.ndarray) -> np.ndarray:
        u, v, r = state
        drag = [
            one.linear_damping[i] * value + one.quadratic_damping[i] * value * abs(value)
            for i, value in ((0, u), (1, v), (5, r))
        ]
        return np.array([push + my * v * r - drag[0], -mx * u * r - drag[1], (mx - my) * u * v - drag[2]])

    # Begins from where the circle is wide: sideways speed as great as half of the speed ahead.
    ahead = terminal_speed(one.linear_damping[0], one.quadratic_damping[0], push)
    state = np.array([0.7 * ahead, -0.4 * ahead, 0.5])
    for _ in range(100):
        slope = np.array([(unbalanced(state + 1e-7 * e) - unbalanced(state)) / 1e-7 for e in np.eye(3)]).T
        state = state - 0.5 * np.linalg.solve(slope, unbalanced(state))
    u, v, r = state.tolist()
    return u, v, r


def munk() -> Iterator[Case]:
    """The moment on a body that goes askew, and the circle that it leads to without heading hold."""
    group = "Added mass that differs by axis"
    for name in SETS:
        one = weightless(name)
        added = np.diag(one.added_mass)
        askew = (added[0] - added[1]) * 1.0 * 0.2 / mass_along(one, 5)
        yield Case(
            group, f"{name}: yaw acceleration at 1 m/s ahead and 0.2 to the left (Munk)", float(askew), "rad/s2",
            lambda h, one=one: go(
                swim(undamped(one), h, velocity_mps=(1.0, 0.2, 0.0)), h
            ).rate_radps[2] / h, 1e-3, "it is the mean of a step, not its begin",
        )  # fmt: skip
        u, v, r = steady_circle(one, 40.0)
        radius = math.hypot(u, v) / abs(r)

        def circle(step_s: float, one: Vehicle = one) -> float:
            plant = go(swim(one, step_s, rate_radps=(0.0, 0.0, 0.05)), 60.0, along(0, 40.0))
            u, v, _, _, _, r = plant.through_water
            return math.hypot(u, v) / abs(r)

        yield Case(
            group, f"{name}: radius of the circle it falls into by 40 N ahead", radius, "m", circle, 1e-3,
            "what 60 s leave of the way into it",
        )  # fmt: skip


# -- contact ----------------------------------------------------------------------------------------------------------


def contact() -> Iterator[Case]:
    """Floor and wall, which meet the mass of vehicle and water."""
    for name in SETS:
        one = vehicle(name).trimmed(BASIN.density_kgm3, BASIN.gravity_mps2)
        bottom = -BASIN.depth_m + 0.5 * one.size_m[2]

        def pressed(step_s: float, one: Vehicle = one, bottom: float = bottom) -> float:
            plant = go(swim(one, step_s, BASIN, position_m=(0.0, 0.0, bottom)), 3.0, along(2, -40.0))
            return (plant.contact_n or DEEP)[2]

        yield Case(
            "Contact", f"{name}: force on the floor, 40 N down less 1.5 N", 38.5, "N", pressed, 1e-3,
            "what 3 s leave of settling",
        )  # fmt: skip
        free = undamped(weightless(name))
        side = 0.5 * BASIN.length_m - 0.5 * one.size_m[0]

        def bump(step_s: float, free: Vehicle = free, side: float = side) -> float:
            """Meets a wall with the bow; returns the wall's impulse less the change of momentum, as a share of it."""
            plant = swim(free, step_s, BASIN, position_m=(side - 0.1, 0.0, -2.0), velocity_mps=(0.5, 0.0, 0.0))
            impulse = 0.0
            for _ in range(round(0.6 / step_s)):
                plant.step(step_s)
                impulse += step_s * (plant.contact_n or (0.0, 0.0, 0.0))[0]
            return impulse / (mass_along(free, 0) * (plant.velocity_mps[0] - 0.5))

        yield Case(
            "Contact", f"{name}: impulse of a wall, by the change of momentum of vehicle and water", 1.0, "",
            bump, 1e-9, "rounding",
        )  # fmt: skip


# -- tether -----------------------------------------------------------------------------------------------------------


def tether() -> Iterator[Case]:
    """The cheap tether."""
    one = weightless("benzon2022")
    line = Tether((0.0, 0.0, -50.0), 20.0, place_m=(0.0, 0.0, 0.0))
    mass = mass_along(one, 1)
    drag = 0.5 * 0.5 * SEA.density_kgm3 * line.across * line.diameter_m * 20.0 * 0.3**2
    flow = (Current(0.0, (0.0, 0.3, 0.0)),)

    def pull(step_s: float) -> float:
        """Force of the tether alone at the first moment: acceleration with it less that without it."""
        place = (20.0, 0.0, -50.0)
        with_it = swim(one, step_s, position_m=place, currents=flow, tether=line).read("imu").specific_force_mps2[1]
        alone = swim(one, step_s, position_m=place, currents=flow).read("imu").specific_force_mps2[1]
        return mass * (with_it - alone)

    yield Case("Tether", "20 m across 0.3 m/s: share at the vehicle", drag, "N", pull, 1e-9, "rounding")
    stretched = 20.0 + 50.0 / line.stiffness_npm
    bare = replace(line, across=0.0, along=0.0)
    yield Case(
        "Tether", "20 m, pulled with 50 N: length", stretched, "m",
        lambda h: go(swim(one, h, position_m=(19.5, 0.0, -50.0), tether=bare), 40.0, along(0, 50.0)).position_m[0],
        1e-4, "what 40 s leave of bouncing",
    )  # fmt: skip


# -- all at once ------------------------------------------------------------------------------------------------------


def mixed_wrench(time_s: float) -> Six:
    """Returns a wrench that moves all axes."""
    return (
        20.0 * math.sin(0.5 * time_s), 10.0 * math.cos(0.7 * time_s), 5.0 * math.sin(1.1 * time_s),
        0.5 * math.sin(0.9 * time_s), 0.3 * math.cos(1.3 * time_s), math.sin(0.4 * time_s + 1.0),
    )  # fmt: skip


def lopsided() -> Vehicle:
    """Returns a vehicle whose matrices are full: no axis mirrors another, and its mass is off centre."""
    one = neutral("benzon2022")
    rng = np.random.default_rng(4)
    skew = np.diag([1.0, 1.0, 1.0, 0.15, 0.15, 0.15]) @ rng.normal(size=(6, 6))
    inertia = one.inertia_kgm2 + np.array([[0.0, 0.02, -0.01], [0.02, 0.0, 0.015], [-0.01, 0.015, 0.0]])
    return replace(
        one, name="lopsided", added_mass=one.added_mass + 2.0 * skew @ skew.T, inertia_kgm2=inertia,
        centre_of_mass_m=(0.02, -0.01, -0.03), net_buoyancy_n=None,
    )  # fmt: skip


@cache
def second_opinion(name: str) -> np.ndarray:
    """Returns where 20 s of the mixed wrench lead to in a current, by fossen_rk4.py."""
    start = np.array([*CORNER, 1.0, *(0.0,) * 9])
    fossen = Fossen(mixed(name), np.array(MIXED_FLOW))
    return fossen.run(start, lambda t: np.array(mixed_wrench(t)), 20.0, 0.01)


MIXED_FLOW = (0.3, -0.2, 0.1)


def mixed(name: str) -> Vehicle:
    """Returns the vehicle of a name, the lopsided one included."""
    return lopsided() if name == "lopsided" else replace(neutral(name), net_buoyancy_n=None)


@cache
def mixed_error(name: str, step_s: float) -> tuple[float, float]:
    """Returns how far the plant is from the second opinion after 20 s: position [m], attitude [rad]."""
    plant = swim(mixed(name), step_s, position_m=CORNER, currents=(Current(0.0, MIXED_FLOW),))
    for i in range(round(20.0 / step_s)):
        go(plant, step_s, mixed_wrench((i + 0.5) * step_s))
    end = second_opinion(name)
    q = end[3:7]
    turn = rotation(q).T @ rotation(np.array(plant.attitude))
    angle = 0.5 * math.hypot(turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1])
    return float(np.linalg.norm(np.array(plant.position_m) - end[:3])), angle


def together() -> Iterator[Case]:
    """Everything at once, against the second opinion."""
    for name in (*SETS, "lopsided"):
        yield Case(
            "All at once: 20 s of a wrench on six axes in a current, beside fossen_rk4.py", f"{name}: position", 0.0,
            "m", lambda h, name=name: mixed_error(name, h)[0], 5e-4,
        )  # fmt: skip
        yield Case(
            "All at once: 20 s of a wrench on six axes in a current, beside fossen_rk4.py", f"{name}: attitude", 0.0,
            "rad", lambda h, name=name: mixed_error(name, h)[1], 3e-4,
        )  # fmt: skip


def cases() -> list[Case]:
    """Returns all cases."""
    found = [
        case for group in (steps, righting, conserved, current, munk, together, contact, tether) for case in group()
    ]
    headings = list(dict.fromkeys(case.group for case in found))
    return sorted(found, key=lambda case: headings.index(case.group))
