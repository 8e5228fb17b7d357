"""Control processes that follow a reference machine: what Kooi's architecture guarantees, without its waits."""

from __future__ import annotations

import itertools
import os
import time
from collections.abc import Generator, Mapping
from pathlib import Path
from statistics import median
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from snr_sim import Config, Node, SimClock, SimRunner, TaskType, TimeoutLoopFactory, WallClock, tasks
from snr_sim.behaviors import after, machine, on, parse, state
from snr_sim.behaviors.flow import EventState, Flow, State, ask, flow_parts, wait
from snr_sim.behaviors.processes import ControlProcessFactory, ObserverState, reference_parts
from snr_sim.core.lockstep import LockStep
from snr_sim.prelude.errors import ComponentFailedError, ConfigError, SnrError
from snr_sim.prelude.values import decode_value
from snr_sim.recording.reader import Trace, read_trace
from snr_sim.recording.records import TaskRecord
from snr_sim.recording.replay import replay_node
from snr_sim.recording.trace import FILE_NAME, TraceWriter
from snr_sim.scenario.program import program_header
from snr_sim.testing.function_components import FunctionEndpointFactory, FunctionLoopFactory

NUMBERS = itertools.count()
# Kooi's example, figure 15: three states, three events.
STATES = {
    "StateA": {"EventA": "StateB"},
    "StateB": {"EventB": "StateA", "EventC": "StateC"},
    "StateC": {"EventA": "StateA"},
}


class Echo(ObserverState):
    """Says how many turns it has had, once a second."""

    def run_state(self) -> Generator[Any, None, None]:
        self.store_data(f"{self.parent.name}.turn", [self.name, self.turns])
        yield wait(1.0)

    def exit(self) -> None:
        self.store_data(f"{self.parent.name}.turn", [self.name, "end"])


class Slow(Echo):
    """Cannot end before 300 ms of work are done."""

    def run_state(self) -> Generator[Any, None, None]:
        yield wait(0.3, uninterrupted=True)


class Quick(Echo):
    def run_state(self) -> Generator[Any, None, None]:
        yield wait(0.1, uninterrupted=True)


class Stuck(Echo):
    def run_state(self) -> Generator[Any, None, None]:
        yield wait(1000.0, uninterrupted=True)


class Failing(Echo):
    def run_state(self) -> Generator[Any, None, None]:
        yield wait(0.25)
        raise ValueError("no eyes")


def entering(kind: type[ObserverState]) -> type[ObserverState]:
    """Return states that also store when they begin."""
    return type(kind.__name__, (kind,), {"enter": lambda s: s.store_data(f"{s.parent.name}.turn", [s.name, "begin"])})


def of(kind: type[ObserverState]) -> dict[str, type[ObserverState]]:
    return dict.fromkeys(STATES, kind)


def event_at(time_s: float, name: str, *values: Any) -> TimeoutLoopFactory:
    number = next(NUMBERS)
    return TimeoutLoopFactory(time_s, task=tasks.event(name, list(values)), name=f"{name} {number}")


def _event_of(source: str, target: str) -> str:
    return next(event for event, to in STATES[source].items() if to == target)


