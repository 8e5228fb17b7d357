"""Replay: the same code gives the same results, and every change is found at its first effect."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from snr_sim import Config, SimClock, SimRunner, Task, TaskType, tasks
from snr_sim.devices.commands import ActuatorLoopFactory
from snr_sim.prelude.errors import ComponentFailedError
from snr_sim.recording.checker import MAX_FOLLOW_UPS, NodeReplay
from snr_sim.recording.compare import Tolerance
from snr_sim.recording.reader import Trace, read_trace
from snr_sim.recording.records import EndRecord, ErrorRecord, TaskRecord, encode_record
from snr_sim.recording.replay import replay_node
from snr_sim.recording.trace import FILE_NAME, TraceWriter
from snr_sim.scenario.program import program_header
from snr_sim.scenario.simulation import prepare, request_of
from snr_sim.testing.function_components import FunctionEndpoint, FunctionEndpointFactory, FunctionLoopFactory

AT = 7  # the tick at which the mutants of this file begin to differ


def on(kind: str, name: str) -> tuple[TaskType, str]:
    return (TaskType(kind), name)


class Robot:
    """A small robot: a sensor, a filter, a pilot with an actuator, and a logger; mutants override one thing."""

    has_logger = True

    def factories(self) -> list[Any]:
        self.parts: dict[str, Any] = {}
        parts = {
            "filter": {on("process_data", "depth"): self.on_depth},
            "pilot": {on("process_data", "smooth"): self.on_smooth, on("event", "thought"): self.on_thought},
            "logger": {on("process_data", "thrust"): self.on_thrust},
        }
        if not self.has_logger:
            del parts["logger"]
        made = [self.part(name, handlers) for name, handlers in parts.items()]
        sensor = FunctionLoopFactory(
            lambda loop: loop.store_data("depth", math.sin(loop.get_time_s())), "depth_sensor", 10.0
        )
        return [sensor, *made, ActuatorLoopFactory("thrust", lambda: NoThruster(), 10.0)]

    def part(self, name: str, handlers: dict[Any, Any]) -> FunctionEndpointFactory:
        def begin(part: Any) -> None:
            self.parts[name] = part
            getattr(self, f"begin_{name}", lambda part: None)(part)

        return FunctionEndpointFactory(handlers, name, begin=begin)

    def begin_pilot(self, part: Any) -> None:
        part.schedule(tasks.event("thought", [0]))

    def on_depth(self, task: Any, task_id: Any) -> Any:
        part = self.parts["filter"]
        part.ticks = getattr(part, "ticks", -1) + 1
        noisy = part.get_data("depth") + 0.1 * part.rng.standard_normal()
        return part.store_data_task("smooth", {"depth_m": self.smooth(part, noisy), "tick": part.ticks})

    def smooth(self, part: Any, noisy: float) -> Any:
        return noisy

    def on_smooth(self, task: Any, task_id: Any) -> Any:
        part = self.parts["pilot"]
        smooth = part.get_data("smooth")
        thrust = part.store_data_task("thrust", {"thrust_n": -5.0 * smooth["depth_m"]})
        return self.answer(part, smooth["tick"], [thrust, tasks.event("thought", [smooth["tick"]])])

    def answer(self, part: Any, tick: int, usual: list[Any]) -> Any:
        return usual

    def on_thought(self, task: Any, task_id: Any) -> Any:
        return None

    def on_thrust(self, task: Any, task_id: Any) -> Any:
        return None


class NoThruster:
    """Ignores commands: these tests do not check its motion."""

    def neutral(self) -> None: ...
    def close(self) -> None: ...


def record(robot: Robot, path: Path, until_s: float = 2.0) -> Trace:
    factories = [one for one in robot.factories() if not isinstance(one, ActuatorLoopFactory)]
    config = Config(factories={"r": factories})
    clock = SimClock()
    header = program_header(["r"], Config(factories={"r": robot.factories()}), __file__, clock)
    writer = TraceWriter(path / FILE_NAME, header)
    try:
        SimRunner(config, clock=clock, recorder=writer, until_s=until_s).run()
    finally:
        writer.close()
    return read_trace(path / FILE_NAME)


def replay(trace: Trace, robot: Robot, *tolerances: str) -> NodeReplay:
    return replay_node(trace, "r", Config(factories={"r": robot.factories()}), [Tolerance.parse(t) for t in tolerances])


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Trace:
    return record(Robot(), tmp_path_factory.mktemp("robot"))


def seq_of(trace: Trace, name: str, nth: int = AT) -> int:
    """Return the seq of the nth processing of a page."""
    found = [one for one in trace.records if isinstance(one, TaskRecord) and one.name == name]
    return found[nth].seq


# The same code does the same


class Counting:
    """A robot that asks for its next event in each one, and sets the terminate flag in the hundredth."""

    def factories(self) -> list[Any]:
        def count(task: Task, task_id: Any) -> Task:
            (number,) = task.val_list
            if number == 100:
                parts[0].parent.set_terminate_flag("enough")
            return tasks.event("count", [number + 1])

        def begin(part: FunctionEndpoint) -> None:
            parts.append(part)
            part.schedule(tasks.event("count", [1]))

        parts: list[FunctionEndpoint] = []
        return [FunctionEndpointFactory({(TaskType.event, "count"): count}, "counting", begin=begin)]


def test_run_ended_by_terminate_flag_replays_identically(tmp_path: Path) -> None:
    robot: Any = Counting()
    trace = record(robot, tmp_path)
    replayed = replay(trace, robot)
    assert replayed.is_identical, replayed.divergences
    assert [one.reason for one in trace.records if isinstance(one, EndRecord)] == ["enough"]
    assert replayed.executed < 150


@pytest.mark.parametrize(
    ("scenario", "controller"),
    [
        *(("lander_vertical", name) for name in ("coast", "hover_and_drop", "quadratic", "optimal")),
        ("lander_low_gate", "optimal"),
        ("lander_pad", "pad"),
        ("lander_rough", "pad"),
    ],
)
def test_every_controller_replays_identically(
    record_scenario: Callable[..., Trace], scenario: str, controller: str
) -> None:
    for seed in (0, 1, 12) if scenario in ("lander_vertical", "lander_low_gate") else (0, 5):
        trace = record_scenario(scenario, controller, seed)
        config = prepare(request_of(trace.trace_info, trace.header)).config(None)
        replayed = replay_node(trace, "lander", config)
        assert replayed.is_identical, (seed, replayed.divergences[0])
        assert replayed.executed == replayed.recorded > 200


def test_replay_records_equal_recorded_records(recorded: Trace) -> None:
    expected = [encode_record(one) for one in recorded.records if not isinstance(one, EndRecord)]
    for _ in range(5):
        replayed = replay(recorded, Robot())
        assert replayed.is_identical
        assert [encode_record(one) for one in replayed.records] == expected


def test_truncated_trace_replays_up_to_its_end(recorded: Trace, tmp_path: Path) -> None:
    data = recorded.path.read_bytes()
    for length in range(len(data) // 2, len(data) // 2 + 2000, 61):
        path = tmp_path / f"{length}.jsonl"
        path.write_bytes(data[:length])
        replayed = replay(read_trace(path), Robot())
        assert replayed.is_identical, replayed.divergences[0]
        assert replayed.executed == replayed.recorded


def test_run_ended_with_queued_tasks_replays_identically(tmp_path: Path) -> None:
    class Restless(Robot):
        def on_thought(self, task: Any, task_id: Any) -> Any:
            ticks = self.parts["pilot"].get_data("smooth")
            done = [tasks.terminate("done")] if ticks and ticks["tick"] == 5 and task.val_list[0] != -1 else []
            return [*done, *([tasks.event("thought", [-1])] if done or task.val_list[0] == -1 else [])]

    trace = record(Restless(), tmp_path)
    assert any(
        "tasks undone" in note for one in trace.records if hasattr(one, "summary") for note in one.summary["notes"]
    )
    replayed = replay(trace, Restless())
    assert replayed.is_identical, replayed.divergences[0]
    assert replayed.executed == replayed.recorded


# Mutants: a changed robot, and the expected report


def smooths(name: str, change: Callable[[float], Any]) -> type[Robot]:
    """Return a mutant whose filter makes something else of the noisy depth."""
    return type(name, (Robot,), {"smooth": lambda self, part, noisy: change(noisy) if part.ticks >= AT else noisy})


def answers(name: str, change: Callable[[Any, list[Any]], Any]) -> type[Robot]:
    """Return a mutant whose pilot returns something else than [thrust, thought]."""

    def answer(self: Robot, part: Any, tick: int, usual: list[Any]) -> Any:
        return change(part, usual) if tick >= AT else usual

    return type(name, (Robot,), {"answer": answer})


OtherConstant = smooths("OtherConstant", lambda noisy: noisy * 1.0000001)
AddsNan = smooths("AddsNan", lambda noisy: math.nan)
AnswersArray = smooths("AnswersArray", np.float64)
OtherThrust = answers("OtherThrust", lambda part, usual: [part.store_data_task("thrust", {"thrust_n": 0.0}), usual[1]])
OtherField = answers("OtherField", lambda part, usual: [part.store_data_task("thrust", {"thrust_N": 0.0}), usual[1]])
NoThrust = answers("NoThrust", lambda part, usual: usual[1])
NoOutput = answers("NoOutput", lambda part, usual: None)
ExtraEvent = answers("ExtraEvent", lambda part, usual: [*usual, tasks.event("surprise")])
DuplicateOutput = answers("DuplicateOutput", lambda part, usual: [usual[0], *usual])
OtherOrder = answers("OtherOrder", lambda part, usual: usual[::-1])
OtherName = answers("OtherName", lambda part, usual: [usual[0], tasks.event("idea", usual[1].val_list)])
Raises = answers("Raises", lambda part, usual: [usual[0], 1 / 0])
Exits = answers("Exits", lambda part, usual: exit(3))
ReturnsText = answers("ReturnsText", lambda part, usual: "thought")


class AnswersText(smooths("AnswersText", str)):  # type: ignore[misc]
    def on_smooth(self, task: Any, task_id: Any) -> Any:
        return None if self.parts["filter"].ticks >= AT else super().on_smooth(task, task_id)


class DrawsTwice(Robot):
    def smooth(self, part: Any, noisy: float) -> Any:
        if part.ticks == AT - 1:
            part.rng.random()
        return noisy


class EndlessEvents(Robot):
    """One more task that asks for itself again and again, and takes the place of what was there."""

    def answer(self, part: Any, tick: int, usual: list[Any]) -> Any:
        return [tasks.event("spin")] if tick >= AT else usual

    def part(self, name: str, handlers: dict[Any, Any]) -> FunctionEndpointFactory:
        if name == "logger":
            handlers = {on("event", "spin"): lambda task, task_id: [task, task], **handlers}
        return super().part(name, handlers)


class LosesHandler(Robot):
    def answer(self, part: Any, tick: int, usual: list[Any]) -> Any:
        if tick == AT - 1:
            self.parts["logger"].task_handlers.clear()
        return usual


class LosesPilot(Robot):
    def smooth(self, part: Any, noisy: float) -> Any:
        if part.ticks == AT:
            self.parts["pilot"].task_handlers.clear()
        return noisy


class GainsHandler(Robot):
    def smooth(self, part: Any, noisy: float) -> Any:
        if part.ticks == AT:
            self.parts["logger"].task_handlers[on("process_data", "smooth")] = lambda task, task_id: None
        return noisy


# (mutant, class, page whose processing differs, component, handler, field, recorded, replayed; ... is not looked at)
MUTANTS: list[tuple[type[Robot], str, str, str, str, str, Any, Any, bool]] = [
    (OtherConstant, "value", "depth", "filter", "on_depth", "smooth.depth_m", ..., ..., False),
    (AddsNan, "value", "depth", "filter", "on_depth", "smooth.depth_m", ..., math.nan, False),
    (AnswersText, "value", "depth", "filter", "on_depth", "smooth.depth_m", ..., ..., False),
    (AnswersArray, "value", "depth", "filter", "on_depth", "smooth.depth_m", ..., ..., False),
    (DrawsTwice, "value", "depth", "filter", "on_depth", "smooth.depth_m", ..., ..., False),
    (OtherThrust, "value", "smooth", "pilot", "on_smooth", "thrust.thrust_n", ..., 0.0, True),
    (OtherField, "value", "smooth", "pilot", "on_smooth", "thrust.thrust_n", ..., "(absent)", True),
    (NoThrust, "missing", "smooth", "pilot", "on_smooth", "store_page thrust", "store_page thrust", None, True),
    (NoOutput, "missing", "smooth", "pilot", "on_smooth", "store_page thrust", "store_page thrust", None, True),
    (ExtraEvent, "extra", "smooth", "pilot", "on_smooth", "event surprise", None, "event surprise", False),
    (DuplicateOutput, "extra", "smooth", "pilot", "on_smooth", "store_page thrust", None, "store_page thrust", True),
    (OtherOrder, "reordered", "smooth", "pilot", "on_smooth", "order",
     ["store_page thrust", "event thought"], ["event thought", "store_page thrust"], False),
    (OtherName, "missing", "smooth", "pilot", "on_smooth", "event thought", "event thought", None, False),
    (Raises, "raised", "smooth", "pilot", "on_smooth", "exception", "no exception", ..., False),
    (Exits, "raised", "smooth", "pilot", "on_smooth", "exception", "no exception", ..., False),
    (ReturnsText, "raised", "smooth", "pilot", "on_smooth", "exception", "no exception", ..., False),
    (EndlessEvents, "missing", "smooth", "pilot", "on_smooth", "store_page thrust", "store_page thrust", None, True),
    (LosesHandler, "missing", "thrust", "logger", "on_thrust", "the handler itself", "called", "not called", False),
    (LosesPilot, "missing", "smooth", "pilot", "on_smooth", "store_page thrust", "store_page thrust", None, True),
    (GainsHandler, "extra", "smooth", "logger", "<lambda>", "the handler itself", "not called", "called", False),
]  # fmt: skip


@pytest.mark.parametrize("case", MUTANTS, ids=lambda case: case[0].__name__)
def test_mutant_diverges_at_first_differing_record(recorded: Trace, case: Any) -> None:
    mutant, kind, page, component, handler, field, then, now, is_command = case
    replayed = replay(recorded, mutant())
    assert not replayed.is_identical
    first = replayed.divergences[0]
    assert (first.kind, first.component, first.handler, first.field) == (kind, component, handler, field)
    nth = AT - 1 if mutant is LosesHandler else AT
    assert first.seq == seq_of(recorded, page, nth)
    assert first.t == pytest.approx(nth / 10.0)
    assert first.node == "r_node"
    assert first.task == f"process_data '{page}'"
    assert first.is_command == is_command
    for expected, found in ((then, first.recorded), (now, first.replayed)):
        assert expected is ... or repr(expected) == repr(found)


@pytest.mark.parametrize("mutant", [Raises, Exits, ReturnsText])
def test_new_exception_reports_the_students_line(recorded: Trace, mutant: type[Robot]) -> None:
    first = replay(recorded, mutant()).divergences[0]
    if mutant is Raises:
        assert "test_replay.py, line" in first.replayed
        assert "ZeroDivisionError: division by zero" in first.replayed
    else:
        assert ("SystemExit: 3" if mutant is Exits else "'pilot.on_smooth' returned 'thought'") in first.replayed


def test_causes_list_the_chain_from_input_to_task(recorded: Trace) -> None:
    first = replay(recorded, OtherThrust()).divergences[0]
    input_line, *steps = first.causes
    assert "depth_sensor brought store_page 'depth'" in input_line
    assert [step.split(": ", 1)[1] for step in steps] == [
        "store_page 'depth' went to node_core.store",
        "process_data 'depth' went to filter.on_depth",
        "store_page 'smooth' went to node_core.store",
        "process_data 'smooth' went to pilot.on_smooth",
    ]
    assert steps[-1].startswith(f"seq {first.seq}:")


def test_endless_task_chain_is_limited(recorded: Trace) -> None:
    replayed = replay(recorded, EndlessEvents())
    roots = len({one.seq for one in replayed.divergences if one.field == "event spin"})
    assert roots == 21 - AT
    assert replayed.executed < replayed.recorded + (roots + 1) * (MAX_FOLLOW_UPS + 1)


def test_missing_or_extra_component_diverges(recorded: Trace) -> None:
    class NoLogger(Robot):
        has_logger = False

    class Greeter(Robot):
        def part(self, name: str, handlers: dict[Any, Any]) -> FunctionEndpointFactory:
            name = "greeter" if name == "logger" else name
            return super().part(name, handlers)

    first = replay(recorded, NoLogger()).divergences[0]
    assert (first.kind, first.component, first.seq) == ("missing", "logger", seq_of(recorded, "thrust", 0))
    kinds = {(one.kind, one.component) for one in replay(recorded, Greeter()).divergences}
    assert kinds == {("missing", "logger"), ("extra", "greeter")}


def test_renamed_handler_replays_identically(recorded: Trace) -> None:
    class Renamed(Robot):
        def part(self, name: str, handlers: dict[Any, Any]) -> FunctionEndpointFactory:
            def other_name(task: Any, task_id: Any) -> Any:
                return self.on_depth(task, task_id)

            return super().part(name, {on("process_data", "depth"): other_name} if name == "filter" else handlers)

    assert replay(recorded, Renamed()).is_identical


@pytest.mark.parametrize("where", ["begin", "halt"])
def test_new_failure_in_begin_or_halt_diverges_there(recorded: Trace, where: str) -> None:
    class FailsThere(Robot):
        def part(self, name: str, handlers: dict[Any, Any]) -> FunctionEndpointFactory:
            factory = super().part(name, handlers)
            if name == "filter":
                setattr(factory, f"on_{where}", lambda part: 1 / 0)
            return factory

    first = replay(recorded, FailsThere()).divergences[0]
    assert (first.kind, first.component, first.handler) == ("raised", "filter", where)
    assert "ZeroDivisionError" in first.replayed


def test_tasks_scheduled_in_begin_are_compared(recorded: Trace) -> None:
    class BeginsOtherwise(Robot):
        def begin_pilot(self, part: Any) -> None:
            part.schedule(tasks.event("thought", [1]))

    class BeginsSilently(Robot):
        def begin_pilot(self, part: Any) -> None:
            pass

    class BeginsLouder(Robot):
        def begin_filter(self, part: Any) -> None:
            part.schedule(tasks.event("thought", [0]))

    for mutant, kind, component, field in (
        (BeginsOtherwise, "value", "pilot", "thought[0]"),
        (BeginsSilently, "missing", "pilot", "event thought"),
    ):
        first = replay(recorded, mutant()).divergences[0]
        assert (first.kind, first.component, first.handler, first.field) == (kind, component, "begin", field)
        assert first.task == "begin"
    louder = replay(recorded, BeginsLouder()).divergences
    assert [(one.kind, one.component, one.field) for one in louder] == [("extra", "filter", "event thought")]


# Failures that were recorded


class FailsThen(Robot):
    def on_thrust(self, task: Any, task_id: Any) -> Any:
        if self.parts["pilot"].get_data("smooth")["tick"] == AT:
            raise KeyError("thrust_n")


def test_recorded_handler_failure_replays_identically(tmp_path: Path) -> None:
    with pytest.raises(ComponentFailedError, match="KeyError"):
        record(FailsThen(), tmp_path)
    trace = read_trace(tmp_path / FILE_NAME)
    assert isinstance(trace.records[-2], ErrorRecord)
    replayed = replay(trace, FailsThen())
    assert replayed.is_identical, replayed.divergences[0]


def test_fixed_or_other_failure_diverges(tmp_path: Path) -> None:
    class FailsElse(Robot):
        def on_thrust(self, task: Any, task_id: Any) -> Any:
            if self.parts["pilot"].get_data("smooth")["tick"] == AT:
                raise ValueError("thrust_n")

    with pytest.raises(ComponentFailedError, match="KeyError"):
        record(FailsThen(), tmp_path)
    trace = read_trace(tmp_path / FILE_NAME)
    for other, now in ((Robot, "no exception"), (FailsElse, "ValueError")):
        (first,) = replay(trace, other()).divergences
        assert (first.kind, first.component) == ("raised", "logger")
        assert first.seq == seq_of(trace, "thrust")
        assert "KeyError" in first.recorded
        assert now in first.replayed


def test_failed_loop_keeps_difference_of_preceding_task(tmp_path: Path) -> None:
    class LoopFails(Robot):
        def factories(self) -> list[Any]:
            def fail(loop: Any) -> None:
                if loop.get_time_s() > 0.95:
                    raise OSError("cable")

            return [*super().factories(), FunctionLoopFactory(fail, "cable", 10.0)]

    class Silent(LoopFails):
        def on_thought(self, task: Any, task_id: Any) -> Any:
            return tasks.event("more") if task.val_list == [10] else None

    with pytest.raises(ComponentFailedError, match="cable"):
        record(LoopFails(), tmp_path)
    trace = read_trace(tmp_path / FILE_NAME)
    assert replay(trace, LoopFails()).is_identical
    assert [one.kind for one in replay(trace, Silent()).divergences] == ["extra"]


# Tolerances


def test_difference_within_tolerance_is_identical(recorded: Trace) -> None:
    assert replay(recorded, OtherConstant(), "smooth.depth_m=1e-3", "thrust.*=1%").is_identical
    left = replay(recorded, OtherConstant(), "smooth.depth_m=1e-3")
    assert {one.field for one in left.divergences} == {"thrust.thrust_n"}
    assert not replay(recorded, NoThrust(), "*=ignore").is_identical  # a missing page is not a difference of values
