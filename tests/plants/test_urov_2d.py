"""The vehicle in the plane and the one in space agree, from the same numbers, by different methods.

In space Fossen's equation is solved in the body's frame, in the plane momentum is kept in the world's; both have an
error that shrinks with the square of the step. So what the two may differ by in open water is that: 0.1 mm and
0.1 mrad, and as much per second, at 5 ms, after seconds of every motion at once. Where something touches they differ by
what a contact is: MuJoCo's gives by 2 mm and takes some steps to stop a body, the plane's stops it in one.
"""

import json
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from snr_sim.plants.urov.dive import Current, Dive, Leak, Payload, ThrusterFault
from snr_sim.plants.urov.pool import Gate, Pool
from snr_sim.plants.urov.propulsion import Propulsion
from snr_sim.plants.urov.tether import Tether
from snr_sim.plants.urov.urov import Urov
from snr_sim.plants.urov.urov_2d import Urov2D, in_plane
from snr_sim.plants.urov.urov_state import WrenchCommand
from snr_sim.plants.urov.vehicle import Vehicle
from snr_sim.plants.urov.vehicle_file import read_vehicle
from snr_sim.prelude.angles import roll_pitch_yaw_rad
from snr_sim.prelude.errors import PlantError
from snr_sim.prelude.signals import PwmCommand
from snr_sim.testing.contracts import check_plant
from tests.lanes import slow
from tests.plants.vehicles import HEAVY, VEHICLES

SETS = {"benzon2022": HEAVY, "wu2018": read_vehicle(VEHICLES / "wu2018.toml")}
SEA = Pool(2000.0, 2000.0, 200.0)  # nothing in reach
PULSES = PwmCommand([1600.0, 1600.0, 1400.0, 1400.0, 1550.0, 1450.0, 1440.0, 1560.0])

Program = Sequence[tuple[float, list[float], list[float]]]  # at s, force x y z, moment x y z
Numbers = tuple[float, float, float, float, float, float]  # x, z, pitch, and their rates

every_set = pytest.mark.parametrize("vehicle", SETS.values(), ids=SETS)


def both(vehicle: Vehicle = HEAVY, pool: Pool = SEA, step_s: float = 0.005, **how: object) -> tuple[Urov, Urov2D]:
    """The same dive in both; `how` it begins is as in Dive."""
    dive = Dive(**{"position_m": (0.0, 0.0, -50.0), **how})  # type: ignore[arg-type]
    space = Urov(vehicle, pool, lambda seed: dive, step_s=step_s)
    return space, Urov2D(vehicle, pool, lambda seed: dive, step_s=step_s)


def numbers(plant: Urov) -> Numbers:
    (x, _, z), (vx, _, vz) = plant.position_m, plant.velocity_mps
    return x, z, roll_pitch_yaw_rad(plant.attitude)[1], vx, vz, plant.rate_radps[1]


def go(plants: Sequence[Urov], time_s: float, program: Program = ()) -> list[float]:
    """The largest differences during the run."""
    max_errors = [0.0] * 6
    step_s = plants[0].step_s
    commands = {round(at_s / step_s): WrenchCommand(force, moment) for at_s, force, moment in program}
    for i in range(round(time_s / step_s)):
        for plant in plants:
            if i in commands:
                plant.write("wrench", commands[i])
            plant.step(step_s)
        max_errors = [max(worst, abs(a - b)) for worst, a, b in zip(max_errors, *map(numbers, plants), strict=True)]
    return max_errors


def weightless(vehicle: Vehicle) -> Vehicle:
    return replace(vehicle, net_buoyancy_n=0.0, centre_of_buoyancy_m=vehicle.centre_of_mass_m)


def undamped(vehicle: Vehicle) -> Vehicle:
    return replace(weightless(vehicle), linear_damping=(0.0,) * 6, quadratic_damping=(0.0,) * 6)


def at(force: Sequence[float], moment: Sequence[float] = (0.0, 0.0, 0.0), at_s: float = 0.0) -> Program:
    return [(at_s, list(force), list(moment))]


