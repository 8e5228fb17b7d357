"""A rehearsal does what the run would have done: with its own program as recorded, with an edit as after that edit."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from msgspec import structs

from snr_sim.prelude import tasks
from snr_sim.prelude.errors import ParameterError, UnknownNameError
from snr_sim.recording.reader import Trace, read_trace
from snr_sim.recording.trace import FILE_NAME
from snr_sim.scenario.machine_edits import changes_of
from snr_sim.scenario.rehearsal import rehearse
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import run_recorded

WINKS = (
    "(export winks)\n(machine winks (state open) (state shut) (ontime 250 open -> shut) (ontime 250 shut -> open))\n"
)
PROGRAM = """(import "winks.lrp")
(var near_cm := [40])
(machine dora
  (event halt)
  (state waiting)
  (state forward (running [robot.motor_a.start(50); robot.motor_d.start(50)]))
  (state stopped (onentry [robot.stop()]))
  (on [robot.ultra.read() is not None] waiting -> forward)
  (on [robot.ultra.read() < near_cm] forward -> stopped)
  (on halt forward -> stopped)
  (on halt stopped -> forward))
(spawn dora waiting)
(spawn winks open)
"""
FARTHER = PROGRAM.replace("[40]", "[80]")
INPUTS = [(0.4, tasks.event("halt")), (0.7, tasks.event("halt")), (0.9, tasks.event("dora.set", ["near_cm", 60]))]


def record(folder: Path, *inputs: tuple[float, tasks.Task]) -> Trace:
    """Return the trace of a drive at the wall during which something comes from outside."""
    folder.mkdir()
    (folder / "winks.lrp").write_text(WINKS)
    file = folder / "mine.lrp"
    file.write_text(PROGRAM)
    simulation = prepare(Request("dora_wall", seed=2, controller=str(file)))
    run_recorded(simulation, folder / FILE_NAME, inputs)
    return read_trace(folder / FILE_NAME)


@pytest.fixture(scope="module")
def trace(tmp_path_factory: pytest.TempPathFactory) -> Trace:
    return record(tmp_path_factory.mktemp("rehearsal") / "run", *INPUTS)


def changes_after(trace: Trace, at_s: float) -> list[dict[str, object]]:
    return [one for one in changes_of(trace.records) if one["t_ns"] > at_s * 1e9]


def test_program_of_the_run_does_what_is_recorded(trace: Trace) -> None:
    found = rehearse(trace, FARTHER, {"winks.lrp": WINKS}, 1.0)
    assert (found.at_s, found.until_s) == (1.0, 11.0)
    assert found.unchanged.changes == changes_after(trace, 1.0)
    assert found.unchanged.end == "stopped after 3.63 s"
    assert len(found.unchanged.changes) > 8


def test_input_after_the_moment_does_not_come(trace: Trace) -> None:
    found = rehearse(trace, FARTHER, {"winks.lrp": WINKS}, 0.6)
    assert [one["machine"] for one in found.unchanged.changes if one["machine"] != "winks"] == []
    assert found.edited.end == found.unchanged.end == "stopped after 1.19 s"  # it had been halted, and stays so


def test_other_program_does_what_the_run_does_after_that_edit(trace: Trace, tmp_path: Path) -> None:
    files = {"winks.lrp": WINKS.replace("250 open", "125 open")}
    found = rehearse(trace, FARTHER, files, 1.0)
    edited = record(tmp_path / "edited", *INPUTS, (1.0, tasks.event("dora.edit", [FARTHER, "", files])))
    assert found.edited.changes == changes_after(edited, 1.0)
    assert found.edited != found.unchanged


def test_files_that_have_been_saved_since_do_not_count(tmp_path: Path) -> None:
    trace = record(tmp_path / "run", *INPUTS)
    before = rehearse(trace, PROGRAM, {"winks.lrp": WINKS}, 1.0, ahead_s=1.0)
    (tmp_path / "run" / "mine.lrp").write_text("(machine broken")
    (tmp_path / "run" / "winks.lrp").unlink()
    assert rehearse(trace, PROGRAM, {"winks.lrp": WINKS}, 1.0, ahead_s=1.0) == before


def test_moment_after_the_recording_is_its_end(trace: Trace) -> None:
    found = rehearse(trace, PROGRAM, {"winks.lrp": WINKS}, 99.0, ahead_s=1.0)
    assert (found.at_s, found.until_s) == (3.63, 4.63)


def test_text_with_mistakes_is_refused_with_its_line(trace: Trace) -> None:
    with pytest.raises(ParameterError, match="Line 10: There is no state 'stoped' here"):
        rehearse(trace, PROGRAM.replace("halt forward -> stopped", "halt forward -> stoped"), {"winks.lrp": WINKS}, 1.0)


@pytest.mark.parametrize("at_s", [-1.0, float("nan")])
def test_moment_before_the_run_is_refused(trace: Trace, at_s: float) -> None:
    with pytest.raises(ParameterError, match="A run has no moment"):
        rehearse(trace, PROGRAM, {}, at_s)


def test_unknown_machine_is_refused_with_the_names(trace: Trace) -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'dora'"):
        rehearse(trace, PROGRAM, {}, 1.0, "dara")


def test_run_on_the_wall_clock_is_refused(trace: Trace) -> None:
    real = replace(trace, header=structs.replace(trace.header, clock="wall"))
    with pytest.raises(ParameterError, match="so it cannot be run again"):
        rehearse(real, PROGRAM, {}, 1.0)


def test_run_that_does_not_repeat_is_refused(trace: Trace) -> None:
    other = replace(trace, header=structs.replace(trace.header, seed=5))
    with pytest.raises(ParameterError, match="has other changes of state"):
        rehearse(other, PROGRAM, {"winks.lrp": WINKS}, 3.0)