class Lab:
    """A reference machine with its processes; what they store, and what it sends."""

    def __init__(
        self,
        processes: Mapping[str, type[ObserverState] | dict[str, type[ObserverState]]],
        *more: Any,
        until_s: float = 5.0,
        observers: list[str] | None = None,
        states: Any = STATES,
        **settings: Any,
    ) -> None:
        self.stored: list[tuple[float, str, str, Any]] = []
        self.now_attached: list[str] = []
        self.attached: list[list[str]] = []  # at each time that something was stored
        self.sent: list[tuple[float, str, list[Any]]] = []
        self.arrived: list[str] = []  # the events, in their order
        names = list(processes) if observers is None else observers
        made = [
            ControlProcessFactory(name, "reference", kind if isinstance(kind, dict) else of(kind))
            for name, kind in processes.items()
        ]
        keys = [f"{name}.turn" for name in processes]
        signals = {name for then in STATES.values() for name in then}
        watcher = FunctionEndpointFactory(
            {
                **{(TaskType.process_data, key): self._note_stored for key in keys},
                **{(TaskType.event, f"reference.{name}"): self._note_sent for name in ("transition", "dropped")},
                **{(TaskType.event, name): self._note_arrived for name in ("reference.publish", *signals)},
                (TaskType.process_data, "reference"): self._page,
            },
            "watcher",
        )
        self.pages: list[tuple[str, int, str]] = []
        clock = SimClock()
        parts = [*more, *reference_parts(states, observers=names, **settings), *made, watcher]
        self.config = Config(factories={"r": parts})
        self.node = Node("r", self.config, clock=clock)
        self.clock, self.until_s = clock, until_s

    def run(self) -> Lab:
        LockStep([self.node], self.clock, until_s=self.until_s).run()
        return self

    def record(self, folder: Path) -> Trace:
        """Run from the start, and return the trace."""
        clock = SimClock()
        writer = TraceWriter(folder / FILE_NAME, program_header(["r"], self.config, __file__, clock))
        try:
            SimRunner(self.config, clock=clock, recorder=writer, until_s=self.until_s).run()
        finally:
            writer.close()
        return read_trace(folder / FILE_NAME)

    def _note_stored(self, task: Any, key: Any) -> None:
        state, what = task.page.data
        self.stored.append((round(self.node.get_time_s(), 6), task.page.key.removesuffix(".turn"), state, what))
        self.attached.append(self.now_attached)

    def _note_sent(self, task: Any, key: Any) -> None:
        self.sent.append((round(self.node.get_time_s(), 6), task.name, list(task.val_list)))

    def _note_arrived(self, task: Any, key: Any) -> None:
        self.arrived.append(task.val_list[0] if task.name == "reference.publish" else task.name)

    def _page(self, task: Any, key: Any) -> None:
        data = task.page.data
        self.now_attached = data["attached"]
        self.pages.append((data["state"], data["epoch"], data["phase"]))

    @property
    def states(self) -> list[str]:
        return ["StateA", *(row[2][0]["target"] for row in self.sent if row[1].endswith("transition"))]

    @property
    def consequences(self) -> list[str]:
        """Of each event, its transition or that it was dropped: the events' names, in their order."""
        found = [values[0] for _, _, values in self.sent]
        return [one if isinstance(one, str) else _event_of(one["source"], one["target"]) for one in found]

    @property
    def dropped(self) -> list[tuple[str, str]]:
        return [(values[0], values[3]) for _, name, values in self.sent if name.endswith("dropped")]


def test_two_processes_change_state_together_and_count_again() -> None:
    """Kooi, figure 23."""
    lab = Lab({"P1": Echo, "P2": Echo}, event_at(2.5, "EventA"), until_s=4.0).run()
    first = [(name, state, what) for _, name, state, what in lab.stored]
    assert first == [
        ("P1", "StateA", 0), ("P2", "StateA", 0), ("P1", "StateA", 1), ("P2", "StateA", 1),
        ("P1", "StateA", 2), ("P2", "StateA", 2), ("P1", "StateA", "end"), ("P2", "StateA", "end"),
        ("P1", "StateB", 0), ("P2", "StateB", 0), ("P1", "StateB", 1), ("P2", "StateB", 1),
    ]  # fmt: skip
    assert {time for time, _, state, what in lab.stored if (state, what) in (("StateA", "end"), ("StateB", 0))} == {2.5}


TABLE = machine(
    "kooi", "StateA", [
        state("StateA", on("EventA", to="StateB")),
        state("StateB", on("EventB", to="StateA"), on("EventC", to="StateC"), on("EventB", to="StateC")),
        state("StateC", on("EventA", to="StateA")),
    ],
)  # fmt: skip
TEXT = parse("""
(machine kooi
  (state StateA) (state StateB) (state StateC)
  (on EventA StateA -> StateB) (on EventB StateB -> StateA) (on EventC StateB -> StateC)
  (on EventA StateC -> StateA)
  (event EventA) (event EventB) (event EventC))
(spawn kooi StateA)
""")


FLOW = Flow("kooi", ("over",))
FLOW.add("StateA", EventState("EventA"), {"EventA": "StateB"})
FLOW.add("StateB", EventState("EventB", "EventC"), {"EventB": "StateA", "EventC": "StateC"})
FLOW.add("StateC", EventState("EventA"), {"EventA": "StateA"})


@pytest.mark.parametrize("states", [STATES, TABLE, TEXT, FLOW], ids=["dict", "table", "text", "flow"])
def test_reference_is_a_dict_a_table_a_text_or_a_flow(states: Any) -> None:
    names = ("EventA", "EventB", "EventA", "EventC", "EventA")
    lab = Lab({"P1": Echo}, *(event_at(1.0 + 0.1 * i, name) for i, name in enumerate(names)), states=states).run()
    assert lab.states == ["StateA", "StateB", "StateA", "StateB", "StateC", "StateA"]


