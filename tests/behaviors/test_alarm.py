"""Machines without a clock: exact time-outs, no steps while nothing happens, and what they cannot do."""

from __future__ import annotations

import time
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from snr_sim import Config, ListReplayerFactory, Node, SimClock, SimRunner, TimeoutLoopFactory, WallClock, tasks
from snr_sim.behaviors import Bridge, Drive, MachineFactory, Program, Read, after, machine, machine_parts, parse, state
from snr_sim.behaviors.program import ProgramError
from snr_sim.core.lockstep import LockStep
from snr_sim.prelude.task import TaskType
from snr_sim.recording.reader import Trace, read_trace
from snr_sim.recording.records import InputRecord, PageRecord
from snr_sim.recording.replay import replay_node
from snr_sim.recording.trace import FILE_NAME, TraceWriter
from snr_sim.scenario.program import program_header
from snr_sim.testing.function_components import FunctionEndpointFactory
from tests.slowness import slowness

BRIDGE = Bridge(
    {"depth": Read("depth", "depth_m", fresh_s=0.25), "load": Read("load", "kg"), "heading": Read("heading", "rad")},
    {"up": Drive("thrust", "up_n", -50.0, 50.0, repeat_s=0.2), "light": Drive("light", "on", 0.0, 1.0)},
)
LAMP = """(var off_ms := [333])
(machine lamp
  (event press)
  (state lit (onentry [robot.light.start(1)]))
  (state dark (onentry [robot.light.stop()]))
  (on press lit -> dark)
  (ontime 1001 lit -> dark)
  (ontime off_ms dark -> lit))
(spawn lamp lit)
"""
DIVER = """(machine diver
  (event deep [robot.depth.read() is not None and robot.depth.read() > 1.0])
  (state sinking (onentry [robot.up.stop()]))
  (state rising (onentry [robot.up.start(20)]))
  (state lost (onentry [robot.up.start(-5)]))
  (on deep sinking -> rising)
  (on [robot.depth.read() is not None and robot.depth.read() < 0.5] rising -> sinking)
  (on [robot.depth.read() is None and robot.heading.read() == 1] * -> lost))
(spawn diver sinking)
"""


def parts(text: str, *more: Any, name: str = "") -> list[Any]:
    program = parse(text, BRIDGE.parts)
    name = name or program.spawns[0].machine.name
    return [*machine_parts(program, name, step_hz=0, bridge=BRIDGE), *more]


def event_at(time_s: float, name: str, *values: Any) -> TimeoutLoopFactory:
    return TimeoutLoopFactory(time_s, task=tasks.event(name, list(values)), name=f"{name} at {time_s}")


def page_at_first(key: str, data: Any) -> ListReplayerFactory:
    return ListReplayerFactory([data], key, rate_hz=1.0)


def record(folder: Path, factories: list[Any], until_s: float = 3.0, clock: Any = None) -> Trace:
    folder.mkdir()
    clock, config = clock or SimClock(), Config(factories={"r": factories})
    writer = TraceWriter(folder / FILE_NAME, program_header(["r"], config, __file__, clock))
    try:
        SimRunner(config, clock=clock, recorder=writer, until_s=until_s).run()
    finally:
        writer.close()
    return read_trace(folder / FILE_NAME)


def changes(factories: list[Any], until_s: float = 3.0) -> list[tuple[int, str]]:
    """Return time [ns] and target of each transition."""
    found: list[tuple[int, str]] = []

    def note(task: Any, task_id: Any) -> None:
        found.append((task.val_list[0]["t_ns"], task.val_list[0]["target"]))

    name = factories[1].name
    listener = FunctionEndpointFactory({(TaskType.event, f"{name}.transition"): note}, "listener")
    clock = SimClock()
    LockStep([Node("r", Config(factories={"r": [*factories, listener]}), clock=clock)], clock, until_s=until_s).run()
    return found


def steps(trace: Trace) -> list[float]:
    """Return the times of the steps that the alarm has caused."""
    return [one.t for one in trace.records if isinstance(one, InputRecord) and one.source.endswith(".alarm")]


MS = 1_000_000


def test_time_outs_are_exact_to_the_nanosecond() -> None:
    period = 1334 * MS
    assert changes(parts(LAMP)) == [
        (0, "lit"), (1001 * MS, "dark"), (period, "lit"), (period + 1001 * MS, "dark"), (2 * period, "lit"),
    ]  # fmt: skip