def step_answer(force: float, mass: float, linear: float, quadratic: float, time_s: float) -> float:
    """Speed after a step of force, along one axis: the closed form."""
    if linear == 0.0:
        top = math.sqrt(force / quadratic)
        return top * math.tanh(quadratic * top * time_s / mass)
    root = math.sqrt(linear**2 + 4.0 * quadratic * force)
    u1 = (root - linear) / (2.0 * quadratic)
    u2 = u1 + linear / quadratic
    decay = math.exp(-quadratic * (u1 + u2) / mass * time_s)
    return u1 * (1.0 - decay) / (1.0 + u1 / u2 * decay)


MIXED: Program = [
    (0.0, [20.0, 0.0, 10.0], [0.0, 0.5, 0.0]),
    (3.0, [-20.0, 0.0, 10.0], [0.0, -1.0, 0.0]),
    (6.0, [0.0, 0.0, -10.0], [0.0, 1.0, 0.0]),
]


@every_set
@pytest.mark.parametrize("axis", [0, 2], ids=["surge", "heave"])
@pytest.mark.parametrize("step_s", [0.002, 0.005, 0.01])
def test_force_step_response_equals_closed_form(vehicle: Vehicle, axis: int, step_s: float) -> None:
    force = [0.0, 0.0, 0.0]
    force[axis] = -40.0
    plants = both(weightless(vehicle), step_s=step_s)
    assert max(go(plants, 1.0, at(force))) < 1e-5
    trimmed = plants[1].vehicle
    mass = trimmed.mass_kg + trimmed.added_mass[axis, axis]
    exact = step_answer(40.0, mass, trimmed.linear_damping[axis], trimmed.quadratic_damping[axis], 1.0)
    # The step's own error: 4e-5 at 10 ms.
    assert plants[1].velocity_mps[axis] == pytest.approx(-exact, rel=1e-4)


@every_set
def test_pitch_swing_is_equal_in_both(vehicle: Vehicle) -> None:
    differ = go(both(replace(vehicle, net_buoyancy_n=0.0), attitude_rad=(0.0, 0.5, 0.0)), 10.0)
    assert max(differ) < 1e-4


@every_set
def test_small_swing_period_equals_closed_form(vehicle: Vehicle) -> None:
    hung = replace(undamped(vehicle), centre_of_buoyancy_m=vehicle.centre_of_buoyancy_m)
    plant = both(hung, attitude_rad=(0.0, 0.02, 0.0))[1]
    trimmed = plant.vehicle
    above = trimmed.centre_of_buoyancy_m[2] - trimmed.centre_of_mass_m[2]
    inertia = trimmed.inertia_kgm2[1, 1] + trimmed.added_mass[4, 4]
    period = 2.0 * math.pi * math.sqrt(inertia / (trimmed.mass_kg * 9.81 * above))
    crossings, before = [], numbers(plant)[2]
    while len(crossings) < 3:
        plant.step(0.005)
        now = numbers(plant)[2]
        if now * before < 0.0:
            crossings.append(plant.time_s - 0.005 * now / (now - before))
        before = now
    # (rate dt)^2 / 24 of the scheme, and the amplitude's share: 3e-5.
    assert crossings[2] - crossings[0] == pytest.approx(period, rel=2e-4)


@every_set
def test_ascent_to_surface_is_equal_in_both(vehicle: Vehicle) -> None:
    plants = both(vehicle, Pool(), position_m=(0.0, 0.0, -0.6))
    assert max(go(plants, 20.0)) < 1e-4
    assert plants[1].velocity_mps[2] == pytest.approx(0.0, abs=0.05)
    assert -0.15 < plants[1].position_m[2] < 0.0


@every_set
@pytest.mark.parametrize(("step_s", "limit"), [(0.0025, 3e-5), (0.005, 1e-4), (0.01, 4e-4)])
def test_combined_motion_differs_by_square_of_step(vehicle: Vehicle, step_s: float, limit: float) -> None:
    assert max(go(both(vehicle, step_s=step_s), 10.0, MIXED)) < limit