def test_flow_leads_a_reference_machine_and_waits_for_it() -> None:
    class Lead(State):
        outcomes = ("led",)

        def run(self, userdata: Any) -> Generator[Any, Any, str]:
            for name in ("EventA", "EventC"):
                yield wait(0.5)
                (found,) = yield from ask(name, "reference.transition")
                reached.append((found["target"], self.get_time_s()))
            return "led"

    reached: list[tuple[str, float]] = []
    flow = Flow("leader", ("led",))
    flow.add("LEAD", Lead())
    Lab({"P1": Echo, "P2": Slow}, *flow_parts(flow)).run()
    assert [name for name, _ in reached] == ["StateB", "StateC"]
    assert [time_s for _, time_s in reached] == pytest.approx([0.61, 1.22]), "Slow ends what it has begun"


def test_outcome_of_a_flow_is_the_last_state_of_a_reference_machine() -> None:
    flow = Flow("short", ("over",))
    flow.add("FIRST", EventState("EventA"), {"EventA": "SECOND"})
    flow.add("SECOND", EventState("EventB"), {"EventB": "over"})
    flow.set_initial("FIRST")
    processes = {"P1": dict.fromkeys(("FIRST", "SECOND", "over"), Echo)}
    events = [event_at(0.5 + 0.1 * i, name) for i, name in enumerate(("EventA", "EventB", "EventA"))]
    lab = Lab(processes, *events, states=flow, until_s=1.5).run()
    assert lab.states == ["StateA", "SECOND", "over"]  # the first is that of Kooi's example
    assert lab.dropped == [("EventA", "no transition in over")]


@pytest.mark.parametrize(
    ("behavior", "message"),
    [
        (type("Look", (State,), {"outcomes": ("EventA",), "run": lambda self, data: "EventA"})(), "is a Look"),
        (FLOW, "is a Flow"),
    ],
)
def test_flow_whose_states_do_work_is_refused_as_reference(behavior: Any, message: str) -> None:
    flow = Flow("busy", ("EventA", "over"))
    flow.add("FIRST", behavior)
    with pytest.raises(ConfigError, match=f"State 'FIRST' of flow 'busy' {message}; a reference machine only has"):
        reference_parts(flow)


def anything(m: Any) -> None:
    return None


@pytest.mark.parametrize(
    ("states", "what"),
    [
        (machine("m", "A", [state("A", on("go", to="A"), during=anything)]), "blocks"),
        (machine("m", "A", [state("A", on("go", to="A", do=anything))]), "blocks"),
        (machine("m", "A", [state("A", after(1.0, to="A"))]), "a transition that waits for no event"),
        (machine("m", "A", [state("A", on("go", to="A"), machines=[TABLE])]), "2 machines"),
        (parse("(machine m (state A))"), "0 machines"),
        (parse("(always fine [True])(machine m (state A))(spawn m A)"), "rules"),
    ],
)
def test_program_with_more_than_states_and_events_is_refused(states: Any, what: str) -> None:
    with pytest.raises(ConfigError) as caught:
        reference_parts(states)
    assert f"has {what}; it may" in str(caught.value)


def test_reaction_takes_as_long_as_the_slowest_and_not_the_sum() -> None:
    """Kooi, section 4: 100 ms and 300 ms of work."""
    lab = Lab({"P1": Quick, "P2": Slow}, event_at(0.05, "EventA"), until_s=2.0).run()
    assert lab.sent[0][0] == pytest.approx(0.3, abs=0.011)


def test_no_process_begins_while_another_is_in_the_old_state() -> None:
    class Noting(Echo):
        def enter(self) -> None:
            log.append(("begin", self.parent.name, self.parent.get_time_s()))

        def exit(self) -> None:
            log.append(("end", self.parent.name, self.parent.get_time_s()))

    class NotingSlow(Noting):
        def run_state(self) -> Generator[Any, None, None]:
            yield wait(0.4, uninterrupted=True)

    log: list[tuple[str, str, float]] = []
    Lab({"P1": Noting, "P2": NotingSlow, "P3": Noting}, event_at(1.0, "EventA"), until_s=1.5).run()
    words = [word for word, _, _ in log]
    assert words == ["begin"] * 3 + ["end"] * 3 + ["begin"] * 3 + ["end"] * 3
    assert max(t for word, _, t in log[3:6]) <= min(t for word, _, t in log[6:9])