def test_signal_causes_a_step_and_cancels_the_time_out(tmp_path: Path) -> None:
    assert changes(parts(LAMP, event_at(0.9, "press"))) == [
        (0, "lit"), (900 * MS, "dark"), (1233 * MS, "lit"), (2234 * MS, "dark"), (2567 * MS, "lit"),
    ]  # fmt: skip
    trace = record(tmp_path / "run", parts(LAMP, event_at(0.9, "press")))
    assert steps(trace) == [1.233, 2.234, 2.567], "no step is left from the time-out at 1.001 s"


def test_machine_in_which_nothing_happens_adds_no_tasks(tmp_path: Path) -> None:
    idle = LAMP.replace("(ontime 1001 lit -> dark)", "(on press dark -> lit)")
    counts = {until_s: len(record(tmp_path / str(until_s), parts(idle), until_s).records) for until_s in (1.0, 100.0)}
    assert counts[1.0] == counts[100.0]


def test_node_of_an_idle_machine_ends_as_nothing_is_left_to_do() -> None:
    idle = parts(LAMP.replace("(ontime 1001 lit -> dark)", ""))
    clock = SimClock()
    node = Node("r", Config(factories={"r": idle}), clock=clock)
    LockStep([node], clock).run()
    assert (clock.now_s(), clock.next_s) == (0.0, None)
    assert not any("alarm" in note for note in node.report.notes)


def test_page_that_a_condition_reads_causes_a_step_and_no_other_page_does() -> None:
    depths = ListReplayerFactory([{"depth_m": 0.3 * i} for i in range(6)], "depth", rate_hz=10.0)
    assert changes(parts(DIVER, depths), 0.6) == [(0, "sinking"), (400 * MS, "rising")]
    clock = SimClock()
    node = Node("r", Config(factories={"r": parts(DIVER)}), clock=clock)
    handled = {name for kind, name in node.components["diver"].task_handlers if kind is TaskType.process_data}
    assert handled == {"depth", "heading"}


def test_reading_that_becomes_too_old_causes_a_step() -> None:
    factories = parts(DIVER, page_at_first("depth", {"depth_m": 0.1}), page_at_first("heading", {"rad": 1}))
    assert changes(factories) == [(0, "sinking"), (250 * MS + 1000, "lost")]


def test_condition_that_holds_already_is_looked_at_a_hundredth_of_a_second_later() -> None:
    depths = page_at_first("load", {"kg": 2})
    text = """(machine m (event go) (state a) (state b) (state c)
      (on go a -> b) (on [robot.load.read() == 2] b -> c) (on [robot.load.read() == 2] c -> b))(spawn m a)"""
    assert changes(parts(text, depths, event_at(0.5, "go")), 0.525) == [
        (0, "a"), (500 * MS, "b"), (510 * MS, "c"), (520 * MS, "b"),
    ]  # fmt: skip


def test_command_is_repeated_without_a_clock(tmp_path: Path) -> None:
    text = "(machine m (state a (onentry [robot.up.start(9)])))(spawn m a)"
    trace = record(tmp_path / "run", parts(text), 1.0)
    stored = [one.t for one in trace.records if isinstance(one, PageRecord) and one.name == "thrust"]
    assert [round(one, 3) for one in stored] == [0.0, 0.2, 0.4, 0.6, 0.8]


def test_change_of_the_variable_of_a_time_out_sets_the_alarm_again(tmp_path: Path) -> None:
    sets = [event_at(1.1, "lamp.set", "off_ms", 500), event_at(2.6, "lamp.set", "off_ms", 20)]
    found = changes(parts(LAMP, *sets))
    assert found == [(0, "lit"), (1001 * MS, "dark"), (1501 * MS, "lit"), (2502 * MS, "dark"), (2600 * MS, "lit")]
    assert steps(record(tmp_path / "run", parts(LAMP, *sets))) == [1.001, 1.501, 2.502]


def test_edit_sets_the_alarm_again(tmp_path: Path) -> None:
    edits = [
        event_at(0.2, "lamp.edit", LAMP.replace("1001", "700")),
        event_at(0.9, "lamp.edit", LAMP.replace("[333]", "[150]")),
    ]
    found = changes(parts(LAMP, *edits), 1.2)
    assert found == [(0, "lit"), (700 * MS, "dark"), (900 * MS, "lit")]
    assert steps(record(tmp_path / "run", parts(LAMP, *edits), 1.2)) == [0.7]


def test_alarm_stands_still_while_the_machine_is_paused(tmp_path: Path) -> None:
    holds = [event_at(0.5, "lamp.pause"), event_at(1.75, "lamp.go")]
    assert changes(parts(LAMP, *holds), 2.4) == [(0, "lit"), (2251 * MS, "dark")]
    assert steps(record(tmp_path / "run", parts(LAMP, *holds), 2.4)) == [2.251]