@pytest.mark.parametrize(("name", "limit_m"), [("benzon2022", 2e-5), ("wu2018", 1e-3)])
def test_twenty_seconds_of_motion_differ_less_than_1_mm(name: str, limit_m: float) -> None:
    """`wu2018` turns at the moment of Munk, which makes more of every difference the longer it lasts."""
    to_and_fro = [
        (t, [25.0 * math.sin(0.6 * t), 0.0, 12.0 * math.cos(0.9 * t)], [0.0, 0.8 * math.sin(1.3 * t), 0.0])
        for t in (0.05 * i for i in range(400))
    ]
    flow = (Current(0.0, (0.3, 0.0, -0.1)),)
    plants = both(SETS[name], currents=flow, attitude_rad=(0.0, 0.2, 0.0))
    assert max(go(plants, 20.0, to_and_fro)[:2]) < limit_m


@pytest.mark.parametrize(("z_m", "limit"), [(-50.0, 3e-4), (-0.3, 3e-4), (0.1, 3e-4)], ids=["deep", "under", "over"])
@pytest.mark.parametrize("seed", [0, *map(slow, range(1, 4))])
def test_asymmetric_vehicles_move_equally_in_both(seed: int, z_m: float, limit: float) -> None:
    rng = np.random.default_rng(seed)

    def some(*max_errors: float) -> list[float]:
        return [rng.uniform(-one, one) for one in max_errors]

    vehicle = list(SETS.values())[seed % 2]
    added = vehicle.added_mass.copy()
    for (row, column), value in zip(((0, 2), (0, 4), (2, 4)), some(2.0, 0.3, 0.3), strict=True):
        added[row, column] = added[column, row] = value
    x, z = some(0.03, 0.015)
    vehicle = replace(vehicle, added_mass=added, centre_of_mass_m=(x, 0.0, z - 0.015), net_buoyancy_n=some(3.0)[0])
    (pitch, rate), (vx, vz), (cx, cz) = some(1.5, 1.0), some(1.0, 1.0), some(0.5, 0.1)
    program = [
        (at_s, [fx, 0.0, fz], [0.0, m, 0.0]) for at_s in (0.0, 1.5, 3.0) for fx, fz, m in [some(25.0, 25.0, 2.0)]
    ]
    plants = both(
        vehicle, position_m=(0.0, 0.0, z_m), attitude_rad=(0.0, pitch, 0.0), velocity_mps=(vx, 0.0, vz),
        rate_radps=(0.0, rate, 0.0), currents=(Current(1.0, (cx, 0.0, cz)),),
    )  # fmt: skip
    x, z, _, *rates = go(plants, 5.0, program)
    assert max(x, z, *rates) < limit


def test_current_loads_leak_and_tether_act_equally_in_both() -> None:
    plants = both(
        pool=Pool(),
        position_m=(0.0, 0.0, -1.0),
        currents=(Current(1.0, (0.3, 0.0, 0.0)), Current(4.0, (-0.1, 0.0, 0.05))),
        loads=(Payload(0.3, 0.0, (0.1, 0.0, -0.1), 1.0, 3.0),),
        leak=Leak(2.0, 0.1),
        tether=Tether((-3.0, 0.0, 0.0), 3.3),
    )
    assert max(go(plants, 8.0, at([12.0, 0.0, 0.0]))) < 1e-4
    assert plants[1].read("leak").water_l == pytest.approx(0.6, abs=0.01)
    assert plants[1].truth()["vectors"]["tether"] == pytest.approx(plants[0].truth()["vectors"]["tether"], abs=1e-2)


@every_set
def test_undamped_motion_keeps_energy_and_momentum(vehicle: Vehicle) -> None:
    plant = both(undamped(vehicle), velocity_mps=(1.0, 0.0, -0.5), rate_radps=(0.0, 1.5, 0.0), step_s=0.01)[1]
    mass = [plant.vehicle.mass_kg + float(plant.vehicle.added_mass[axis, axis]) for axis in (0, 2)]

    def kept() -> tuple[float, float, float]:
        u, _, w, _, q, _ = plant.through_water
        p1, p3 = mass[0] * u, mass[1] * w
        inertia = plant.vehicle.inertia_kgm2[1, 1] + plant.vehicle.added_mass[4, 4]
        energy = 0.5 * (p1 * u + p3 * w + inertia * q * q)
        w0, _, y0, _ = plant.attitude
        cos, sin = w0 * w0 - y0 * y0, 2.0 * w0 * y0
        return energy, cos * p1 + sin * p3, cos * p3 - sin * p1

    before = kept()
    for _ in range(2000):
        plant.step(0.01)
    energy, along_x, along_z = kept()
    assert (along_x, along_z) == pytest.approx(before[1:], rel=1e-6)
    assert energy == pytest.approx(before[0], rel=1e-3)