def test_events_while_the_barrier_waits_come_in_their_order() -> None:
    events = [
        event_at(1.0 + 0.01 * i, name) for i, name in enumerate(("EventA", "EventB", "EventA", "EventC", "EventA"))
    ]
    lab = Lab({"P1": Slow}, *events, until_s=5.0).run()
    assert lab.states == ["StateA", "StateB", "StateA", "StateB", "StateC", "StateA"]
    assert lab.dropped == []


class Publishing(Echo):
    """Publishes the same event twice, as two cameras do that see the same thing."""

    def run_state(self) -> Generator[Any, None, None]:
        yield wait(0.5)
        if self.name == "StateA":
            self.publish_event("EventA")
            self.publish_event("EventA")
        yield wait(10.0)


def test_event_that_is_published_twice_is_one_transition() -> None:
    lab = Lab({"P1": Publishing, "P2": Echo}, until_s=2.0).run()
    assert lab.states == ["StateA", "StateB"]
    assert lab.dropped == [("EventA", "its state is over")]


@pytest.mark.parametrize("later_s", [0.0, 0.0005])
def test_event_of_two_publishers_within_a_millisecond_is_one_transition(later_s: float) -> None:
    """The second arrives while the barrier waits for the first, or after it, and names an epoch that is over."""
    found = [event_at(1.0 + i * later_s, "reference.publish", "EventA", f"P{i + 1}", 1) for i in range(2)]
    lab = Lab({"P1": Echo, "P2": Slow}, *found, until_s=2.0).run()
    assert lab.states == ["StateA", "StateB"]
    assert [values for _, name, values in lab.sent if name.endswith("dropped")] == [
        ["EventA", "P2", 1, "its state is over"]
    ]


def test_event_without_transition_is_reported() -> None:
    lab = Lab({"P1": Echo}, event_at(0.5, "EventB"), event_at(0.6, "NOOP")).run()
    assert lab.states == ["StateA"]
    assert lab.dropped == [("EventB", "no transition in StateA")]


def test_stuck_process_fails_the_node_by_default() -> None:
    with pytest.raises(ComponentFailedError) as caught:
        Lab({"P1": Echo, "P2": Stuck}, event_at(1.0, "EventA"), stop_timeout_s=0.5).run()
    assert "'P2' did not end state 'StateA' within 0.5 s" in str(caught.value)


@pytest.mark.parametrize("policy", ["detach", "failsafe"])
def test_stuck_process_is_detached(policy: str) -> None:
    lab = Lab(
        {"P1": Echo, "P2": Stuck}, event_at(1.0, "EventA"), event_at(2.0, "EventB"), stop_timeout_s=0.5, on_stuck=policy
    ).run()
    assert lab.states == ["StateA", "StateB", "StateA"]
    assert [time for time, name, _ in lab.sent] == [pytest.approx(1.5, abs=0.011), 2.0]
    assert (lab.node.get_data("failsafe") is True) == (policy == "failsafe")
    assert any("It was detached" in note for note in lab.node.notes)
    assert lab.node.get_data("reference")["attached"] == ["P1"]


@pytest.mark.parametrize("policy", ["fail", "detach"])
def test_failing_process_is_handled_by_the_same_policy(policy: str) -> None:
    lab = Lab({"P1": Echo, "P2": Failing}, event_at(1.0, "EventA"), on_stuck=policy)
    if policy == "fail":
        with pytest.raises(ComponentFailedError, match="no eyes"):
            lab.run()
        return
    lab.run()
    assert lab.states == ["StateA", "StateB"]
    assert any("no eyes" in note for note in lab.node.notes)


def test_process_is_attached_and_detached_while_it_runs() -> None:
    lab = Lab(
        {"P1": Echo, "P2": Echo},
        event_at(0.5, "reference.attach", "P2"),
        event_at(1.5, "EventA"),
        event_at(2.5, "reference.detach", "P1"),
        event_at(3.5, "EventB"),
        observers=["P1"],
        until_s=4.5,
    ).run()
    assert ("P2", "StateA", 0) in [row[1:] for row in lab.stored if 0.5 <= row[0] < 0.52]
    assert [row[1] for row in lab.stored if row[2:] == ("StateB", 0)] == ["P1", "P2"]
    assert [row[1] for row in lab.stored if row[2:] == ("StateA", 0) and row[0] > 3.0] == ["P2"]