def test_edited_run_is_replayed_without_a_difference(tmp_path: Path) -> None:
    def factories() -> list[Any]:
        depths = ListReplayerFactory([{"depth_m": 0.1 * (i % 17)} for i in range(40)], "depth", rate_hz=10.0)
        texts = [DIVER, DIVER.replace("> 1.0", "> 0.7"), "(machine", DIVER.replace("diver", "other"), LAMP]
        edits = [event_at(0.33 * i, "diver.edit", text) for i, text in enumerate(texts, 1)]
        return parts(DIVER, depths, *edits, event_at(2.0, "diver.pause"), event_at(2.2, "diver.go"), name="diver")

    one, two = (record(tmp_path / name, factories(), 6.0) for name in ("one", "two"))
    assert one.digest == two.digest
    replayed = replay_node(one, "r", Config(factories={"r": factories()}))
    assert replayed.is_identical, replayed.divergences
    assert len(steps(one)) > 5


def test_table_in_python_takes_its_time_outs() -> None:
    blink: Program = machine("blink", "lit", [state("lit", after(0.7, to="dark")), state("dark", after(0.1, to="lit"))])
    found = changes(machine_parts(blink, "blink", step_hz=0), 1.6)
    assert found == [(0, "lit"), (700 * MS, "dark"), (800 * MS, "lit"), (1500 * MS, "dark"), (1600 * MS, "lit")]


ONE = "(machine m (state a {}) (state b)\n {} a -> b))(spawn m a)"


@pytest.mark.parametrize(
    ("clause", "arrow", "place", "message"),
    [
        ("(running [log('x')])", "(ontime 10", (1, 31), "cannot execute (running ...)"),
        ("", "(on [in_state_ms > 50]", (2, 7), "no steps in which in_state_ms changes"),
        ("", "(on [now_ms > 50]", (2, 7), "no steps in which now_ms changes"),
        ("", "(on [random() > 0.5]", (2, 7), "no steps in which random() changes"),
        ("", "(on [robot.load.age_ms() > 50]", (2, 7), "no steps in which robot.load.age_ms() changes"),
        ("", "(ontime [10 * random()]", (2, 11), "no steps in which random() changes"),
    ],
)
def test_program_that_polls_is_refused_with_its_line(
    clause: str, arrow: str, place: tuple[int, int], message: str
) -> None:
    text = ONE.format(clause, arrow)
    with pytest.raises(ProgramError) as caught:
        parts(text)
    (problem,) = caught.value.problems
    assert message in problem.message
    assert "step_hz=100" in problem.fix
    assert (problem.place.line, problem.place.column) == place
    machine_parts(parse(text, BRIDGE.parts), "m", bridge=BRIDGE)  # with a clock it runs


def test_helper_that_polls_is_refused() -> None:
    with pytest.raises(ProgramError, match="in which now_ms changes"):
        parts("(def late [now_ms > 100])\n" + ONE.format("", "(on [late()]"))


def test_edit_that_polls_is_refused_and_the_program_continues() -> None:
    clock = SimClock()
    edit = event_at(0.5, "lamp.edit", LAMP.replace("(state dark", "(state dark (running [log('x')])"))
    node = Node("r", Config(factories={"r": parts(LAMP, edit)}), clock=clock)
    LockStep([node], clock, until_s=1.1).run()
    answer = node.get_data("lamp.edited")
    assert (answer["ok"], answer["program"], answer["problems"][0]["line"]) == (False, 1, 5)
    assert node.get_data("lamp")["active"] == {"lamp": "dark"}


def test_factory_without_an_alarm_takes_any_program() -> None:
    assert MachineFactory(parse(ONE.format("", "(on [now_ms > 50]"))).has_alarm is False


@pytest.mark.slow
@pytest.mark.wall_clock
def test_alarm_on_the_wall_clock_comes_when_it_is_due() -> None:
    found: list[float] = []

    def note(task: Any, task_id: Any) -> None:
        found.append(task.val_list[0]["t_ns"] / 1e9)

    text = LAMP.replace("1001", "101").replace("[333]", "[33]")
    listener = FunctionEndpointFactory({(TaskType.event, "lamp.transition"): note}, "listener")
    factories = [*parts(text), listener, event_at(0.35, "press"), TimeoutLoopFactory(seconds=1.0)]
    begun_s = time.process_time()
    Node("r", Config(factories={"r": factories}), clock=WallClock()).loop()
    held_s = [round(later - earlier, 3) for earlier, later in pairwise(found)]
    assert len(held_s) >= 10
    assert all(one >= 0.033 for one in held_s)
    assert sorted(held_s)[len(held_s) // 4] < 0.06, held_s
    assert time.process_time() - begun_s < 0.5 * slowness(), "it sleeps between the alarms"
