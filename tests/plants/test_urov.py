import itertools
import json
import math
import random
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from snr_sim.plants.attitude import rotation_of
from snr_sim.plants.urov.dive import Current, Dive, Leak, Payload, ThrusterFault
from snr_sim.plants.urov.pool import FRICTION, POST_M, Gate, Pool
from snr_sim.plants.urov.propulsion import Propulsion
from snr_sim.plants.urov.tether import Tether
from snr_sim.plants.urov.urov import Urov
from snr_sim.plants.urov.urov_state import WrenchCommand
from snr_sim.plants.urov.vehicle import Vehicle
from snr_sim.plants.urov.vehicle_file import read_vehicle
from snr_sim.prelude.errors import CommandError, ParameterError, PlantError, UnknownNameError
from snr_sim.prelude.signals import PwmCommand
from snr_sim.testing.contracts import check_plant
from tests.plants.vehicles import HEAVY, VEHICLES

SEA = Pool(2000.0, 2000.0, 200.0)  # nothing in reach
WRENCH = WrenchCommand([10.0, 2.0, 3.0], [0.1, 0.2, 0.3])
PULSES = PwmCommand([1600.0, 1620.0, 1400.0, 1410.0, 1550.0, 1500.0, 1450.0, 1700.0])


def make_urov(vehicle: Vehicle = HEAVY, pool: Pool = SEA, step_s: float = 0.005, **how: object) -> Urov:
    """A vehicle in deep water; `how` it begins is as in Dive."""
    dive = Dive(**{"position_m": (0.0, 0.0, -50.0), **how})  # type: ignore[arg-type]
    return Urov(vehicle, pool, lambda seed: dive, step_s=step_s)


def undamped(vehicle: Vehicle) -> Vehicle:
    return replace(vehicle, linear_damping=(0.0,) * 6, quadratic_damping=(0.0,) * 6)


def go(plant: Urov, time_s: float, force_n: Sequence[float] = (0.0, 0.0, 0.0)) -> Urov:
    plant.write("wrench", WrenchCommand(list(force_n)))
    for _ in range(round(time_s / plant.step_s)):
        plant.step(plant.step_s)
    return plant


@pytest.mark.parametrize("z_m", [-1.5, 0.02, -3.87], ids=["in the water", "at the surface", "on the floor"])
def test_urov_implements_plant(z_m: float) -> None:
    def start(seed: int) -> Dive:
        return Dive(
            (0.1 * seed, 0.0, z_m),
            currents=(Current(0.05, (0.1, 0.2, 0.0)),),
            loads=(Payload(1.0, 0.0001, (0.0, 0.1, 0.0), end_s=0.06),),
            leak=Leak(0.02, 5.0),
            tether=Tether((0.0, 0.0, 0.0), 5.0),
        )

    check_plant(lambda: Urov(HEAVY, Pool(), start), {"wrench": WRENCH})
    check_plant(lambda: Urov(HEAVY, Pool(), start, Propulsion(8)), {"pwm": PULSES})


def test_scene_and_truth_are_json() -> None:
    plant = Urov(HEAVY, Pool(), lambda seed: Dive(tether=Tether((0.0, 0.0, 0.0))), Propulsion(8))
    plant.step(plant.step_s)
    assert json.loads(json.dumps(plant.scene())) == plant.scene()
    truth = plant.truth()
    assert json.loads(json.dumps(truth)) == truth
    assert {"T1", "T8", "tether"} <= set(truth["vectors"])
    assert plant.scene()["tethers"]["tether"]["anchor_m"] == [0.0, 0.0, 0.0]
    assert "tethers" not in Urov(HEAVY, Pool(), lambda seed: Dive()).scene()