def test_replay_of_a_run_knows_its_processes_although_it_has_no_loops(tmp_path: Path) -> None:
    """Those of the config, one that is added in the run, and that another one does not exist."""

    def lab() -> Lab:
        def grow(task: Any, key: Any) -> Any:
            return tasks.add_component(ControlProcessFactory("P3", "reference", of(Echo)))

        return Lab(
            {"P1": Echo, "P2": Slow},
            FunctionEndpointFactory({(TaskType.event, "grow"): grow}, "grows"),
            event_at(0.4, "grow"),
            event_at(0.5, "reference.attach", "P2"),
            event_at(0.6, "reference.attach", "P3"),
            event_at(0.7, "reference.attach", "P9"),
            event_at(1.5, "EventA"),
            event_at(2.5, "reference.detach", "P1"),
            event_at(3.5, "EventB"),
            observers=["P1"],
            until_s=4.5,
        )

    trace = lab().record(tmp_path)
    found = replay_node(trace, "r", lab().config)
    assert (found.divergences, found.executed > 50) == ([], True)
    ends = [one for one in trace.records if isinstance(one, TaskRecord) and one.name == "reference.ended"]
    assert [decode_value(bytes(one.values)) for one in ends] == [
        ["P1", 1], ["P3", 1], ["P2", 1], ["P3", 2], ["P2", 2]
    ]  # fmt: skip


class Patient(Echo):
    """Ends a state 2 s after it was entered."""

    def run_state(self) -> Generator[Any, None, None]:
        yield wait(2.0, uninterrupted=True)
        yield wait(100.0)


def test_two_runs_leave_the_same_bytes(tmp_path: Path) -> None:
    events = [event_at(2.0 + 0.1 * i, name) for i, name in enumerate(("EventB", "EventC", "EventA"))]
    moves = [event_at(1.0, "reference.detach", "P3"), event_at(1.6, "reference.attach", "P3")]
    lab = Lab({"P1": Publishing, "P2": Slow, "P3": Patient}, *events, *moves)
    found = []
    for name in ("first", "second"):
        (tmp_path / name).mkdir()
        lab.record(tmp_path / name)
        found.append((tmp_path / name / FILE_NAME).read_bytes().partition(b"\n")[2])
    assert found[0].count(b"reference.transition") == 3
    assert found[0] == found[1]


def test_process_is_attached_again_when_it_has_ended_its_old_state() -> None:
    lab = Lab(
        {"P1": entering(Echo), "P2": entering(Patient)}, event_at(1.0, "EventA"),
        event_at(1.6, "reference.attach", "P2"), until_s=3.0, stop_timeout_s=0.5, on_stuck="detach",
    ).run()  # fmt: skip
    states = [(time_s, name, state) for time_s, name, state, what in lab.stored if what == "begin"]
    assert states == [
        (0.0, "P1", "StateA"), (0.0, "P2", "StateA"), (1.5, "P1", "StateB"), (2.0, "P2", "StateB"),
    ]  # fmt: skip
    assert [row for row in lab.stored if row[1:] == ("P2", "StateA", "end")] == [(2.0, "P2", "StateA", "end")]


def test_process_that_has_failed_begins_again_when_it_is_attached_again() -> None:
    class Once(Echo):
        def enter(self) -> None:
            if self.get_time_s() < 0.5:
                raise ValueError("no eyes")

    lab = Lab(
        {"P1": Echo, "P2": Once}, event_at(1.0, "reference.attach", "P2"), event_at(2.0, "EventA"), on_stuck="detach"
    ).run()
    assert lab.states == ["StateA", "StateB"]
    assert [row[2] for row in lab.stored if row[1] == "P2" and row[3] == 0] == ["StateA", "StateB"]
    assert lab.node.get_data("reference")["attached"] == ["P1", "P2"]


def test_values_of_an_event_are_those_of_the_next_state() -> None:
    class Publisher(Echo):
        def run_state(self) -> Generator[Any, None, None]:
            self.store_data(f"{self.parent.name}.turn", [self.event, list(self.values)])
            yield wait(1.0)
            self.publish_event("EventB" if self.name == "StateB" else "EventA", [7, "m"])
            yield wait(10.0)

    lab = Lab({"P1": Publisher}, until_s=1.5).run()
    assert [row[2:] for row in lab.stored if row[3] != "end"] == [("", []), ("EventA", [7, "m"])]
    lab = Lab({"P1": Publisher}, event_at(0.5, "EventA", 5), until_s=0.9).run()
    assert lab.stored[-1][2:] == ("EventA", [5])


