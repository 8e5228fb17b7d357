"""The edits of a run: written as files they give the same run again; anything else gives another digest."""

from __future__ import annotations

import json
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest
from msgspec import Raw, structs

from snr_sim.prelude import tasks
from snr_sim.prelude.errors import ParameterError
from snr_sim.recording.reader import Trace, read_trace
from snr_sim.recording.records import InputRecord, TaskRecord
from snr_sim.recording.trace import FILE_NAME, TraceWriter
from snr_sim.scenario.machine_edits import TABLE, Edits, changes_again, digest_of_changes, edits_of, write
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import run_recorded

SLOW, FAST = "(var speed := [30])", "(var speed := [70])"
PROGRAM = f"""{SLOW}

(machine dora
  (state waiting)
  (state forward (running [
    robot.motor_a.start(speed)
    robot.motor_d.start(speed)]))
  (state stopped (onentry [robot.stop()]))

  (on [robot.ultra.read() is not None] waiting -> forward)
  (on [robot.ultra.read() < 40] forward -> stopped))
(spawn dora waiting)
"""


def recorded(folder: Path, *brought: tuple[float, str, list[str]], controller: str = "") -> Trace:
    """Return the trace of a drive at the wall during which some events come."""
    file = folder / "mine.lrp"
    file.write_text(PROGRAM)
    simulation = prepare(Request("dora_wall", seed=2, controller=controller or str(file), options={"wire": "wifi"}))
    run_recorded(simulation, folder / FILE_NAME, [(at_s, tasks.event(name, values)) for at_s, name, values in brought])
    return read_trace(folder / FILE_NAME)


@pytest.fixture(scope="module")
def edited(tmp_path_factory: pytest.TempPathFactory) -> Trace:
    return recorded(
        tmp_path_factory.mktemp("edited"),
        (1.0, "dora.edit", [PROGRAM.replace("(spawn", "(spwan")]),
        (1.5, "dora.edit", [PROGRAM.replace(SLOW, FAST)]),
    )


def test_edits_of_a_run_have_texts_times_and_request(edited: Trace) -> None:
    found = edits_of(edited)
    assert (found.scenario, found.seed, found.options, found.name) == ("dora_wall", 2, {"wire": "wifi"}, "dora")
    assert found.texts == [PROGRAM, PROGRAM.replace("(spawn", "(spwan"), PROGRAM.replace(SLOW, FAST)]
    assert (found.at_s, found.others) == ([1.0, 1.5], [])


def test_task_that_is_brought_comes_after_the_ticks_of_its_moment(edited: Trace) -> None:
    sources = [one.source for one in edited.records if isinstance(one, InputRecord) and one.t == 1.5]
    assert len(sources) > 1
    assert sources[-1] == "outside"


def test_files_give_the_same_run_again(edited: Trace, tmp_path: Path) -> None:
    found, folder = edits_of(edited), tmp_path / "edits"
    write(found, folder)
    table = tomllib.loads((folder / TABLE).read_text())
    texts = [(folder / f"{number}.lrp").read_text() for number in range(3)]
    again = Edits(table["scenario"], table["seed"], table["options"], "dora", texts, table["at_s"])
    assert changes_again(again, folder / "0.lrp") == table["changes"] == digest_of_changes(edited.records)


def test_changes_of_a_flow_do_not_count_for_machines(edited: Trace) -> None:
    change = next(one for one in edited.records if isinstance(one, TaskRecord) and one.name == "dora.transition")
    move = {"t_ns": 0, "machine": "flow", "source": "a", "target": "b", "outcome": "done", "held_s": 1.0}
    of_flow = structs.replace(change, values=Raw(json.dumps([move]).encode()))
    assert digest_of_changes([*edited.records, of_flow]) == digest_of_changes(edited.records)


def test_other_times_or_fewer_edits_give_another_digest(edited: Trace, tmp_path: Path) -> None:
    found = edits_of(edited)
    write(found, tmp_path)
    for other in (replace(found, at_s=[1.0, 1.6]), replace(found, at_s=[1.0], texts=found.texts[:2])):
        assert changes_again(other, tmp_path / "0.lrp") != found.changes


def test_other_events_for_the_machine_are_listed(tmp_path: Path) -> None:
    found = edits_of(recorded(tmp_path, (1.0, "dora.set", ["speed", 50])))  # type: ignore[list-item]
    assert (found.at_s, found.others) == ([], ["dora.set"])


def test_run_without_one_machine_in_lrp_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="several machines: dora, other"):
        edits_of(recorded(tmp_path, (1.0, "dora.edit", ["x"]), (1.0, "other.edit", ["x"])))
    python = tmp_path / "python.py"
    python.write_text("from snr_sim import Endpoint\n\ndef factories(robot):\n    return [Endpoint.factory()]\n")
    (tmp_path / FILE_NAME).unlink()
    simulation = prepare(Request("dora_wall", controller=str(python)))
    plant = simulation.plant()
    config = simulation.config(plant)
    TraceWriter(tmp_path / FILE_NAME, simulation.header(plant, config), simulation.trace_info()).close()
    with pytest.raises(ParameterError, match="no machine in LRP"):
        edits_of(read_trace(tmp_path / FILE_NAME))