def test_truth_contains_faults_leaked_water_and_load() -> None:
    def start(seed: int) -> Dive:
        faults = (ThrusterFault(0.1, 3, "off"), ThrusterFault(0.2, 3, "none"), ThrusterFault(0.2, 4, "weak"))
        return Dive(loads=(Payload(0.5, end_s=0.1),), leak=Leak(0.1, rate_lps=1.0), faults=faults)

    plant = Urov(HEAVY, Pool(), start, Propulsion(8))
    seen = []
    for _ in range(4):
        values = plant.truth()["values"]
        seen.append([values[name] for name in ("broken_T4", "broken_T5", "load_kg", "water_l")])
        for _ in range(round(0.1 / plant.step_s)):
            plant.step(plant.step_s)
    assert [flags[:3] for flags in seen] == [[0, 0, 0.5], [1, 0, 0], [0, 1, 0], [0, 1, 0]]
    assert [flags[3] for flags in seen] == pytest.approx(
        [0.0, 0.0, 0.1, 0.2], abs=0.011
    )  # it is weighed by centilitres
    assert not {"load_kg", "water_l", "broken_T4"} & set(make_urov(HEAVY).truth()["values"])


def test_invalid_input_raises_with_message() -> None:
    with pytest.raises(ParameterError, match="which is not in the pool"):
        Urov(HEAVY, Pool(depth_m=3.0), lambda seed: Dive((0.0, 0.0, -3.5)))
    with pytest.raises(ParameterError, match="has 8 thrusters, its propulsion 6"):
        Urov(HEAVY, Pool(), lambda seed: Dive(), Propulsion(6))
    with pytest.raises(ParameterError, match=r"in steps of 0\.0 s"):
        make_urov(step_s=0.0)
    plant = make_urov()
    with pytest.raises(ParameterError, match=r"steps of 0\.005 s, not 0\.01 s"):
        plant.step(0.01)
    with pytest.raises(UnknownNameError, match="no input 'pwm'"):
        plant.write("pwm", PULSES)
    with pytest.raises(UnknownNameError, match="no output 'power'"):
        plant.read("power")
    with pytest.raises(CommandError, match="six finite numbers"):
        plant.write("wrench", WrenchCommand([math.nan, 0.0, 0.0]))
    with pytest.raises(CommandError, match="x, y and z of force_n"):
        plant.write("wrench", WrenchCommand([0.0] * 2, [0.0] * 4))
    with pytest.raises(CommandError, match=r"an invalid command: \{'force_n': 3\}"):
        plant.write("wrench", {"force_n": 3})
    with pytest.raises(ParameterError, match="not nan s"):
        plant.step(math.nan)