PRESSED = [((0.0, 0.0, -3.5), (0.0, 0.0, -40.0)), ((12.0, 0.0, -1.5), (20.0, 0.0, 0.0))]


@pytest.mark.parametrize(("place", "force"), PRESSED, ids=["floor", "wall"])
def test_contact_force_on_floor_or_wall_equals_load(place: tuple[float, ...], force: tuple[float, ...]) -> None:
    plants = both(replace(HEAVY, net_buoyancy_n=0.0), Pool(), position_m=place)
    go(plants, 4.0, at(force))
    for plant in plants:
        assert plant.contact_n is not None
        along = [a for a in plant.contact_n if abs(a) > 1.0]
        assert along == pytest.approx([-value for value in force if value], rel=5e-3)
        assert plant.velocity_mps == pytest.approx((0.0, 0.0, 0.0), abs=1e-3)
    # MuJoCo's contact gives by 2 mm.
    assert plants[1].position_m == pytest.approx(plants[0].position_m, abs=3e-3)


@pytest.mark.parametrize("step_s", [0.005, 0.01, slow(0.002)])
def test_sliding_distance_after_landing_is_independent_of_step(step_s: float) -> None:
    """Where contacts in space took the plant's own steps, it hopped, and where to depended on the step."""
    plants = both(
        SETS["wu2018"], Pool(40.0, 40.0, 4.0), step_s, position_m=(0.0, 0.0, -3.5), attitude_rad=(0.0, 0.1, 0.0),
        currents=(Current(0.0, (0.2, 0.0, 0.0)),),
    )  # fmt: skip
    go(plants, 6.0, at([25.0, 0.0, -40.0]))
    space, plane = map(numbers, plants)
    assert space[0] == pytest.approx(3.676, abs=0.004)  # as at 1 ms
    assert plane[0] == pytest.approx(space[0], rel=0.02)


def test_impact_rotation_follows_directional_mass() -> None:
    plants = both(
        replace(HEAVY, net_buoyancy_n=0.0), Pool(), position_m=(11.5, 0.0, -2.0), attitude_rad=(0.0, 0.6, 0.0),
        velocity_mps=(0.8, 0.0, 0.0),
    )  # fmt: skip
    go(plants, 0.9)
    space, plane = map(numbers, plants)
    assert plane[5] == pytest.approx(space[5], abs=0.15)
    assert abs(space[5]) > 0.3
    assert plane[:3] == pytest.approx(space[:3], abs=0.02)


@pytest.mark.parametrize(("z_m", "is_through"), [(-2.0, True), (-2.5, False), (-2.45, False)])
def test_gate_passage_and_bar_contact_are_equal_in_both(z_m: float, is_through: bool) -> None:
    pool = Pool(gates=(Gate("gate", (2.0, 0.0, -2.0)),))
    plants = both(weightless(HEAVY), pool, position_m=(1.2, 0.0, z_m))
    go(plants, 5.0, at([15.0, 0.0, 0.0]))
    space, plane = map(numbers, plants)
    assert (plane[0] > 2.3) == is_through
    assert (plants[1].contact_n is None) == is_through
    assert plane == pytest.approx(space, abs=0.02)


# -- as a plant -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("z_m", [-1.5, 0.02, -3.87], ids=["in the water", "at the surface", "on the floor"])
def test_urov_2d_implements_plant_with_inputs_and_outputs_of_urov(z_m: float) -> None:
    def make(kind: type[Urov]) -> Urov:
        return kind(HEAVY, Pool(), lambda seed: Dive(position_m=(0.1 * seed, 0.0, z_m)), Propulsion(8))

    check_plant(lambda: make(Urov2D), {"pwm": PULSES})
    space, plane = make(Urov), make(Urov2D)
    assert plane.engine.startswith("pymunk 7")
    assert (plane.inputs, plane.outputs) == (space.inputs, space.outputs)
    assert set(plane.scene()["statics"]) == set(space.scene()["statics"])
    assert set(plane.truth()["values"]) == set(space.truth()["values"])


