"""A scenario's engines differ in their physics, and in nothing that a node could tell."""

import json
from collections.abc import Mapping
from pathlib import Path

import pytest

from snr_sim.prelude.errors import UnknownNameError
from snr_sim.recording.reader import Trace, read_trace
from snr_sim.recording.records import PageRecord
from snr_sim.recording.replay import replay_node
from snr_sim.recording.trace import FILE_NAME
from snr_sim.scenario.simulation import Request, Simulation, prepare
from snr_sim.scenario.simulation_run import RunResult, run_recorded
from tests.lanes import slow

ENGINES = ("pymunk", "mujoco")


def record(folder: Path, scenario: str, engine: str, seed: int) -> tuple[Simulation, RunResult, Trace]:
    folder.mkdir(parents=True)
    simulation = prepare(Request(scenario, seed, engine))
    result = run_recorded(simulation, folder / FILE_NAME)
    return simulation, result, read_trace(folder / FILE_NAME)


def pages(trace: Trace) -> Mapping[str, set[str]]:
    """The keys of all pages, with the fields of each."""
    return {
        record.name: set(json.loads(bytes(record.values))[0]["data"])
        for record in trace.records
        if isinstance(record, PageRecord)
    }


@pytest.mark.parametrize("scenario", ["lander_pad", slow("lander_rough")])
def test_both_engines_give_same_pages_and_land(scenario: str, tmp_path: Path) -> None:
    for seed in range(3):
        runs = [record(tmp_path / engine / str(seed), scenario, engine, seed)[1:] for engine in ENGINES]
        (plane, plane_trace), (space, space_trace) = runs
        assert pages(plane_trace) == pages(space_trace)
        assert plane.outcome == space.outcome == "landed"
        assert plane.metrics["touchdown"] == pytest.approx(space.metrics["touchdown"], abs=0.05)
        assert plane_trace.header.engine.startswith("pymunk: pymunk 7")
        assert space_trace.header.engine.startswith("mujoco: mujoco 4")


@pytest.mark.slow
def test_depth_hold_in_plane_equals_depth_hold_in_space(tmp_path: Path) -> None:
    runs = {engine: record(tmp_path / engine, "urov_depth_hold", engine, 1)[1:] for engine in ENGINES}
    (plane, plane_trace), (space, space_trace) = (runs[engine] for engine in ENGINES)
    assert pages(plane_trace) == pages(space_trace)
    assert plane.success
    assert space.success
    assert plane.metrics["settling_s"] == pytest.approx(space.metrics["settling_s"], abs=0.3)
    assert plane.metrics["overshoot_m"] == pytest.approx(space.metrics["overshoot_m"], abs=0.02)
    assert plane_trace.header.engine.startswith("pymunk: pymunk 7")


def test_mujoco_run_is_reproducible_and_replays(tmp_path: Path) -> None:
    simulation, _, trace = record(tmp_path / "a", "lander_pad", "mujoco", 7)
    assert trace.digest == record(tmp_path / "b", "lander_pad", "mujoco", 7)[2].digest
    assert replay_node(trace, "lander", simulation.config(None)).is_identical


def test_unknown_engine_raises_error_with_available_engines() -> None:
    assert prepare(Request("lander_pad")).request.engine == "pymunk"
    with pytest.raises(UnknownNameError, match="does not run on engine 'bullet'") as caught:
        prepare(Request("lander_pad", engine="bullet"))
    assert all(engine in caught.value.fix for engine in ENGINES)