def test_event_that_no_state_has_is_noted_with_the_nearest() -> None:
    lab = Lab({"P1": Echo}, event_at(0.5, "reference.publish", "EvntA", "P1", 1)).run()
    assert any("has no event 'EvntA': did you mean 'EventA'?" in note for note in lab.node.notes)


def test_events_at_and_after_a_stop_are_reported_as_dropped() -> None:
    events = [event_at(0.1, "EventA"), event_at(0.12, "EventB"), event_at(0.15, "reference.stop")]
    lab = Lab({"P1": Slow}, *events, event_at(0.2, "EventA"), event_at(2.0, "EventA")).run()
    assert lab.states == ["StateA"]
    assert [name for name, _ in lab.dropped] == ["EventA", "EventB", "EventA", "EventA"]
    assert {reason for _, reason in lab.dropped} == {"the machine was stopped"}


def test_state_that_no_event_leads_to_is_noted() -> None:
    parts = reference_parts({"A": {"E": "A"}, "B": {"E": "A"}}, "A")
    node = Node("r", Config(factories={"r": parts}), clock=SimClock())
    LockStep([node], node.clock, until_s=0.1).run()  # type: ignore[arg-type]
    assert any("can reach state 'B'" in note for note in node.notes)


def test_stop_ends_all() -> None:
    lab = Lab({"P1": Echo, "P2": Slow}, event_at(1.05, "reference.stop"), event_at(2.0, "EventA")).run()
    assert lab.states == ["StateA"]
    assert lab.pages[-1] == ("StateA", 1, "stopped")
    assert [row[3] for row in lab.stored if row[0] > 1.05] == ["end"]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Lab({"P1": {"StateA": Echo, "StateB": Echo}}).run(), "has no state 'StateC'"),
        (lambda: Lab({"P1": {**of(Echo), "StateD": Echo}}).run(), "has the state 'StateD'"),
        (lambda: Lab({"P1": Echo}, observers=["P2"]).run(), "not a control process"),
        (lambda: Lab({"P1": Echo}, ControlProcessFactory("P2", "refrence", of(Echo))).run(), "of='reference'."),
        (lambda: Lab({"P1": Echo}, on_stuck="ignore"), "on_stuck"),
        (lambda: Lab({"P1": Echo}, stop_timeout_s=0.0), "stop_timeout_s"),
        (lambda: Lab({"P1": Echo}, observers=["P1", "P1"]), "each once"),
        (lambda: ControlProcessFactory("P", "reference", {"A": "Echo"}), "a class"),  # type: ignore[dict-item]
        (lambda: ControlProcessFactory("P", "reference", {"A": ObserverState}), "no run_state()"),
        (lambda: reference_parts({"A": {"E": "B"}}, "A"), "'B'"),
    ],
)
def test_wrong_architecture_is_refused(make: Any, message: str) -> None:
    with pytest.raises(SnrError) as caught:
        make()
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("attach", []), ("attach", ["P3"]), ("attach", [["P1"]]), ("detach", [5]), ("detach", []), ("ended", ["P1"]),
        ("ended", [["P1"], 1]), ("crashed", []), ("crashed", ["P3", "text"]), ("publish", ["EventA"]),
        ("publish", [["EventA"], "P1", 1]), ("publish", ["EventA", "P1", "1"]),
    ],
)  # fmt: skip
def test_malformed_event_is_noted_and_changes_nothing(name: str, values: list[Any]) -> None:
    lab = Lab({"P1": Echo, "P2": Echo}, event_at(0.5, f"reference.{name}", *values), event_at(1.0, "EventA")).run()
    assert lab.states == ["StateA", "StateB"]
    assert lab.node.get_data("reference")["attached"] == ["P1", "P2"]
    assert any("rejected" in note or "does not follow" in note for note in lab.node.notes)


