"""Dora explores, stops before a wall, and learns late over a slow line, as in Fabry and Campusano 2014."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeAlias

import pytest

from snr_sim.behaviors.language import parse
from snr_sim.cli.machine import machine
from snr_sim.prelude.errors import ParameterError
from snr_sim.recording.reader import read_trace
from snr_sim.recording.records import Executed
from snr_sim.recording.replay import replay_node
from snr_sim.recording.trace import FILE_NAME
from snr_sim.scenario import library
from snr_sim.scenario.machine_controller import bridge_of
from snr_sim.scenario.machine_lag import lag_of
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import RunResult, SimulationRun, run_recorded
from tests.lanes import nightly, slow
from tests.scenarios.recorded import simulate

RecordScenario: TypeAlias = Callable[..., Any]
ROOMS = ("dora_room", "dora_corners", "dora_people")
STOP = library.find("robots", "dora").path / "controllers" / "stop.lrp"


def run(scenario: str, seed: int, controller: str | None = None, **options: str) -> RunResult:
    simulation = prepare(Request(scenario, seed, controller=controller, options=options))
    plant = simulation.plant()
    return SimulationRun(simulation, plant, simulation.config(plant)).run()


def own_programs() -> list[tuple[str, Path]]:
    """Return every LRP program of every robot."""
    return [
        (robot.name, path) for robot in library.list_available("robots") for path in sorted(robot.path.rglob("*.lrp"))
    ]


@pytest.mark.parametrize(("robot", "path"), own_programs(), ids=lambda one: getattr(one, "stem", one))
def test_programs_of_robots_have_no_problems(robot: str, path: Path) -> None:
    found = library.find("robots", robot)
    library.name_robot(found.name, found.path)
    bridge = bridge_of(library.ROBOT_MODULE + found.name)
    assert parse(path.read_text(), bridge.parts).warnings == ()


def test_own_programs_are_found() -> None:
    assert {path.stem for _, path in own_programs()} >= {"explorer", "weaver", "stutter", "stop"}


@pytest.mark.parametrize(
    "recorded",
    [
        "dora_room pymunk 0",
        slow("dora_corners pymunk 0"),
        nightly("dora_corners pymunk 1"),
        slow("dora_people pymunk 0"),
        nightly("dora_people pymunk 1"),
    ],
)
def test_room_is_explored(recorded: str, tmp_path: Path) -> None:
    result = simulate(recorded, tmp_path)
    assert result.success, result.notes
    assert result.metrics["seen_share"] > 0.9
    assert result.metrics["way_m"] > 20.0


@pytest.mark.nightly
@pytest.mark.parametrize("scenario", ROOMS)
def test_room_is_explored_from_every_start(scenario: str) -> None:
    results = [run(scenario, seed) for seed in range(20)]
    assert [(one.outcome, one.error, one.notes) for one in results if not one.success] == []
    assert all(one.metrics["seen_share"] > 0.9 for one in results)
    assert all(one.metrics["way_m"] > 20.0 for one in results)


@pytest.mark.parametrize("scenario", ["dora_corners", "dora_people"])
def test_first_half_minute_hits_nothing(scenario: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The whole of these runs takes 3 s of CPU time each, and so is slow."""
    simulation = prepare(Request(scenario, 0))
    monkeypatch.setattr(simulation.scenario, "TIME_LIMIT_S", 30.0)
    plant = simulation.plant()
    result = SimulationRun(simulation, plant, simulation.config(plant)).run()
    assert (result.error, result.outcome) == ("", "timeout")
    assert result.sim_time_s == pytest.approx(30.0)
    assert result.metrics["hit_mps"] < 0.1
    assert result.metrics["way_m"] > 3.0
    assert result.metrics["seen_share"] > 0.5


