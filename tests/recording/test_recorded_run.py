"""A recorded run as a plant: the sensors of the current program return the recorded readings."""

from pathlib import Path
from typing import Any

import pytest

from snr_sim.prelude.errors import PlantError, TraceError, UnknownNameError
from snr_sim.prelude.plant import Plant
from snr_sim.recording.reader import Trace, read_trace
from snr_sim.recording.recorded_run import RecordedRun
from snr_sim.recording.records import InputRecord
from snr_sim.recording.trace import FILE_NAME
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import RunResult, run_recorded
from tests.lanes import slow


def record_run(folder: Path, scenario: str, **request: Any) -> tuple[RunResult, Trace]:
    result = run_recorded(prepare(Request(scenario, **request)), folder / FILE_NAME)
    return result, read_trace(folder / FILE_NAME)


def sensor_pages(trace: Trace) -> list[tuple[float, str, bytes]]:
    return [
        (record.t, record.source, bytes(record.values))
        for record in trace.records
        if isinstance(record, InputRecord) and record.source.endswith("_sensor")
    ]


@pytest.mark.parametrize(("scenario", "sensors"), [("lander_pad", 2), slow("urov_heading_hold", 5)])
def test_sensors_return_recorded_pages_byte_for_byte(tmp_path: Path, scenario: str, sensors: int) -> None:
    (tmp_path / "then").mkdir()
    (tmp_path / "now").mkdir()
    _, then = record_run(tmp_path / "then", scenario, seed=3)
    result, now = record_run(tmp_path / "now", scenario, seed=3, io=f"replay:{tmp_path / 'then'}")
    assert (result.error, result.outcome, result.success) == ("", "replayed", True)
    read_then, read_now = sensor_pages(then), sensor_pages(now)
    assert len({source for _, source, _ in read_then}) == sensors
    assert read_now == read_then[: len(read_now)]
    assert len(read_then) - len(read_now) <= sensors, "up to its end"
    assert now.header.scene == then.header.scene
    assert now.header.io == f"replay:{tmp_path / 'then'}"


def test_replay_io_accepts_run_folder_or_trace_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    record_run(tmp_path, "lander_pad")
    monkeypatch.chdir(tmp_path)
    for where in (".", FILE_NAME):
        simulation = prepare(Request("lander_pad", io=f"replay:{where}"))
        assert simulation.request.io.startswith(f"replay:{tmp_path}")
        plant = simulation.plant()
        assert isinstance(plant, RecordedRun)
        assert isinstance(plant, Plant)


def test_replay_io_of_missing_or_other_robots_run_raises(tmp_path: Path) -> None:
    with pytest.raises(TraceError, match="There is no run at"):
        prepare(Request("lander_pad", io=f"replay:{tmp_path / 'nowhere'}")).plant()
    record_run(tmp_path, "lander_vertical")
    with pytest.raises(TraceError, match="is a run of the robot 'lander', not of 'urov'"):
        prepare(Request("urov_depth_hold", io=f"replay:{tmp_path}")).plant()


def test_unknown_sensor_raises_with_recorded_sensors(tmp_path: Path) -> None:
    _, trace = record_run(tmp_path, "lander_vertical")
    run = RecordedRun(trace)
    with pytest.raises(TraceError, match=r"there is no sensor 'inertial'(.|\n)*radar"):
        run.pages("inertial")
    with pytest.raises(PlantError, match="nothing moves"):
        run.write("engine", None)
    with pytest.raises(UnknownNameError, match="no output 'radar'"):
        run.read("radar")


def test_truth_equals_newest_recorded_state(tmp_path: Path) -> None:
    _, trace = record_run(tmp_path, "lander_vertical")
    run = RecordedRun(trace)
    body = next(iter(run.truth()["poses"]))
    high = run.truth()["poses"][body][2]
    run.step(20.0)
    at_20_s = run.truth()
    assert at_20_s["poses"][body][2] < high
    kept = run.snapshot()
    run.step(5.0)
    assert run.truth() != at_20_s
    run.restore(kept)
    assert run.truth() == at_20_s
    run.reset(0)
    assert run.truth()["poses"][body][2] == high
