"""Explorer and dozer in the rover's plant: they have the numbers of their planar plants, and drive as those do."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from snr_sim.plants.battery import BatteryPack
from snr_sim.plants.ground.dozer import Dozer
from snr_sim.plants.ground.explorer import Explorer
from snr_sim.plants.ground.height_map import flat, make_hills
from snr_sim.plants.ground.planar_vehicles import NOMINAL_CELL_V, dozer_rover, explorer_rover
from snr_sim.plants.ground.rover import Rover, RoverStart
from snr_sim.plants.ground.rover_vehicle import RoverVehicle
from snr_sim.plants.ground.terramechanics import Coulomb
from snr_sim.prelude.errors import ParameterError, PlantError
from snr_sim.prelude.ground_signals import DriveCommand
from snr_sim.testing.contracts import check_plant

PACK = BatteryPack(cells=3, capacity_ah=2.0)
EXPLORER = Explorer(0.7, 0.0038, (0.20, 0.16), 0.08, -0.03, 0.08, 0.13, 0.028, 0.75, 0.06, 0.9, 0.3, 2.55, 0.17, 0.008)
DOZER = Dozer(12.0, 0.52, (0.60, 0.42), 0.24, 0.34, 0.40, 0.30, 0.10, 60.0, 0.8, 0.5, 0.4, 0.5)
VEHICLES: dict[str, tuple[Explorer | Dozer, RoverVehicle, float]] = {
    "explorer": (EXPLORER, explorer_rover(EXPLORER, PACK), EXPLORER.grip * EXPLORER.mass_kg * 9.80665),
    "dozer": (DOZER, dozer_rover(DOZER, PACK), DOZER.max_pull_n),
}
each = pytest.mark.parametrize("name", VEHICLES)


def made(name: str, friction: float = 0.8) -> Rover:
    return Rover(VEHICLES[name][1], flat(), lambda seed: RoverStart(heading_rad=0.1 * seed), Coulomb(friction))


def go(rover: Rover, seconds: float, mode: str, *values: float) -> Rover:
    rover.write("drive", DriveCommand(mode, list(values)))
    for _ in range(round(seconds / rover.step_s)):
        rover.step(rover.step_s)
    return rover


@each
def test_vehicle_has_mass_inertia_speed_and_pull_of_its_planar_plant(name: str) -> None:
    planar, vehicle, pull_n = VEHICLES[name]
    world = made(name)._world
    shape = len(world.data.qvel)
    matrix = np.zeros((shape, shape))  # of inertia: column by column, momentum at a unit speed
    for column, unit in zip(matrix, np.eye(shape), strict=True):
        world.mujoco.mj_mulM(world.model, world.data, column, unit)
    assert vehicle.mass_kg == pytest.approx(planar.mass_kg)
    assert matrix[0, 0] == pytest.approx(planar.mass_kg)
    assert matrix[5, 5] == pytest.approx(planar.inertia_kgm2, rel=1e-3)
    assert matrix[1, 5] == pytest.approx(0.0, abs=1e-3), "the origin is under the centre of mass"
    radius_m = vehicle.wheels[0].radius_m
    assert vehicle.motor.top_radps(3 * NOMINAL_CELL_V) * radius_m == pytest.approx(planar.full_speed_mps)
    assert vehicle.motor.limit_a * vehicle.motor.nm_per_a / radius_m == pytest.approx(pull_n)


def test_dozer_implements_plant() -> None:
    check_plant(lambda: made("dozer"), {"drive": DriveCommand("speed", [3.0, 4.0])})


@each
def test_motor_is_the_only_one_of_its_side(name: str) -> None:
    rover = made(name)
    motors = [output for output in rover.outputs if output.startswith("motor_")]
    assert motors == {"explorer": ["motor_L", "motor_R"], "dozer": ["motor_L1", "motor_R1"]}[name]


def test_wheels_on_a_chain_turn_together_and_brake_together() -> None:
    rover = go(made("dozer"), 1.0, "speed", 2.0, 4.0)
    turned = np.array([float(rover._data.joint(f"wheel_{wheel.name}").qpos[0]) for wheel in rover.vehicle.wheels])
    assert np.ptp(turned[:4]) < 0.01 > np.ptp(turned[4:])
    assert turned[4] > 1.5 * turned[0] > 1.0
    go(rover, 1.0, "brake", 9.0, 9.0)
    assert max(abs(float(rover._data.joint(f"wheel_{w.name}").qvel[0])) for w in rover.vehicle.wheels) < 0.02


def test_caster_rolls_freely_and_lets_the_explorer_turn() -> None:
    rover = go(made("explorer"), 1.5, "speed", -3.0, 3.0)
    radius_m, half_m = 0.5 * (0.028 + 0.0262), 0.065
    assert rover.read("imu").rate_radps[2] == pytest.approx(3.0 * radius_m / half_m, rel=0.01)


@each
def test_vehicle_climbs_hills_and_stays_upright(name: str) -> None:
    rover = Rover(VEHICLES[name][1], make_hills(3, 0.2), lambda seed: RoverStart())
    go(rover, 3.0, "speed", 5.0, 6.0)
    x, y, z = rover.read("pose").position_m
    assert math.hypot(x, y) > 0.3
    assert abs(z - rover.ground.at(x, y)[0]) < 0.02


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda v: {"wheels": tuple(replace(one, motor="none") for one in v.wheels)}, 'give one "own"'),
        (lambda v: {"wheels": (*v.wheels[:7], replace(v.wheels[7], motor="R2"))}, "did you mean 'R1'"),
        (lambda v: {"wheels": (*v.wheels[:7], replace(v.wheels[7], motor="owm"))}, "did you mean 'own'"),
    ],
)
def test_vehicle_with_a_motor_that_is_not_there_is_refused(
    change: Callable[[RoverVehicle], dict[str, object]], message: str
) -> None:
    vehicle = VEHICLES["dozer"][1]
    with pytest.raises(ParameterError, match=message):
        replace(vehicle, **change(vehicle))  # type: ignore[arg-type]


def test_command_has_a_value_for_each_motor() -> None:
    with pytest.raises(PlantError, match="send 2 finite numbers, one for each motor"):
        made("dozer").write("drive", DriveCommand("speed", [1.0] * 8))
