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
from snr_sim.scenario.simulation import Request, Simulation, prepare
from snr_sim.scenario.simulation_run import RunResult, run_recorded
from tests.scenarios.recorded import simulate


def record(
    folder: Path, scenario: str, seed: int, options: dict[str, str] | None = None
) -> tuple[Simulation, RunResult, Trace]:
    folder.mkdir(parents=True)
    simulation = prepare(Request(scenario, seed, options=options or {}))
    result = run_recorded(simulation, folder / FILE_NAME)
    return simulation, result, read_trace(folder / FILE_NAME)


def test_depth_sensor_water_density_equals_pool() -> None:
    dives = [found for found in library.list_available("scenarios") if library.robot_of_scenario(found) == "urov"]
    for found in dives:
        simulation = prepare(Request(found.name))
        pool, sensor = simulation.plant().pool, simulation.robot.parameters.sensors.depth
        water = sensor.density_kgm3, sensor.gravity_mps2, sensor.surface_pa
        assert water == (pool.density_kgm3, pool.gravity_mps2, 101_325.0), found.name


def test_depth_hold_survives_step_current_and_payload_release(tmp_path: Path) -> None:
    result = simulate("urov_depth_hold mujoco 1", tmp_path)
    assert result.error == ""
    assert (result.outcome, result.success) == ("held", True)
    assert result.metrics["settling_s"] < 8.0
    assert 500.0 < result.metrics["energy_j"] < 10_000.0


def test_heading_hold_survives_quarter_turn_in_current(tmp_path: Path) -> None:
    result = simulate("urov_heading_hold mujoco 1", tmp_path)
    assert (result.error, result.outcome) == ("", "held")
    assert result.metrics["settling_s"] < 4.0
    assert result.metrics["overshoot_deg"] < 6.0


def test_link_loss_stops_holds_and_surfaces(tmp_path: Path) -> None:
    result = simulate("urov_link_loss mujoco 1", tmp_path)
    assert (result.error, result.outcome) == ("", "held")
    assert result.metrics["thrust_after_cut_n"] < 0.1
    assert 8.0 < result.metrics["surfaced_s"] < 20.0


def test_thruster_failure_keeps_depth_and_heading(tmp_path: Path) -> None:
    result = simulate("urov_thruster_failure mujoco 2", tmp_path)
    assert (result.error, result.outcome) == ("", "held")
    assert result.metrics["fault"] == "off"


def test_leak_surfaces_and_stays_up(tmp_path: Path) -> None:
    result = simulate("urov_leak mujoco 1", tmp_path)
    assert (result.error, result.outcome) == ("", "held")
    assert result.metrics["water_l"] == 1.0


def test_waypoint_pilot_keeps_position_in_current(tmp_path: Path) -> None:
    result = simulate("urov_station_keeping mujoco 1", tmp_path)
    assert (result.error, result.outcome) == ("", "held")
    assert 0.05 < result.metrics["worst_place_error_m"] < 0.5, "the current was felt"


def test_vehicle_passes_three_gates_without_contact(tmp_path: Path) -> None:
    result = simulate("urov_gate mujoco 2", tmp_path)
    assert (result.error, result.outcome) == ("", "completed")
    assert result.metrics["gates"] == ["gate_1", "gate_2", "gate_3"]


@pytest.mark.parametrize("run", ["urov_sticks mujoco 1", "urov_tank mujoco 1", "urov_teleop mujoco 1"])
def test_other_dives_meet_their_criterion(run: str, tmp_path: Path) -> None:
    assert simulate(run, tmp_path).success


def test_dive_is_reproducible_and_both_roles_replay(tmp_path: Path) -> None:
    simulation, result, trace = record(tmp_path / "a", "urov_depth_hold", 5)
    assert result.success
    assert trace.digest == record(tmp_path / "b", "urov_depth_hold", 5)[2].digest
    for role in ("urov", "topside"):
        assert replay_node(trace, role, simulation.config(None)).is_identical


@pytest.mark.slow
# The second comes up to the surface.
@pytest.mark.parametrize("scenario", [pytest.param("urov_depth_hold", marks=pytest.mark.nightly), "urov_leak"])
def test_dive_is_independent_of_blas_kernel(scenario: str, tmp_path: Path) -> None:
    """numpy's BLAS uses different kernels for different processors; a variable selects one."""
    digests = set()
    for kind in ("Nehalem", "Prescott"):
        command = [sys.executable, "-m", "snr_sim", "run", scenario, "--seed", "5", "--no-rrd", "--json"]
        environment = {**os.environ, "OPENBLAS_CORETYPE": kind}
        done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, env=environment)
        assert done.returncode == 0, done.stderr
        digests.add(json.loads(done.stdout)["trace_digest"])
    assert digests == {record(tmp_path / "here", scenario, 5)[2].digest}


@pytest.mark.slow
def test_dive_with_camera_records_pictures_and_replays(tmp_path: Path) -> None:
    simulation, result, trace = record(tmp_path / "a", "urov_depth_hold", 5, {"camera": "down"})
    assert result.success
    pages = [line for line in (tmp_path / "a" / FILE_NAME).read_text().splitlines() if '"key":"camera"' in line]
    assert len(pages) >= 199, "five a second for 40 s"
    assert all('"dtype":"uint8","shape":[48,64,3]' in page for page in pages)
    assert replay_node(trace, "urov", simulation.config(None)).is_identical


@pytest.mark.parametrize(
    "scenario", [found.name for found in library.list_available("scenarios") if "urov" in found.name]
)
def test_metrics_at_start_contain_no_unmeasured_values(scenario: str) -> None:
    simulation = prepare(Request(scenario, 1))
    plant = simulation.plant()
    plant.step(plant.step_s)
    metrics = simulation.scenario.metrics(plant, 1)
    assert metrics["energy_j"] > 0.0
    numbers = {name: value for name, value in metrics.items() if isinstance(value, float)}
    assert all(map(math.isfinite, numbers.values())), numbers
    assert not [name for name in numbers if "error" in name or "settling" in name or "overshoot" in name]


def test_bad_link_applies_fresh_and_ignores_late_commands(tmp_path: Path) -> None:
    results = [simulate("urov_bad_link mujoco 1", tmp_path), simulate("urov_bad_link mujoco 2", tmp_path / "second")]
    assert [(one.error, one.outcome, one.metrics["fault"]) for one in results] == [
        ("", "held", "late"),
        ("", "held", "cut"),
    ]
    assert results[1].metrics["silent_thrust_n"] < 0.1
