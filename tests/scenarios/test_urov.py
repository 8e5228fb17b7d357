"""Dives of the underwater vehicle from end to end: both roles, the link and the plant under one clock."""

import json
import math
import os
import subprocess
import sys
from pathlib import Path

import pytest

from snr_sim.recording.reader import Trace, read_trace
from snr_sim.recording.replay import replay_node
from snr_sim.recording.trace import FILE_NAME
from snr_sim.scenario import library
from snr_sim.scenario.flight import Flight, Result, fly_recorded
from snr_sim.scenario.simulation import Request, Simulation, prepare


def fly(scenario: str, seed: int) -> Result:
    simulation = prepare(Request(scenario, seed))
    plant = simulation.plant()
    return Flight(simulation, plant, simulation.config(plant)).run()


def record(
    folder: Path, scenario: str, seed: int, options: dict[str, str] | None = None
) -> tuple[Simulation, Result, Trace]:
    folder.mkdir(parents=True)
    simulation = prepare(Request(scenario, seed, options=options or {}))
    result = fly_recorded(simulation, folder / FILE_NAME)
    return simulation, result, read_trace(folder / FILE_NAME)


def test_depth_sensor_of_every_dive_agrees_with_its_pool_about_the_water() -> None:
    dives = [found for found in library.known("scenarios") if library.robot_of_scenario(found) == "urov"]
    for found in dives:
        simulation = prepare(Request(found.name))
        pool, sensor = simulation.plant().pool, simulation.robot.parameters.sensors.depth
        water = sensor.density_kgm3, sensor.gravity_mps2, sensor.surface_pa
        assert water == (pool.density_kgm3, pool.gravity_mps2, 101_325.0), found.name


def test_depth_is_held_after_a_step_in_a_current_and_when_the_payload_goes() -> None:
    result = fly("urov_depth_hold", 1)
    assert result.error == ""
    assert (result.outcome, result.success) == ("held", True)
    assert result.metrics["settling_s"] < 8.0
    assert 500.0 < result.metrics["energy_j"] < 10_000.0


def test_heading_is_held_after_a_quarter_turn_in_a_current() -> None:
    result = fly("urov_heading_hold", 1)
    assert (result.error, result.outcome) == ("", "held")
    assert result.metrics["settling_s"] < 4.0
    assert result.metrics["overshoot_deg"] < 6.0


def test_without_its_link_the_vehicle_stops_then_stays_then_comes_up() -> None:
    result = fly("urov_link_loss", 1)
    assert (result.error, result.outcome) == ("", "held")
    assert result.metrics["thrust_after_cut_n"] < 0.1
    assert 8.0 < result.metrics["surfaced_s"] < 20.0


def test_seven_thrusters_hold_what_eight_held() -> None:
    result = fly("urov_thruster_failure", 2)
    assert (result.error, result.outcome) == ("", "held")
    assert result.metrics["fault"] == "off"


def test_a_vehicle_that_takes_in_water_comes_up_by_itself_and_stays_up() -> None:
    result = fly("urov_leak", 1)
    assert (result.error, result.outcome) == ("", "held")
    assert result.metrics["water_l"] == 1.0


def test_a_pilot_who_sees_keeps_the_vehicle_in_its_place_when_the_water_begins_to_move() -> None:
    result = fly("urov_station_keeping", 1)
    assert (result.error, result.outcome) == ("", "held")
    assert 0.05 < result.metrics["worst_place_error_m"] < 0.5, "the current was felt"


def test_the_vehicle_swims_through_three_gates_without_touching_them() -> None:
    result = fly("urov_gate", 2)
    assert (result.error, result.outcome) == ("", "swum")
    assert result.metrics["gates"] == ["gate_1", "gate_2", "gate_3"]


def test_a_dive_is_the_same_dive_every_time_and_both_roles_replay(tmp_path: Path) -> None:
    simulation, result, trace = record(tmp_path / "a", "urov_depth_hold", 5)
    assert result.success
    assert trace.digest == record(tmp_path / "b", "urov_depth_hold", 5)[2].digest
    for role in ("urov", "topside"):
        assert replay_node(trace, role, simulation.config(None)).is_identical


@pytest.mark.slow
@pytest.mark.parametrize("scenario", ["urov_depth_hold", "urov_leak"])  # the second comes up to the surface
def test_a_dive_is_the_same_dive_whichever_way_numpys_library_takes(scenario: str, tmp_path: Path) -> None:
    """numpy's library of linear algebra takes other ways for other processors; it can be told which it has."""
    digests = set()
    for kind in ("Nehalem", "Prescott"):
        command = [sys.executable, "-m", "snr_sim", "run", scenario, "--seed", "5", "--no-rrd", "--json"]
        environment = {**os.environ, "OPENBLAS_CORETYPE": kind}
        done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, env=environment)
        assert done.returncode == 0, done.stderr
        digests.add(json.loads(done.stdout)["trace_digest"])
    assert digests == {record(tmp_path / "here", scenario, 5)[2].digest}


@pytest.mark.slow
def test_a_dive_with_a_camera_keeps_its_pictures_and_replays(tmp_path: Path) -> None:
    simulation, result, trace = record(tmp_path / "a", "urov_depth_hold", 5, {"camera": "down"})
    assert result.success
    pages = [line for line in (tmp_path / "a" / FILE_NAME).read_text().splitlines() if '"key":"camera"' in line]
    assert len(pages) >= 199, "five a second for 40 s"
    assert all('"dtype":"uint8","shape":[48,64,3]' in page for page in pages)
    assert replay_node(trace, "urov", simulation.config(None)).is_identical


@pytest.mark.parametrize("scenario", [found.name for found in library.known("scenarios") if "urov" in found.name])
def test_of_a_dive_that_has_just_begun_nothing_is_said_that_was_not_measured(scenario: str) -> None:
    simulation = prepare(Request(scenario, 1))
    plant = simulation.plant()
    plant.step(plant.step_s)
    metrics = simulation.scenario.metrics(plant, 1)
    assert metrics["energy_j"] > 0.0
    numbers = {name: value for name, value in metrics.items() if isinstance(value, float)}
    assert all(map(math.isfinite, numbers.values())), numbers
    assert not [name for name in numbers if "error" in name or "settling" in name or "overshoot" in name]


def test_a_vehicle_on_a_bad_link_obeys_no_command_that_is_late_and_all_others() -> None:
    results = [fly("urov_bad_link", seed) for seed in (1, 2)]
    assert [(one.error, one.outcome, one.metrics["fault"]) for one in results] == [
        ("", "held", "late"),
        ("", "held", "cut"),
    ]
    assert results[1].metrics["silent_thrust_n"] < 0.1