def test_straight_driver_hits_the_wall(tmp_path: Path) -> None:
    file = tmp_path / "blind.lrp"
    drive = "robot.motor_a.start(50); robot.motor_d.start(50)"
    file.write_text(f"(machine m (state a (onentry [{drive}])))(spawn m a)")
    result = run("dora_room", 0, str(file))
    assert (result.outcome, result.success) == ("collided", False)
    assert result.metrics["hit_mps"] > 0.1


@pytest.mark.slow
def test_one_that_stands_sees_too_little(tmp_path: Path) -> None:
    file = tmp_path / "still.lrp"
    file.write_text("(machine m (state a))(spawn m a)")
    result = run("dora_room", 0, str(file))
    assert (result.outcome, result.success) == ("incomplete", False)


@pytest.mark.slow
def test_lag_of_four_requests_is_five_centimetres() -> None:
    """Fabry and Campusano 2014, section 3.2: 5 cm at 55 % of full speed, in 120 ms between cause and effect."""
    from snr_sim_robot_dora.parameters import DORA

    runs = [run("dora_wall", seed, wire="wifi").metrics for seed in range(1, 41)]
    coasting_m = 0.55 * DORA.full_speed_mps * DORA.lag_s
    moved_cm = [100.0 * (one["beyond_m"] - coasting_m) for one in runs]
    assert max(moved_cm) == pytest.approx(5.0, abs=0.5)
    assert min(moved_cm) > 0.5, "at best it takes half of a reading's request, and half of a command's"


def test_slower_line_stops_later() -> None:
    seeds, wires = (1, 2, 3), ("none", "wifi")
    left_m = {wire: [run("dora_wall", seed, wire=wire).metrics["left_m"] for seed in seeds] for wire in wires}
    assert sum(left_m["wifi"]) < sum(left_m["none"]) - 0.03
    assert all(0.2 < one < 0.41 for row in left_m.values() for one in row)


def test_wire_is_checked() -> None:
    with pytest.raises(ParameterError, match="wire=none, wire=wifi"):
        run("dora_wall", 0, wire="radio")


def test_program_sees_and_commands_its_robot(record_scenario: RecordScenario) -> None:
    trace = record_scenario("dora_wall")
    names = {record.name for record in trace.records if isinstance(record, Executed)}
    assert {"range", "touch", "wheels", "motors", "dora"} <= names


@pytest.mark.slow
def test_table_of_lag_is_printed(tmp_path: Path) -> None:
    script = library.find("robots", "dora").path / "lag.py"
    done = subprocess.run(
        [sys.executable, str(script), "--starts", "0"], capture_output=True, text=True, check=False, cwd=tmp_path
    )
    assert (done.returncode, "must be 1 or more" in done.stderr) == (2, True)


@pytest.mark.slow
def test_lag_of_a_run_is_printed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ages = {}
    for wire in ("none", "wifi"):
        folder = tmp_path / wire
        simulation = prepare(Request("dora_wall", 1, options={"wire": wire}))
        folder.mkdir()
        assert run_recorded(simulation, folder / FILE_NAME).success
        found = lag_of(read_trace(folder / FILE_NAME))
        assert found["transitions"] == {"dora": 3}
        ages[wire] = found["readings"]["range"]["max_s"]
        assert bool(found["commands"]) == (wire == "wifi")
    assert ages == {"none": pytest.approx(0.0, abs=1e-6), "wifi": pytest.approx(0.015, abs=1e-6)}
    delay = found["commands"]["motors"]
    assert 0.015 - 1e-6 <= delay["mean_s"] <= delay["max_s"] <= 0.06
    machine("lag", str(tmp_path / "wifi"))
    shown = capsys.readouterr().out
    assert "transitions  dora: 3" in shown
    assert "until applied: mean" in shown


@pytest.mark.slow
def test_recorded_drive_is_replayed_without_a_difference(record_scenario: RecordScenario) -> None:
    trace = record_scenario("dora_wall", None, 3)
    config = prepare(Request("dora_wall", 3)).config(None)
    found = replay_node(trace, "dora", config)
    assert found.divergences == []
    assert found.executed > 500