def test_diverging_state_raises_with_velocities(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(PlantError, match=r"^At surge 0, sway 0, .* a step of 0\.005 s is too long"):
        go(make_urov(), 1.0, (1e9, 0.0, 0.0))
    on_the_floor = make_urov(pool=Pool(), position_m=(0.0, 0.0, -3.88))
    with pytest.raises(PlantError, match=r"At 0 s the acceleration in heave is no longer finite; .* surge 0, "):
        go(on_the_floor, 1.0, (0.0, 0.0, -1e12))
    assert list(tmp_path.iterdir()) == []  # MuJoCo has not seen it, and wrote no log


# -- the surface ------------------------------------------------------------------------------------------------------


def test_vehicle_in_air_falls_freely() -> None:
    plant = go(make_urov(position_m=(0.0, 0.0, 5.0), rate_radps=(0.1, 0.2, 0.3)), 0.5)
    assert plant.velocity_mps[2] == pytest.approx(-9.81 * 0.5)
    assert plant.read("imu").specific_force_mps2 == pytest.approx([0.0, 0.0, 0.0], abs=1e-4)
    assert plant.mass_matrix[0, 0] == pytest.approx(plant.vehicle.mass_kg)


@pytest.mark.parametrize("step_s", [0.002, 0.005, 0.01])
def test_water_entry_and_exit_do_not_gain_energy(step_s: float) -> None:
    """Weight and buoyancy are the only energy there is; the surface takes some and gives none."""
    plant = make_urov(undamped(HEAVY), step_s=step_s, position_m=(0.0, 0.0, 0.6))
    vehicle, weight = plant.vehicle, 9.81 * plant.vehicle.mass_kg
    height, centre = vehicle.size_m[2], vehicle.centre_of_buoyancy_m[2]

    def energy() -> float:
        z = plant.position_m[2]
        under = min(1.0, max(0.0, 0.5 - (z + centre) / height))
        # The work of buoyancy down to here: it grows with the wet share, then stays.
        floated = (weight + 1.5) * (0.5 * height * under * under + max(0.0, -(z + centre) - 0.5 * height))
        return plant.kinetic_energy_j + weight * z + floated

    before = at_first = energy()
    crossings, was_under = 0, False
    for _ in range(round(6.0 / step_s)):
        plant.step(step_s)
        now = energy()
        assert now <= before + 2e-3 * at_first
        crossings += was_under != (plant.position_m[2] < 0.0)
        was_under, before = plant.position_m[2] < 0.0, min(before, now)
    assert crossings >= 1
    assert before < 0.8 * at_first  # the splash cost something


def test_floating_vehicle_displaces_its_weight() -> None:
    light = replace(HEAVY, mass_kg=13.4 - 60.0 / 9.81, net_buoyancy_n=None)
    plant = go(make_urov(light, position_m=(0.0, 0.0, -0.1), attitude_rad=(0.1, 0.05, 0.0)), 60.0)
    share = 1.0 - 60.0 / (9810.0 * light.volume_m3)
    height = (0.5 - share) * light.size_m[2] - light.centre_of_buoyancy_m[2]
    assert plant.position_m[2] == pytest.approx(height, abs=1e-3)
    assert plant.truth()["values"]["roll_rad"] == pytest.approx(0.0, abs=math.radians(0.5))


def test_depth_and_pressure_follow_position() -> None:
    deep, high = (
        make_urov().read("depth"),
        make_urov(position_m=(0.0, 0.0, 0.4), velocity_mps=(0.0, 0.0, 0.2)).read("depth"),
    )
    assert (deep.depth_m, deep.pressure_pa) == (50.0, pytest.approx(101_325.0 + 9810.0 * 50.0))
    assert (high.depth_m, high.sink_mps, high.pressure_pa) == (-0.4, -0.2, 101_325.0)


# -- attitude and energy ----------------------------------------------------------------------------------------------


def test_upside_down_vehicle_rights_itself() -> None:
    plant = go(make_urov(attitude_rad=(3.1, 0.0, 0.0)), 60.0)
    assert abs(plant.truth()["values"]["roll_rad"]) < math.radians(2.0)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("step_s", [0.002, 0.01])
def test_drag_only_removes_energy(seed: int, step_s: float) -> None:
    rng = random.Random(seed)
    vehicle = replace(HEAVY, net_buoyancy_n=0.0)
    plant = make_urov(
        vehicle,
        step_s=step_s,
        attitude_rad=tuple(rng.uniform(-3.0, 3.0) for _ in range(3)),
        velocity_mps=tuple(rng.uniform(-1.0, 1.0) for _ in range(3)),
        rate_radps=tuple(rng.uniform(-2.0, 2.0) for _ in range(3)),
    )
    stiffness = 9810.0 * vehicle.volume_m3 * vehicle.centre_of_buoyancy_m[2]

    def energy() -> float:
        return plant.kinetic_energy_j - stiffness * rotation_of(plant.attitude)[8]

    before = energy()
    for _ in range(round(5.0 / step_s)):
        plant.step(step_s)
        now = energy()
        assert now <= before + 1e-9
        before = now


def test_error_is_second_order_in_step() -> None:
    def depth_speed(step_s: float) -> float:
        return go(make_urov(replace(HEAVY, net_buoyancy_n=0.0), step_s=step_s), 1.0, (25.0, 10.0, 40.0)).through_water[
            2
        ]

    exact = depth_speed(0.0005)
    errors = [depth_speed(step_s) - exact for step_s in (0.02, 0.01, 0.005)]
    assert [math.log2(a / b) for a, b in itertools.pairwise(errors)] == pytest.approx([2.0, 2.0], abs=0.15)


# -- floor, walls, gates ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("step_s", [0.002, 0.005, 0.01])
def test_fast_sliding_vehicle_stays_on_floor(step_s: float) -> None:
    """MuJoCo gave as pressure what it could not give as friction: the vehicle hopped, pressing from 0 to five times."""
    wu = read_vehicle(VEHICLES / "wu2018.toml")
    lead = Payload(3.0, 3.0 * 0.000088)
    plant = go(make_urov(wu, Pool(), step_s, position_m=(-9.0, 0.0, -3.873), loads=(lead,)), 1.0)
    go(plant, 3.0, (40.0, 0.0, 0.0))
    assert plant.velocity_mps[0] > 1.0
    presses = 9.81 * (3.0 - 0.264) - 1.5
    for _ in range(round(0.5 / step_s)):
        plant.step(step_s)
        along, _, up = plant.contact_n or (0.0, 0.0, 0.0)
        assert up == pytest.approx(presses, rel=0.02)
        assert along == pytest.approx(-FRICTION * up, rel=1e-3)


def test_wall_contact_balances_sideways_force() -> None:
    plant = go(make_urov(pool=Pool(), position_m=(0.0, 5.9, -2.0)), 5.0, (0.0, 40.0, 0.0))
    assert plant.contact_n == pytest.approx((0.0, -40.0, -1.5), abs=0.1)  # friction holds the buoyancy, too
    corner = go(make_urov(pool=Pool(), position_m=(12.1, 5.95, -3.8)), 10.0, (40.0, 40.0, -40.0))
    assert corner.contact_n == pytest.approx((-40.0, -40.0, -1.5 + 40.0), abs=0.1)


@pytest.mark.parametrize("step_s", [0.002, 0.005, 0.01])
def test_oblique_impact_changes_total_momentum_by_impulse(step_s: float) -> None:
    """Also for added mass that differs by axis, at an attitude where its world matrix is full."""
    vehicle = undamped(replace(HEAVY, net_buoyancy_n=0.0, centre_of_buoyancy_m=(0.0, 0.0, 0.0)))
    plant = make_urov(
        vehicle, Pool(), step_s, position_m=(0.0, 5.4, -2.0), attitude_rad=(0.8, 0.3, 0.5), velocity_mps=(0.1, 0.6, 0.1)
    )

    def momentum() -> list[float]:
        linear = (plant.mass_matrix @ plant.through_water)[:3].tolist()
        r = rotation_of(plant.attitude)
        return [sum(r[3 * i + j] * linear[j] for j in range(3)) for i in range(3)]

    before, impulse = momentum(), [0.0, 0.0, 0.0]
    for _ in range(round(1.5 / step_s)):
        plant.step(step_s)
        impulse = [a + step_s * b for a, b in zip(impulse, plant.contact_n or (0.0, 0.0, 0.0), strict=True)]
    change = [a - b for a, b in zip(momentum(), before, strict=True)]
    assert change[1] < -5.0  # it came back
    # In contact the water's forces are those of the begin of a part: first order in the part, whatever the step.
    assert change == pytest.approx(impulse, abs=0.02)


def test_gate_passes_centred_vehicle_and_stops_others() -> None:
    pool = Pool(gates=(Gate("red", (1.0, 0.0, -2.0)),))
    middle = go(make_urov(replace(HEAVY, net_buoyancy_n=0.0), pool, position_m=(0.0, 0.0, -2.0)), 8.0, (20.0, 0.0, 0.0))
    assert middle.position_m[0] > 2.0
    post = go(make_urov(replace(HEAVY, net_buoyancy_n=0.0), pool, position_m=(0.0, 0.75, -2.0)), 8.0, (20.0, 0.0, 0.0))
    assert post.contact_n == pytest.approx((-20.0, 0.0, 0.0), abs=0.05)
    assert "red" in post.scene()["statics"]


def test_skipped_contact_detection_changes_no_bit() -> None:
    """In a world given as MJCF, without a known pool, MuJoCo checks for contacts at every step."""
    pool = Pool(gates=(Gate("red", (2.0, 0.3, -2.0)),))
    dive = Dive((-2.0, 0.0, -2.6), attitude_rad=(0.0, 0.2, 0.1))
    looks, without = [0, 0], [0, 0]  # all, and those of steps in which nothing touches
    plants = [
        Urov(HEAVY, pool, lambda seed: dive, mjcf=mjcf) for mjcf in (None, pool.mjcf(HEAVY.trimmed(1000.0, 9.81)))
    ]
    for i, plant in enumerate(plants):

        def detect_contacts(i: int = i, detect_contacts: Callable[[], bool] = plant._body.detect_contacts) -> bool:
            looks[i] += 1
            return detect_contacts()

        plant._body.detect_contacts = detect_contacts  # type: ignore[method-assign]
    touched = 0
    for plant in plants:
        go(plant, plant.step_s)  # with the first contact check
    for step in range(2400):
        wrench = WrenchCommand([0.0, 0.0, -40.0] if step > 1000 else [10.0, 0.0, 1.0], [0.0, 0.0, 0.02])
        for i, plant in enumerate(plants):
            plant.write("wrench", wrench)
            before = looks[i]
            plant.step(plant.step_s)
            without[i] += looks[i] - before if plant.contact_n is None else 0
        one, other = plants
        assert (one.position_m, one.attitude, one.velocity_mps) == (
            other.position_m,
            other.attitude,
            other.velocity_mps,
        )
        assert one.contact_n == other.contact_n
        touched += one.contact_n is not None
    assert touched > 100
    assert 0 <= without[1] - (2400 - touched) < 10  # the step in which it lands has more, and no contact before its end
    assert without[0] < 0.6 * without[1]
    assert one.snapshot().mujoco.tolist()[:14] == other.snapshot().mujoco.tolist()[:14]


def test_echo_sounder_measures_floor_and_gate() -> None:
    pool = Pool(gates=(Gate("red", (2.0, 0.0, -3.0), height_m=0.5),))
    bottom = 0.5 * HEAVY.size_m[2]
    assert make_urov(pool=pool, position_m=(0.0, 0.0, -1.0)).read("altitude").altitude_m == pytest.approx(3.0 - bottom)
    over_bar = make_urov(pool=pool, position_m=(2.0, 0.0, -1.0)).read("altitude")
    assert over_bar.altitude_m == pytest.approx(2.0 - 0.25 - POST_M - bottom)
    tilted = make_urov(pool=pool, position_m=(0.0, 0.0, -1.0), attitude_rad=(0.3, 0.0, 0.0)).read("altitude")
    assert tilted.altitude_m == pytest.approx(3.0 - bottom * math.cos(0.3))
    assert tilted.tilt_rad == pytest.approx(0.3)
    pressed = go(make_urov(pool=pool, position_m=(0.0, 0.0, -3.87)), 2.0, (0.0, 0.0, -100.0))
    assert pressed.read("altitude").altitude_m == pytest.approx(0.0, abs=1e-3)


# -- by the clock -----------------------------------------------------------------------------------------------------


def test_payload_acts_at_its_position_until_release() -> None:
    lead = Payload(0.5, 0.0, (0.1, 0.0, -0.1), end_s=60.0)
    plant = go(make_urov(replace(HEAVY, net_buoyancy_n=9.81 * 0.5), loads=(lead,)), 59.0)
    assert plant.velocity_mps == pytest.approx((0.0, 0.0, 0.0), abs=2e-3)  # the load makes it neutral
    # The line from the load to the centre of buoyancy hangs plumb, but for the vehicle's own weight at the origin.
    stiffness = 9810.0 * HEAVY.volume_m3 * 0.01 + 9.81 * 0.5 * 0.1
    assert plant.truth()["values"]["pitch_rad"] == pytest.approx(math.atan(9.81 * 0.05 / stiffness), abs=0.002)
    go(plant, 1.5)
    assert plant.velocity_mps[2] > 0.05
    assert plant.mass_matrix[0, 0] == pytest.approx(plant.vehicle.mass_kg + 6.3567)


def test_payload_released_in_air_leaves_dry_mass() -> None:
    plant = make_urov(position_m=(0.0, 0.0, 5.0), loads=(Payload(1.0, end_s=0.1),))
    assert plant.mass_matrix[0, 0] == pytest.approx(plant.vehicle.mass_kg + 1.0)
    go(plant, 0.2)
    assert plant.mass_matrix[0, 0] == pytest.approx(plant.vehicle.mass_kg)
    in_the_air = plant.snapshot()
    go(plant, 3.0)
    plant.restore(in_the_air)
    assert plant.mass_matrix[0, 0] == pytest.approx(plant.vehicle.mass_kg)


def test_leak_adds_weight_until_hull_is_full() -> None:
    plant = go(make_urov(leak=Leak(1.0, 0.1, max_l=0.5)), 2.0)
    assert plant.read("leak").water_l == pytest.approx(0.1, abs=0.011)
    go(plant, 20.0)
    assert plant.read("leak").water_l == 0.5
    assert plant.mass_matrix[0, 0] == pytest.approx(plant.vehicle.mass_kg + 6.3567 + 0.5)
    drag = 9.81 * 0.5 - 1.5
    sinking = (math.sqrt(33.0**2 + 4.0 * 190.0 * drag) - 33.0) / 380.0
    assert plant.velocity_mps[2] == pytest.approx(-sinking, rel=1e-3)


def test_current_change_keeps_speed_over_ground() -> None:
    plant = make_urov(currents=(Current(0.0, (0.2, 0.0, 0.0)), Current(20.0, (0.0, 0.3, 0.0))))
    go(plant, 20.0)
    assert plant.velocity_mps[0] == pytest.approx(0.2, rel=0.01)
    go(plant, 0.01)
    assert plant.velocity_mps[0] == pytest.approx(0.2, rel=0.03)
    assert plant.through_water[1] < -0.28


def test_tether_limits_distance() -> None:
    plant = make_urov(
        replace(HEAVY, net_buoyancy_n=0.0),
        pool=Pool(),
        position_m=(0.0, 0.0, -2.0),
        tether=Tether((0.0, 0.0, -2.0), 5.0),
    )
    far = max(math.hypot(go(plant, 0.1, (60.0, 0.0, 0.0)).position_m[0], plant.position_m[2] + 2.0) for _ in range(400))
    assert 5.0 < far < 5.0 + 0.25 + 2.0 * 60.0 / Tether((0.0, 0.0, 0.0), 5.0).stiffness_npm


def test_thruster_fault_starts_at_its_time() -> None:
    dive = Dive((0.0, 0.0, -2.0), faults=(ThrusterFault(3.0, 0, "off"),))
    plant = Urov(HEAVY, Pool(), lambda seed: dive, Propulsion(8))
    plant.write("pwm", PwmCommand())
    for i in range(700):
        if i == 400:
            plant.write("pwm", PwmCommand([1600.0] * 8))
        plant.step(plant.step_s)
        if i == 590:
            assert plant.thrusters.forces_n[0] > 1.0
    assert abs(plant.thrusters.forces_n[0]) < 0.01
    assert plant.thrusters.forces_n[1] > 1.0
    with pytest.raises(ParameterError, match="there are none"):
        Urov(HEAVY, Pool(), lambda seed: dive)


# -- sensors ----------------------------------------------------------------------------------------------------------


def test_imu_at_rest_measures_gravity_and_magnetic_field() -> None:
    plant = make_urov(replace(HEAVY, net_buoyancy_n=0.0))
    imu = plant.read("imu")
    assert imu.specific_force_mps2 == pytest.approx([0.0, 0.0, 9.81], abs=1e-9)
    assert imu.field_ut == pytest.approx([0.0, 20.0, -44.0])
    north = make_urov(attitude_rad=(0.0, 0.0, math.radians(90.0))).read("imu")
    assert north.field_ut == pytest.approx([20.0, 0.0, -44.0])  # heads north: the field is ahead
    on_its_side = make_urov(attitude_rad=(math.radians(90.0), 0.0, 0.0)).read("imu")
    assert on_its_side.specific_force_mps2[1] == pytest.approx(9.81, rel=0.02)  # its left side is up


def test_imu_measures_thrust_from_first_step() -> None:
    plant = go(make_urov(replace(HEAVY, net_buoyancy_n=0.0)), 0.005, (40.0, 0.0, 0.0))
    mass = plant.vehicle.mass_kg + 6.3567
    assert plant.read("imu").specific_force_mps2[0] == pytest.approx(40.0 / mass, rel=0.01)


# -- thrusters --------------------------------------------------------------------------------------------------------


def test_forward_thrust_gives_surge_and_nose_up_pitch() -> None:
    """The front pair ahead, the rear pair astern: all of them push along x, 8.5 cm under the centre."""
    dive = Dive((0.0, 0.0, -2.0))
    plant = Urov(HEAVY, Pool(), lambda seed: dive, Propulsion(8))
    plant.write("pwm", PwmCommand())
    for i in range(600):
        if i == 400:
            plant.write("pwm", PwmCommand([1600.0, 1600.0, 1400.0, 1400.0] + [1500.0] * 4))
        plant.step(plant.step_s)
    assert plant.through_water[0] > 0.1
    assert abs(plant.through_water[1]) < 1e-6
    assert plant.truth()["values"]["pitch_rad"] < math.radians(-1.0)  # negative is nose up
    assert plant.read("power").current_a > 2.0


def test_propellers_in_air_give_no_thrust() -> None:
    plant = Urov(HEAVY, Pool(), lambda seed: Dive((0.0, 0.0, -0.5)), Propulsion(8))
    plant.write("pwm", PwmCommand())
    for _ in range(400):
        plant.step(plant.step_s)
    plant.write("pwm", PwmCommand([1700.0] * 4 + [1500.0] * 4))
    for _ in range(40):
        plant.step(plant.step_s)
    state = plant.snapshot()
    plant.restore(state._replace(position=(0.0, 0.0, 0.6), velocity=(0.0, 0.0, 0.0), rate=(0.0, 0.0, 0.0)))
    plant.step(plant.step_s)
    assert max(plant.thrusters.forces_n) > 10.0
    assert plant.read("imu").specific_force_mps2 == pytest.approx([0.0, 0.0, 0.0], abs=1e-9)


def test_invalid_pulses_raise() -> None:
    plant = Urov(HEAVY, Pool(), lambda seed: Dive(), Propulsion(8))
    for pulses in ([1500.0] * 7, [math.nan] + [1500.0] * 7):
        with pytest.raises(CommandError, match="8 thrusters were sent the pulses"):
            plant.write("pwm", PwmCommand(pulses))
    for command in (None, [1500.0] * 8, PwmCommand(["1500"] * 8), PwmCommand(1500.0)):  # type: ignore[arg-type, list-item]
        with pytest.raises(CommandError, match="At 0 s the vehicle got an invalid command") as caught:
            plant.write("pwm", command)
        assert caught.value.fix == "send a PwmCommand of numbers."
    plant.step(plant.step_s)
    for pulse in (0.5, 2500.0):
        with pytest.raises(CommandError, match=rf"At 0\.005 s thruster 'T2' was sent a pulse of {pulse} us"):
            plant.write("pwm", PwmCommand([1500.0, pulse] + [1500.0] * 6))
    with pytest.raises(CommandError, match="until nan s"):
        plant.write("pwm", PwmCommand([1500.0] * 8, until_s=math.nan))


def test_extreme_drag_still_converges() -> None:
    plant = go(make_urov(replace(HEAVY, net_buoyancy_n=0.0)), 5.0, (1e5, 0.0, 0.0))
    terminal = (math.sqrt(13.7**2 + 4.0 * 141.0 * 1e5) - 13.7) / 282.0
    assert plant.through_water[0] == pytest.approx(terminal, rel=1e-4)
    dropped = go(make_urov(position_m=(0.0, 0.0, 50.0), attitude_rad=(0.3, 0.2, 0.0)), 20.0)
    assert -2.0 < dropped.position_m[2] < 0.0


# -- other worlds, other processes ------------------------------------------------------------------------------------


def test_other_body_in_user_world_keeps_vehicle_motion() -> None:
    pool = Pool()
    ball = '<body pos="3 0 -1"><freejoint/><geom size="0.1"/></body></worldbody>'
    text = pool.mjcf(HEAVY.trimmed(1000.0, 9.81)).replace("</worldbody>", ball)
    dive = Dive((0.0, 0.0, -2.0))
    crowded = go(Urov(HEAVY, pool, lambda seed: dive, mjcf=text), 0.7, (20.0, 5.0, 3.0))
    alone = go(Urov(HEAVY, pool, lambda seed: dive), 0.7, (20.0, 5.0, 3.0))
    assert crowded.position_m == pytest.approx(alone.position_m, abs=1e-12)
    fallen = crowded._body._data.qpos[9]
    assert fallen == pytest.approx(-1.0 - 0.5 * 9.81 * 0.7**2, abs=0.03)  # MuJoCo has moved the ball by itself


def test_step_undone_for_contact_is_undone_for_other_bodies() -> None:
    pool = Pool()
    ball = '<body pos="3 0 -1"><freejoint/><geom size="0.1"/></body></worldbody>'
    text = pool.mjcf(HEAVY.trimmed(1000.0, 9.81)).replace("</worldbody>", ball)
    dive = Dive((0.0, 0.0, -3.8))
    crowded = go(Urov(HEAVY, pool, lambda seed: dive, mjcf=text), 0.7, (0.0, 0.0, -60.0))
    alone = go(Urov(HEAVY, pool, lambda seed: dive), 0.7, (0.0, 0.0, -60.0))
    assert crowded.contact_n is not None
    assert crowded.position_m == pytest.approx(alone.position_m, abs=1e-9)
    assert crowded._body._data.time == pytest.approx(0.7, abs=1e-9)  # no step counts twice
    assert crowded._body._data.qpos[9] == pytest.approx(-1.0 - 0.5 * 9.81 * 0.7**2, abs=0.03)


@pytest.mark.parametrize("after", [100, 340, 700, 1150], ids=["swimming", "landing", "on the floor", "in flight"])
def test_state_restored_in_equal_vehicle_continues_bitwise(after: int) -> None:
    """The thrusters cached sums of forces by the matrix of their vehicle, and recomputed them for another matrix."""
    dive = Dive(
        (0.0, 0.0, -1.0),
        currents=(Current(0.0, (0.3, 0.2, 0.0)),),
        loads=(Payload(2.0, 0.0003, (0.0, 0.0, -0.1), end_s=4.0),),
        tether=Tether((0.0, 0.0, 0.0), 1.6),
    )

    def on(plant: Urov, begin: int, steps: int) -> list[object]:
        seen = []
        for i in range(begin, begin + steps):
            if i % 4 == 0:
                up = [1500.0 + 60.0 * math.sin(0.01 * i + j) + (80.0 if j > 3 else 0.0) for j in range(8)]
                plant.write("pwm", PwmCommand(up if i > 250 else [1500.0] * 8))
            plant.step(plant.step_s)
            seen.append((plant.snapshot()[1:5], plant.contact_n, plant.read("imu"), plant.read("power")))
        return seen

    one, other = (Urov(HEAVY, Pool(3.0, 3.0, 1.5), lambda seed: dive, Propulsion(8)) for _ in range(2))
    on(one, 0, after)
    other.restore(one.snapshot())
    assert on(one, after, 400) == on(other, after, 400)


def test_world_without_vehicle_raises() -> None:
    with pytest.raises(ParameterError, match="no body 'vehicle' in the MJCF"):
        Urov(HEAVY, Pool(), lambda seed: Dive(), mjcf="<mujoco/>")
    with pytest.raises(ParameterError, match="MuJoCo cannot read the MJCF"):
        Urov(HEAVY, Pool(), lambda seed: Dive(), mjcf="<mujoco><worldbody>")


@pytest.mark.slow
def test_another_process_gives_equal_bits() -> None:
    program = (
        "import sys; sys.path.insert(0, sys.argv[1]); import importlib.util as u;"
        "s = u.spec_from_file_location('t', sys.argv[2]); m = u.module_from_spec(s); s.loader.exec_module(m);"
        "print(m.fingerprint())"
    )
    other = subprocess.run(
        [sys.executable, "-c", program, str(Path(__file__).parent), __file__],
        capture_output=True,
        text=True,
        check=True,
    )
    assert other.stdout.strip() == fingerprint()


def fingerprint() -> str:
    """Where a busy dive leads to, with every bit: thrusters, current, tether, load, floor."""
    dive = Dive(
        (0.0, 0.0, -3.8),
        currents=(Current(0.5, (0.2, 0.1, 0.0)),),
        loads=(Payload(2.0, 0.0001, end_s=4.0),),
        tether=Tether((0.0, 0.0, 0.0), 6.0),
    )
    plant = Urov(HEAVY, Pool(), lambda seed: dive, Propulsion(8))
    plant.write("pwm", PwmCommand())
    for i in range(1500):
        if i == 400:
            plant.write("pwm", PULSES)
        plant.step(plant.step_s)
    numbers = [*plant.position_m, *plant.attitude, *plant.velocity_mps, *plant.rate_radps]
    return " ".join(value.hex() for value in numbers)
