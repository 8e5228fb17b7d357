"""Guarded edits: a program that fails soon after an edit is replaced by the one before, and the replay is exact."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from snr_sim import Config, ListReplayerFactory, Node, Page, SimClock, SimRunner, TimeoutLoopFactory, tasks
from snr_sim.behaviors import Bridge, Drive, Read, machine_parts, parse
from snr_sim.core.lockstep import LockStep
from snr_sim.prelude.errors import ParameterError
from snr_sim.recording.reader import read_trace
from snr_sim.recording.records import InputRecord
from snr_sim.recording.replay import replay_node
from snr_sim.recording.trace import FILE_NAME, TraceWriter
from snr_sim.scenario.machine_controller import guard_edits
from snr_sim.scenario.program import program_header

BRIDGE = Bridge({"depth": Read("depth", "depth_m")}, {"up": Drive("thrust", "up_n", -50.0, 50.0)})
DEPTHS = [{"depth_m": 0.1 * (i % 20)} for i in range(60)]
GOOD = """(machine diver
  (event deep [robot.depth.read() is not None and robot.depth.read() > 1.0])
  (state sinking (onentry [robot.up.start(0)]))
  (state rising (onentry [robot.up.start(5)]))
  (on deep sinking -> rising)
  (ontime 300 rising -> sinking))
(spawn diver sinking)
"""
OTHER = GOOD.replace("start(5)", "start(7)")
BAD_SOON = GOOD.replace("start(5)", "start(1 / 0)")  # fails in 'rising' only
BAD = GOOD.replace("robot.depth.read() > 1.0", "robot.depth.read() > 1.0 / 0")  # fails at once


def edit_at(time_s: float, text: str) -> TimeoutLoopFactory:
    return TimeoutLoopFactory(time_s, task=tasks.event("diver.edit", [text]), name=f"edit at {time_s}")


def config(*more: Any, guard_s: float | None = 1.0, text: str = GOOD) -> Config:
    diver = machine_parts(parse(text, BRIDGE.parts), "diver", bridge=BRIDGE)
    made = Config(factories={"r": [ListReplayerFactory(DEPTHS, "depth", rate_hz=10.0), *diver, *more]})
    if guard_s is not None:
        guard_edits(made, guard_s)
    return made


def run(*more: Any, until_s: float = 3.0, **options: Any) -> tuple[Node, list[tuple[float, str, list[str]]]]:
    """Return the node, and time, text and notes of each program that runs."""
    clock = SimClock()
    node = Node("r", config(*more, **options), clock=clock)
    programs: list[tuple[float, str, list[str]]] = []
    diver: Any = node.components["diver"]

    def note(page: Any) -> None:
        if page.data["ok"]:
            programs.append((round(clock.now_s(), 6), diver.interpreter.program.text, page.data["notes"]))

    node.add_store_listener("diver.edited", note)
    LockStep([node], clock, until_s=until_s).run()
    return node, programs


def test_program_that_fails_soon_after_an_edit_is_replaced_by_the_one_before() -> None:
    node, programs = run(edit_at(0.5, BAD_SOON))
    (first, _, _), (second, text, (note,)) = programs
    assert (first, text) == (0.5, GOOD)
    assert second == 1.1, "in the step in which it fails"
    assert note.startswith("The program before an edit is back: line 4: [robot.up.start(1 / 0)] failed: ZeroDivision")
    assert any("has the program before an edit again: line 4" in one for one in node.report.notes)
    assert node.get_data("diver")["program"] == 3


def test_program_that_fails_later_continues() -> None:
    _, programs = run(edit_at(0.05, BAD_SOON))
    assert [text for _, text, _ in programs] == [BAD_SOON]


def test_without_a_guard_a_program_that_fails_continues() -> None:
    _, programs = run(edit_at(0.5, BAD), guard_s=None)
    assert [text for _, text, _ in programs] == [BAD]


def test_page_failsafe_puts_the_program_before_back() -> None:
    def failsafe(data: object) -> Any:
        return TimeoutLoopFactory(0.8, task=tasks.store_page(Page("failsafe", data, "r_node", 0.8)))

    _, programs = run(edit_at(0.5, OTHER), failsafe(True))
    assert [(at, text) for at, text, _ in programs] == [(0.5, OTHER), (0.8, GOOD)]
    assert programs[1][2] == ["The program before an edit is back: page 'failsafe' came"]
    _, programs = run(edit_at(0.5, OTHER), failsafe(False))
    assert len(programs) == 1


def test_failure_that_the_program_before_had_as_well_is_not_of_the_edit() -> None:
    _, programs = run(edit_at(0.5, BAD.replace("start(5)", "start(6)")), text=BAD)
    assert len(programs) == 1


def test_programs_of_quick_edits_are_taken_back_one_after_the_other() -> None:
    both = BAD.replace("> 1.0 / 0", "> 2.0 / 0")
    _, programs = run(edit_at(0.5, OTHER), edit_at(0.501, BAD), edit_at(0.502, both))
    assert [(at, text) for at, text, _ in programs] == [
        (0.5, OTHER), (0.501, BAD), (0.502, both), (0.51, BAD), (0.52, OTHER),
    ]  # fmt: skip


def test_edit_that_comes_before_the_program_is_put_back_wins() -> None:
    failing = [tasks.event("diver.step"), tasks.event("diver.edit", [OTHER])]  # both at once
    node, programs = run(edit_at(0.5, BAD), TimeoutLoopFactory(0.505, task=failing))
    assert [text for _, text, _ in programs] == [BAD, OTHER]
    assert node.get_data("diver.edited")["problems"][0]["message"] == "Another edit came first."


def recorded(folder: Path, make: Callable[[], Config]) -> Any:
    folder.mkdir()
    clock, made = SimClock(), make()
    writer = TraceWriter(folder / FILE_NAME, program_header(["r"], made, __file__, clock))
    try:
        SimRunner(made, clock=clock, recorder=writer, until_s=4.0).run()
    finally:
        writer.close()
    return read_trace(folder / FILE_NAME)


def test_run_is_replayed_exactly_without_a_guard(tmp_path: Path) -> None:
    def make() -> Config:
        return config(edit_at(0.5, BAD_SOON), edit_at(1.5, OTHER), edit_at(2.0, BAD))

    one, two = (recorded(tmp_path / name, make) for name in ("one", "two"))
    assert one.digest == two.digest
    put_back = [one for one in one.records if isinstance(one, InputRecord) and one.source == "diver.guard"]
    assert len(put_back) == 2
    assert b"failed: ZeroDivisionError" in bytes(put_back[0].values)
    replayed = replay_node(one, "r", config(guard_s=None))
    assert replayed.is_identical, replayed.divergences


@pytest.mark.parametrize("guard_s", [0.0, -1.0, float("inf"), float("nan")])
def test_invalid_time_is_refused(guard_s: float) -> None:
    with pytest.raises(ParameterError, match="--guard must be greater than 0"):
        guard_edits(config(guard_s=None), guard_s)


def test_run_without_a_machine_is_refused() -> None:
    with pytest.raises(ParameterError, match="and this run has none"):
        guard_edits(Config(factories={"r": []}), 3.0)