@pytest.mark.hypothesis
@given(
    events=st.lists(
        st.tuples(st.floats(0.0, 3.0), st.sampled_from(("EventA", "EventB", "EventC", "NOOP"))), max_size=12
    ),
    kinds=st.lists(st.sampled_from((Echo, Slow, Quick, Publishing, Patient)), min_size=1, max_size=3),
    moves=st.lists(st.tuples(st.floats(0.0, 3.0), st.booleans(), st.integers(0, 2)), max_size=4),
    published=st.lists(
        st.tuples(st.floats(0.0, 3.0), st.sampled_from(("EventA", "EventB", "EventC")), st.integers(1, 5)), max_size=4
    ),
)
def test_barrier_and_events_hold_in_any_history(
    events: list[tuple[float, str]],
    kinds: list[type[ObserverState]],
    moves: list[tuple[float, bool, int]],
    published: list[tuple[float, str, int]],
) -> None:
    given_processes: Any = {f"P{i}": entering(kind) for i, kind in enumerate(kinds)}
    names = list(given_processes)
    more = [event_at(time_s + 1e-4 * i, name) for i, (time_s, name) in enumerate(events)]
    more += [
        event_at(time_s + 1e-4 * (50 + i), f"reference.{'attach' if up else 'detach'}", names[which % len(names)])
        for i, (time_s, up, which) in enumerate(moves)
    ]
    more += [event_at(time_s, "reference.publish", name, "P0", epoch) for time_s, name, epoch in published]
    lab = Lab(given_processes, *more, until_s=25.0, stop_timeout_s=1.0, on_stuck="detach").run()
    # Each event, from outside or published, is a transition, or reported as dropped, in the order of arrival.
    assert len(lab.arrived) >= sum(name != "NOOP" for _, name in events) + len(published)
    assert lab.consequences == lab.arrived
    # An epoch begins when the one before is over, and the states are those of the table.
    for old, new in zip(lab.pages, lab.pages[1:], strict=False):
        assert new[1] - old[1] in (0, 1)
        if new[1] != old[1]:
            assert (old[2], new[2]) == ("ending", "running")
            assert new[0] in STATES[old[0]].values()
    assert lab.pages[-1][2] == "running", "no barrier is left waiting"
    # None begins a state while another one that is attached is in another one.
    inside: dict[str, str] = {}
    for (_, name, place, what), attached in zip(lab.stored, lab.attached, strict=True):
        if what == "begin":
            assert {inside[one] for one in attached if one in inside and one != name} <= {place}, lab.stored
            inside[name] = place
        elif what == "end":
            inside.pop(name, None)


# -- on the wall clock ------------------------------------------------------------------------------------------------


class Idle(ObserverState):
    def run_state(self) -> Generator[Any, None, None]:
        yield wait(100.0)


def attach_the_dead(loop: Any) -> None:
    if (loop.get_data("reference") or {}).get("attached") == ["P2"]:
        loop.schedule([tasks.event("reference.attach", ["P1"]), tasks.event("EventA")])


class Dying(Idle):
    def run_state(self) -> Generator[Any, None, None]:
        yield wait(0.1)
        os._exit(3)


@pytest.mark.slow
@pytest.mark.wall_clock
@pytest.mark.parametrize("policy", ["fail", "detach", "failsafe"])
def test_process_that_dies_is_handled_by_the_policy(policy: Any) -> None:
    parts = [
        *reference_parts(STATES, "StateA", observers=["P1", "P2"], on_stuck=policy),
        ControlProcessFactory("P1", "reference", of(Dying), executor="process"),
        ControlProcessFactory("P2", "reference", of(Idle)),
        FunctionEndpointFactory({(TaskType.event, "reference.transition"): lambda t, k: tasks.terminate("seen")}, "w"),
        FunctionLoopFactory(attach_the_dead, "then", 10.0),
        TimeoutLoopFactory(seconds=30.0),
    ]  # fmt: skip
    node = Node("r", Config(factories={"r": parts}), clock=WallClock())
    if policy == "fail":
        with pytest.raises(ComponentFailedError, match="'P1' failed in state 'StateA'"):
            node.loop()
        return
    node.loop()
    page = node.get_data("reference")
    assert (page["state"], page["attached"]) == ("StateB", ["P2"])
    assert (node.get_data("failsafe") is True) == (policy == "failsafe")
    assert any("It was detached" in note for note in node.notes)
    assert any("was rejected: its process has died" in note for note in node.notes)