def test_pulses_and_readings_are_equal_in_both() -> None:
    dive = Dive(position_m=(0.0, 0.0, -2.0), faults=(ThrusterFault(3.0, 4, "weak"),))
    space, plane = (kind(HEAVY, Pool(), lambda seed: dive, Propulsion(8)) for kind in (Urov, Urov2D))
    for i in range(1000):
        for plant in (space, plane):
            plant.write("pwm", PULSES if i > 400 else PwmCommand())
            plant.step(0.005)
    # The weak one makes the vehicle in space roll and drift aside a little; the plane holds it.
    assert numbers(plane) == pytest.approx(numbers(space), abs=0.05)
    assert plane.position_m[0] > 0.1
    assert plane.read("power") == space.read("power")
    assert plane.read("depth").depth_m == pytest.approx(space.read("depth").depth_m, abs=0.02)
    assert plane.read("altitude").altitude_m == pytest.approx(space.read("altitude").altitude_m, abs=0.05)
    json.dumps(plane.truth())


def test_snapshot_in_contact_continues_bitwise_in_another_plant() -> None:
    def start(seed: int) -> Dive:
        return Dive(position_m=(12.1, 0.3 * seed, -3.8), velocity_mps=(0.4, 0.0, -0.3))

    one, other = (Urov2D(HEAVY, Pool(), start, seed=seed) for seed in (0, 1))
    go([one, one], 0.25, at([20.0, 0.0, -30.0]))
    assert one.contact_n is not None
    held = one.snapshot()

    def go_on(plant: Urov2D) -> list[object]:
        plant.restore(held)
        states: list[object] = []
        for _ in range(200):
            plant.step(0.005)
            states.append((plant.truth(), plant.read("imu"), plant.contact_n))
        return states

    first = go_on(one)
    assert go_on(one) == first
    assert go_on(other) == first


def test_out_of_plane_parts_of_dive_are_ignored() -> None:
    dive = in_plane(
        Dive(
            (1.0, 2.0, -3.0), (0.3, 0.2, 1.0), (0.1, 0.2, 0.3), (0.4, 0.5, 0.6),
            currents=(Current(0.0, (0.3, 0.2, 0.1)),), leak=Leak(1.0, 0.1, position_m=(0.1, 0.1, 0.1)),
            tether=Tether((4.0, 5.0, 6.0), attachment_m=(0.1, 0.2, 0.3)),
        )
    )  # fmt: skip
    assert dive.attitude_rad == (0.0, 0.2, 0.0)
    assert (dive.velocity_mps, dive.rate_radps) == ((0.1, 0.0, 0.3), (0.0, 0.5, 0.0))
    assert dive.current_at(1.0) == (0.3, 0.0, 0.1)
    assert dive.tether is not None
    assert dive.tether.anchor_m == (4.0, 2.0, 6.0)
    plant = Urov2D(HEAVY, Pool(), lambda seed: dive)
    go([plant, plant], 5.0, at([10.0, 10.0, 5.0], [1.0, 0.02, 1.0]))
    assert plant.position_m[1] == 2.0
    roll, _, yaw = roll_pitch_yaw_rad(plant.attitude)
    assert (roll, yaw) == (0.0, 0.0)


@pytest.mark.parametrize("force", [1e9, 1e200, math.inf])
def test_wrench_too_large_for_step_raises_with_velocities(force: float) -> None:
    plant = both()[1]
    plant._drive.wrench = (force, 0.0, 0.0, 0.0, 0.0, 0.0)  # `write` would not take infinity
    with pytest.raises(PlantError, match=r"^At surge 0, sway 0, .* a step of 0\.005 s is too long"):
        plant.step(0.005)


def test_extreme_drag_still_converges() -> None:
    plant = both(replace(HEAVY, net_buoyancy_n=0.0))[1]
    go([plant, plant], 2.0, at([1e5, 0.0, 0.0]))
    terminal = (math.sqrt(13.7**2 + 4.0 * 141.0 * 1e5) - 13.7) / 282.0
    assert plant.through_water[0] == pytest.approx(terminal, rel=1e-4)
