"""Preparing and running a scenario: errors in its files are reported, and every run has a result."""

import json
import math
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from snr_sim.cli.recorded_run import record_run
from snr_sim.prelude.errors import ConfigError, DeviceError, MissingExtraError, TraceError, UnknownNameError
from snr_sim.recording.folder import RESULT_NAME, as_json, new_run_folder, read_result, write_result
from snr_sim.recording.reader import read_trace
from snr_sim.recording.trace import FILE_NAME, TraceWriter
from snr_sim.scenario.library import find
from snr_sim.scenario.simulation import Request, Simulation, prepare, request_of
from snr_sim.scenario.simulation_run import RunResult, SimulationRun

Scenario = Callable[..., Path]


@pytest.fixture
def scenario(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Scenario:
    """Return a function that writes scenarios/own.py: lander_vertical, with some of its text replaced."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("SNR_SIM_PATH", raising=False)

    def write(*changes: tuple[str, str]) -> Path:
        text = find("scenarios", "lander_vertical").path.read_text()
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        path = tmp_path / "scenarios" / "own.py"
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
        return path

    return write


def run(name: str = "own", **request: Any) -> tuple[RunResult, Any]:
    simulation = prepare(Request(name, **request))
    plant = simulation.plant()
    return SimulationRun(simulation, plant, simulation.config(plant)).run(), plant


def record(name: str = "own", **request: Any) -> dict[str, Any]:
    fields, status = record_run(Request(name, **request), Path("runs"), None, is_viewed=False, live="", is_json=True)
    assert status == (0 if fields["success"] else 1)
    return fields


VERDICT = "    return judge(plant)"
METRICS = "    return vertical_metrics(plant, start(seed), parameters(seed).engine)"
PLANT = "    return Lander1D(start, parameters(seed).engine, seed, gear=APOLLO.gear)"


def test_students_scenario_runs_like_shipped_one(scenario: Scenario) -> None:
    scenario()
    own, _ = run()
    ours, _ = run("lander_vertical")
    assert (own.outcome, own.metrics, own.tasks) == (ours.outcome, ours.metrics, ours.tasks)
    by_file, _ = run("./scenarios/own.py")
    assert by_file.metrics == ours.metrics


# Errors in its files are reported before anything is written


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        (PLANT, "    return None", "plant(seed, engine) returned None, which is not a plant"),
        (PLANT, "    return 1 / 0", "own.py, line "),
        (PLANT, "    return Lander1D", "which is not a plant"),
        ("    begin = start(seed)", "    begin = strt(seed)", "NameError: name 'strt' is not defined"),
        ('ROBOT = "lander"', 'ROBOT = "landr"', "no robot 'landr'"),
        ('CONTROLLER = "optimal"', 'CONTROLLER = "optiml"', "did you mean 'optimal'?"),
        (
            "def plant(seed: int, engine: str)",
            "def plant(seed: int)",
            "plant(seed) is called with 2 argument(s): plant(seed, engine)",
        ),
    ],
)
def test_scenario_that_cannot_start_raises_with_reason(scenario: Scenario, old: str, new: str, expected: str) -> None:
    scenario((old, new))
    with pytest.raises(ConfigError) as caught:
        record()
    assert expected in str(caught.value)
    assert not Path("runs").exists()


ROLES = '    return {"lander": [*sensors, *controller, engine]}'
WRAPPED = "        return context.plant\n"


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        (ROLES, "    return None", "which has no components for the role 'lander'"),
        (ROLES, "    return []", "which has no components for the role 'lander'"),
        (ROLES, '    return {"landr": []}', "which has no components for the role 'lander'"),
        (ROLES, '    return {"lander": 5}', "which has no components for the role 'lander'"),
        (ROLES, "    return 1 / 0", "robot.py, line "),
        (WRAPPED, "        return 5\n", "robot.py: wrap_plant(context) returned 5, which is not a plant"),
        (WRAPPED, "        return None\n", "returned None, which is not a plant"),
        (WRAPPED, "        return 1 / 0\n", "ZeroDivisionError"),
    ],
)
def test_robot_that_cannot_start_raises_with_reason(scenario: Scenario, old: str, new: str, expected: str) -> None:
    shutil.copytree(find("robots", "lander").path, "robots/lander")
    robot = Path("robots/lander/robot.py")
    text = robot.read_text()
    assert text.count(old) == 1
    robot.write_text(text.replace(old, new))
    with pytest.raises(ConfigError) as caught:
        record("lander_vertical")
    assert expected in str(caught.value)
    assert not Path("runs").exists()


@pytest.mark.parametrize(
    "wrong", [{"engine": "pymnk"}, {"io": "p"}, {"role": "x"}, {"controller": "x"}, {"scenario": "x"}]
)
def test_prepare_rejects_unknown_names(wrong: dict[str, str]) -> None:
    with pytest.raises(UnknownNameError):
        prepare(Request(**{"scenario": "lander_vertical", **wrong}))


# A failure during the run still gives a result and a complete trace


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        (VERDICT, "    return None if plant.time_s < 5.0 else 1 / 0", "ZeroDivisionError"),
        (VERDICT, '    return "landed" if plant.time_s > 5.0 else None', "returned 'landed', which is not a Verdict"),
        (VERDICT, "    return plant.time_s > 5.0", "which is not a Verdict"),
        (METRICS, "    return 1 / 0", "while metrics(plant, seed) was called"),
        (METRICS, "    return None", "returned None, which is not a dict"),
        (PLANT, PLANT.replace("return", "lander =") + "\n    lander.step = lambda dt_s: 1 / 0\n    return lander",
         "ZeroDivisionError"),
    ],
)  # fmt: skip
def test_scenario_that_fails_during_run_reports_its_line(scenario: Scenario, old: str, new: str, expected: str) -> None:
    scenario((old, new))
    fields = record()
    assert fields["outcome"] == "error"
    assert expected in fields["error"]
    assert fields["error"].startswith("scenarios/own.py")
    folder = Path(fields["run_dir"])
    assert read_trace(folder / FILE_NAME).is_ended
    assert read_result(folder) == json.loads(as_json(fields))


def test_a_time_limit_ends_a_run(scenario: Scenario) -> None:
    scenario(("TIME_LIMIT_S = 240.0", "TIME_LIMIT_S = 3"))
    fields = record()
    assert (fields["outcome"], fields["success"]) == ("timeout", False)
    assert fields["sim_time_s"] == pytest.approx(3.0, abs=0.1)
    assert "timeout: the scenario had not come to an end by its TIME_LIMIT_S of 3 s." in fields["notes"]


def test_non_finite_numbers_become_null_in_json(scenario: Scenario, tmp_path: Path) -> None:
    scenario(
        (
            METRICS,
            "    import numpy as np\n    return {'a': float('nan'), 'b': np.int64(3), 'c': np.array([1.0, np.inf])}",
        )
    )
    fields = record()
    assert json.loads((Path(fields["run_dir"]) / RESULT_NAME).read_bytes())["c"] == [1.0, None]
    assert json.loads(as_json(fields))["a"] is None
    assert json.loads(as_json({"n": {1, 2}, "p": tmp_path, 3: math.inf})) == {
        "n": [1, 2],
        "p": str(tmp_path),
        "3": None,
    }


@pytest.mark.parametrize("where", ["controller", "scenario"])
def test_the_engine_is_off_after_a_run_that_failed(scenario: Scenario, tmp_path: Path, where: str) -> None:
    mine = tmp_path / "mine.py"
    coast = (find("robots", "lander").path / "controllers" / "coast.py").read_text()
    fails = "        if self.get_time_s() > 5.0:\n            raise ValueError\n" if where == "controller" else ""
    mine.write_text(coast.replace("0.0", "1.0").replace("        return self", f"{fails}        return self"))
    scenario(*([(VERDICT, "    return None if plant.time_s < 5.0 else 1 / 0")] if where == "scenario" else []))
    result, plant = run(controller=str(mine))
    assert result.outcome == "error"
    fuel_kg = plant.truth()["values"]["fuel_kg"]
    plant.step(0.5)  # the engine's lag
    plant.step(0.5)
    low_kg = plant.truth()["values"]["fuel_kg"]
    plant.step(0.5)
    assert plant.truth()["values"]["fuel_kg"] == pytest.approx(low_kg, abs=0.5)
    assert low_kg <= fuel_kg


# Observers do not change a run


@pytest.mark.parametrize("name", ["lander_vertical", "lander_pad"])
def test_recording_changes_nothing(name: str, tmp_path: Path) -> None:
    bare, _ = run(name, seed=3)
    simulation = prepare(Request(name, seed=3))
    plant = simulation.plant()
    config = simulation.config(plant)
    recorder = TraceWriter(tmp_path / FILE_NAME, simulation.header(plant, config))
    recorded = SimulationRun(simulation, plant, config, recorder, pace=1e6, on_advance=lambda time_s: None).run()
    recorder.close()
    bare.wall_time_s = recorded.wall_time_s = 0.0
    assert bare == recorded


def test_request_of_returns_original_request(tmp_path: Path) -> None:
    path = tmp_path / "mine.py"
    path.write_text('OPTIONS = {"a": "something"}\n\n\ndef factories(robot):\n    return []\n')
    simulation = prepare(Request("lander_pad", seed=5, controller=str(path), options={"a": "b"}))
    plant = simulation.plant()
    header = simulation.header(plant, simulation.config(plant))
    again = prepare(request_of(simulation.trace_info(), header))
    assert isinstance(again, Simulation)
    assert again.request.scenario == "lander_pad"
    assert again.request.controller == str(path)
    assert (again.request.seed, again.request.engine, again.request.options) == (
        5,
        simulation.request.engine,
        {"a": "b"},
    )
    assert again.sources() == header.sources
    other = path.rename(tmp_path / "other.py")
    assert prepare(request_of(simulation.trace_info(), header, str(other))).request.controller == str(other)


def test_controller_file_is_found_from_other_folder(scenario: Scenario, monkeypatch: pytest.MonkeyPatch) -> None:
    coast = (find("robots", "lander").path / "controllers" / "coast.py").read_text()
    Path("mine.py").write_text(coast)
    fields = record("lander_vertical", controller="mine.py")
    trace = read_trace(Path(fields["run_dir"]) / FILE_NAME)
    assert trace.header.controller == "mine"
    monkeypatch.chdir("/")
    assert prepare(request_of(trace.trace_info, trace.header)).config(None)


# Run folders


def test_run_folders_are_never_shared(tmp_path: Path) -> None:
    folders = {new_run_folder(tmp_path / "a" / "b", "own", -3) for _ in range(20)}
    assert len(folders) == 20
    assert all(folder.name.startswith("own--3-") for folder in folders)


def test_result_file_is_complete_or_absent(tmp_path: Path) -> None:
    assert read_result(tmp_path) == {}
    write_result(tmp_path, {"a": 1})
    assert read_result(tmp_path) == {"a": 1}
    (tmp_path / RESULT_NAME).write_text('{"a": ')
    assert read_result(tmp_path) == {}
    with pytest.raises(TraceError, match=r"result.json could not be written: No such file or directory"):
        write_result(tmp_path / "gone", {"a": 1})
    assert [path.name for path in tmp_path.iterdir()] == [RESULT_NAME]


@pytest.mark.parametrize(("io", "extra"), [("sim", "sim"), ("pi", "hardware")])
def test_missing_numpy_raises_with_install_command(monkeypatch: pytest.MonkeyPatch, io: str, extra: str) -> None:
    monkeypatch.setitem(sys.modules, "numpy", None)
    with pytest.raises(MissingExtraError) as refused:
        prepare(Request("urov_teleop", role="urov", io=io))
    assert f"snr_sim[{extra}]" in refused.value.fix


def test_port_is_checked_without_its_settings(tmp_path: Path) -> None:
    port = tmp_path / "ttyACM0"
    port.touch()
    prepare(Request("lander_pad", io=f"maestro:{port},crc")).check_hardware()
    with pytest.raises(DeviceError, match=rf"no serial port {port}1\."):
        prepare(Request("lander_pad", io=f"maestro:{port}1,crc")).check_hardware()