@pytest.mark.slow
@pytest.mark.wall_clock
@pytest.mark.parametrize("executor", ["thread", "process"])
def test_order_is_the_same_on_threads_and_in_processes(executor: Any) -> None:
    pages: list[tuple[str, int, str]] = []

    def note(task: Any, key: Any) -> Any:
        data = task.page.data
        pages.append((data["state"], data["epoch"], data["phase"]))
        return tasks.terminate("all seen") if pages[-1][1:] == (6, "running") else None

    names = ("EventA", "EventB", "EventA", "EventC", "EventA")
    events = [event_at(2.0 + 0.2 * i, name) for i, name in enumerate(names)]
    processes = [ControlProcessFactory(f"P{i}", "reference", of(Idle), executor=executor) for i in (1, 2)]
    parts = [
        *reference_parts(STATES, "StateA", observers=["P1", "P2"], stop_timeout_s=10.0),
        *processes,
        FunctionEndpointFactory({(TaskType.process_data, "reference"): note}, "watcher"),
        *events,
        TimeoutLoopFactory(seconds=30.0),
    ]
    Node("r", Config(factories={"r": parts}), clock=WallClock()).loop()
    assert pages == Lab({"P1": Idle, "P2": Idle}, *events).run().pages
    assert [state for state, _, phase in pages if phase == "running"] == [
        "StateA", "StateB", "StateA", "StateB", "StateC", "StateA"
    ]  # fmt: skip


class Working(ObserverState):
    """Works 0.1 s or 0.3 s for a picture, in which it sees what ends the state."""

    def run_state(self) -> None:
        if self.parent.name == "P1":
            time.sleep(0.1)
            return
        time.sleep(0.05)
        self.publish_event("EventB" if self.name == "StateB" else "EventA")
        time.sleep(0.25)


@pytest.mark.slow
@pytest.mark.wall_clock
def test_cycle_of_processes_takes_as_long_as_the_slowest_and_not_the_sum() -> None:
    """Kooi, section 4: one thread for both would take 400 ms."""
    begun_s: list[float] = []

    def note(task: Any, key: Any) -> Any:
        begun_s.append(time.monotonic())
        return tasks.terminate("enough") if len(begun_s) == 9 else None

    parts = [
        *reference_parts(STATES, observers=["P1", "P2"], stop_timeout_s=10.0),
        *(ControlProcessFactory(name, "reference", of(Working), executor="process") for name in ("P1", "P2")),
        FunctionEndpointFactory({(TaskType.event, "reference.transition"): note}, "watcher"),
        TimeoutLoopFactory(seconds=30.0),
    ]
    Node("r", Config(factories={"r": parts}), clock=WallClock()).loop()
    lasted_s = [new - old for old, new in itertools.pairwise(begun_s)]
    assert len(lasted_s) == 8
    assert 0.3 <= median(lasted_s) < 0.35


@pytest.mark.wall_clock
def test_idle_control_processes_take_less_than_a_hundredth_of_a_core() -> None:
    used_s: list[float] = []

    def note(task: Any, key: Any) -> Any:
        used_s.append(time.process_time())
        return tasks.terminate("enough") if task.name == "end" else None

    names = ["P1", "P2"]
    parts = [
        *reference_parts(STATES, observers=names),
        *(ControlProcessFactory(name, "reference", of(Idle)) for name in names),
        FunctionEndpointFactory({(TaskType.event, name): note for name in ("begin", "end")}, "watcher"),
        event_at(1.0, "begin"),
        event_at(11.0, "end"),
    ]
    Node("r", Config(factories={"r": parts}), clock=WallClock()).loop()
    assert used_s[1] - used_s[0] < 0.1


@pytest.mark.wall_clock
def test_clock_that_sleeps_wakes_for_the_deadline_of_a_stuck_process() -> None:
    def note(task: Any, key: Any) -> Any:
        passed_s.append(node.get_time_s())
        return tasks.terminate("seen")

    passed_s: list[float] = []
    parts = [
        *reference_parts(STATES, observers=["P1", "P2"], stop_timeout_s=0.5, on_stuck="detach"),
        ControlProcessFactory("P1", "reference", of(Stuck)),
        ControlProcessFactory("P2", "reference", of(Idle)),
        FunctionEndpointFactory({(TaskType.event, "reference.transition"): note}, "watcher"),
        event_at(1.0, "EventA"),
        TimeoutLoopFactory(seconds=10.0),
    ]
    node = Node("r", Config(factories={"r": parts}), clock=WallClock())
    node.loop()
    assert 1.5 <= passed_s[0] < 3.0
