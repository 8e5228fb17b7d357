"""Flows mean what executive_smach's containers mean, without threads: row by row of the design's table."""

from __future__ import annotations

import itertools
import threading
from collections.abc import Callable, Generator
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from snr_sim import Config, ListReplayerFactory, Node, SimClock, TaskType, TimeoutLoopFactory, tasks
from snr_sim.behaviors.flow import (
    Concurrence,
    EventState,
    Flow,
    Iterator,
    Preempted,
    State,
    Userdata,
    ask,
    event,
    flow_parts,
    page,
    until,
    wait,
)
from snr_sim.core.lockstep import LockStep
from snr_sim.prelude.errors import ComponentFailedError, ConfigError, ParameterError, UnknownNameError
from snr_sim.testing.function_components import FunctionEndpointFactory

NUMBERS = itertools.count()
Work = Callable[[Any, Userdata], Any]


def state(
    *outcomes: str, run: Work | None = None, inputs: tuple[str, ...] = (), outputs: tuple[str, ...] = ()
) -> State:
    """Return a state that ends at once with its first outcome, or does some work."""

    class Made(State):
        def run(self, userdata: Userdata) -> Any:
            return names[0] if run is None else run(self, userdata)

    names = outcomes or ("done",)
    Made.outcomes, Made.input_keys, Made.output_keys = names, inputs, outputs
    return Made()


def waiting(time_s: float, *outcomes: str) -> State:
    def run(self: State, userdata: Userdata) -> Generator[Any, Any, str]:
        yield wait(time_s)
        return self.outcomes[0]

    return state(*outcomes, run=run)


class Lab:
    """A flow in a node, and what it has sent."""

    def __init__(self, flow: Flow, *more: Any, until_s: float = 5.0, **settings: Any) -> None:
        self.sent: list[tuple[float, str, list[Any]]] = []
        names = [f"{flow.name}.transition", f"{flow.name}.done", "text"]
        watcher = FunctionEndpointFactory({(TaskType.event, name): self._note for name in names}, "watcher")
        clock = SimClock()
        parts = [*more, *flow_parts(flow, **settings), watcher]
        self.node = Node("r", Config(factories={"r": parts}), clock=clock)
        LockStep([self.node], clock, until_s=until_s).run()

    def _note(self, task: Any, key: Any) -> None:
        self.sent.append((round(self.node.get_time_s(), 6), task.name, list(task.val_list)))

    @property
    def moves(self) -> list[tuple[str, str, str]]:
        found = [values[0] for _, name, values in self.sent if name.endswith(".transition")]
        return [(one["source"], one["outcome"], one["target"]) for one in found]

    @property
    def done(self) -> list[Any]:
        return [values[0] for _, name, values in self.sent if name.endswith(".done")]

    @property
    def sent_texts(self) -> list[tuple[float, Any]]:
        return [(time, values[0]) for time, name, values in self.sent if name == "text"]


def send_text(text: Any) -> Any:
    return tasks.event("text", [text])


def event_at(time_s: float, name: str, *values: Any) -> TimeoutLoopFactory:
    number = next(NUMBERS)
    return TimeoutLoopFactory(time_s, task=tasks.event(name, list(values)), name=f"{name} {number}")


def flow_of(**states: Any) -> Flow:
    """Return a flow of states: a value is a state, or (state, transitions)."""
    flow = Flow("mission", outcomes=("done", "failed"))
    for label, one in states.items():
        behavior, transitions = one if isinstance(one, tuple) else (one, {})
        flow.add(label, behavior, transitions)
    return flow


# -- states in order --------------------------------------------------------------------------------------------------


def test_first_is_initial_and_outcomes_lead_on() -> None:
    lab = Lab(flow_of(A=(state("ok"), {"ok": "B"}), B=(state("ok", "bad"), {"ok": "done", "bad": "failed"})))
    assert lab.moves == [("A", "ok", "B"), ("B", "ok", "done")]
    assert lab.done == ["done"]
    assert lab.node.get_data("mission")["outcome"] == "done"


def test_unbound_outcome_is_the_flows_own() -> None:
    assert Lab(flow_of(A=state("failed"))).done == ["failed"]


def test_connector_makes_a_sequence() -> None:
    flow = Flow("mission", outcomes=("succeeded", "failed"), connector="succeeded")
    for label in "ABC":
        flow.add(label, state("succeeded", "failed"))
    assert Lab(flow).moves == [("A", "succeeded", "B"), ("B", "succeeded", "C"), ("C", "succeeded", "succeeded")]
    flow = Flow("mission", outcomes=("succeeded", "failed"), connector="succeeded")
    flow.add("A", state("failed", "succeeded"))
    flow.add("B", state("succeeded"))
    assert Lab(flow).done == ["failed"]


def test_initial_state_can_be_another() -> None:
    flow = flow_of(A=(state("ok"), {"ok": "done"}), B=(state("ok"), {"ok": "A"}))
    flow.set_initial("B")
    assert [source for source, _, _ in Lab(flow).moves] == ["B", "A"]
    with pytest.raises(UnknownNameError, match="no state 'C'"):
        flow.set_initial("C")


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: flow_of(), "no states"),
        (lambda: flow_of(A=(state("ok"), {"ok": "BB"}), B=(state("done"))), "leads to 'BB'"),
        (lambda: flow_of(A=state("ok")), "leads to 'ok'"),
        (lambda: flow_of(A=state("done"), B=state("done")), "No outcome leads to 'mission/B'"),
        (lambda: flow_of(A=(state("done"), {"dne": "B"})), "no outcome 'dne'"),
        (lambda: flow_of(A=State), "with brackets"),
        (lambda: flow_of(A=State()), "no run()"),
        (lambda: flow_of(done=state("done")), "'done' twice"),
        (lambda: Flow("mission", outcomes="done"), "with the comma"),  # type: ignore[arg-type]
        (lambda: flow_of(A=Concurrence(("done",), "done")), "no children"),
        (lambda: Concurrence(("done",), "dne"), "no outcome 'dne'"),
        (lambda: Iterator(("done",), [1], "item", "exhausted"), "exhausted='exhausted'"),
        (lambda: flow_of(A=Iterator(("done",), [1], "item", "done")), "no behavior"),
    ],
)
def test_flow_that_cannot_run_is_refused(make: Callable[[], Flow], message: str) -> None:
    with pytest.raises(ConfigError) as caught:
        flow_parts(make())
    assert message in str(caught.value)


def test_loop_without_waiting_is_reported() -> None:
    with pytest.raises(ComponentFailedError, match="100 states without waiting"):
        Lab(flow_of(A=(state("again", "done"), {"again": "A"})))


# -- waiting ----------------------------------------------------------------------------------------------------------


def test_state_waits_for_page_event_time_and_condition() -> None:
    def run(self: State, userdata: Userdata) -> Generator[Any, Any, str]:
        data = yield page("depth")
        yield send_text(("page", data["depth_m"]))
        values = yield event("go")
        yield send_text((TaskType.event, values))
        yield wait(0.5)
        yield send_text(("time", None))
        yield until(lambda: self.get_data("depth")["depth_m"] > 2.95)
        yield send_text(("condition", self.get_data("depth")["depth_m"]))
        return "done"

    depths = ListReplayerFactory([{"depth_m": 0.1 * i} for i in range(1, 50)], "depth", rate_hz=10.0)
    lab = Lab(flow_of(A=state("done", run=run)), depths, event_at(0.75, "go", 1, 2))
    assert [text for _, text in lab.sent_texts] == [
        ("page", 0.1), (TaskType.event, [1, 2]), ("time", None), ("condition", pytest.approx(3.0)),
    ]  # fmt: skip
    times = [time for time, _ in lab.sent_texts]
    assert times[1:3] == [0.75, pytest.approx(1.25, abs=0.011)]
    assert lab.done == ["done"]


@pytest.mark.parametrize("waits_for", [page("depth", 0.3), event("go", 0.3), until(lambda: False, 0.3)])
def test_timed_out_wait_gives_none(waits_for: Any) -> None:
    def run(self: State, userdata: Userdata) -> Generator[Any, Any, str]:
        found = yield waits_for
        yield send_text(found)
        return "done"

    ((time, found),) = Lab(flow_of(A=state("done", run=run))).sent_texts
    assert found is None
    assert time == pytest.approx(0.3, abs=0.011)


def test_request_is_answered() -> None:
    def run(self: State, userdata: Userdata) -> Generator[Any, Any, str]:
        values = yield from ask("grab", "grabbed", 1.0, [3])
        yield send_text(values)
        return "done"

    helper = FunctionEndpointFactory(
        {(TaskType.event, "grab"): lambda task, key: tasks.event("grabbed", [2 * task.val_list[0]])}, "gripper"
    )
    assert Lab(flow_of(A=state("done", run=run)), helper).sent_texts == [(0.0, [6])]


def test_event_state_ends_with_the_first_of_its_events() -> None:
    flow = flow_of(A=(EventState("go", "stay"), {"go": "B", "stay": "A"}), B=(EventState("go"), {"go": "done"}))
    events = [event_at(1.0 + 0.1 * i, name) for i, name in enumerate(("other", "stay", "go", "stay", "go"))]
    lab = Lab(flow, *events)
    assert lab.moves == [("A", "stay", "A"), ("A", "go", "B"), ("B", "go", "done")]
    assert Lab(flow, event_at(1.0, "mission.preempt")).done == ["preempted"]
    with pytest.raises(ConfigError, match="EventState has the outcomes"):
        EventState()


def test_event_that_ends_one_state_is_not_seen_by_the_next() -> None:
    def run(self: State, userdata: Userdata) -> Generator[Any, Any, str]:
        yield event("go")
        return "done"

    flow = flow_of(A=(state("done", run=run), {"done": "B"}), B=state("done", run=run))
    assert Lab(flow, event_at(1.0, "go")).done == []
    assert Lab(flow, event_at(1.0, "go"), event_at(2.0, "go")).done == ["done"]


@pytest.mark.parametrize(
    ("yielded", "message"),
    [(5, "neither a task nor a wait"), ("go", "neither a task nor a wait"), ([wait], "neither a task nor a wait")],
)
def test_wrong_yield_is_reported_with_its_line(yielded: Any, message: str) -> None:
    def run(self: State, userdata: Userdata) -> Generator[Any, Any, str]:
        yield yielded  # this line
        return "done"

    with pytest.raises(ComponentFailedError) as caught:
        Lab(flow_of(A=state("done", run=run)))
    assert message in str(caught.value)
    assert "yield yielded  # this line" in str(caught.value)


def test_yields_without_end_are_reported() -> None:
    def run(self: State, userdata: Userdata) -> Generator[Any, Any, str]:
        while True:
            yield None

    with pytest.raises(ComponentFailedError, match="10000 times without waiting"):
        Lab(flow_of(A=state("done", run=run)))


def test_wrong_outcome_is_reported() -> None:
    with pytest.raises(ComponentFailedError, match="ended with 'dne', which is not one of its outcomes"):
        Lab(flow_of(A=state("done", run=lambda self, userdata: "dne")))


@pytest.mark.parametrize("time_s", [-1.0, float("nan"), "1", True])
def test_wrong_times_are_refused(time_s: Any) -> None:
    with pytest.raises(ParameterError, match="seconds"):
        wait(time_s)


# -- data -------------------------------------------------------------------------------------------------------------


def test_data_are_handed_on_by_remapped_keys() -> None:
    def make(self: State, userdata: Userdata) -> str:
        userdata.way_m = [1.0, 2.0]
        return "done"

    def use(self: State, userdata: Userdata) -> Generator[Any, Any, str]:
        yield send_text(userdata.path)
        return "done"

    flow = Flow("mission", outcomes=("done",), output_keys=("way_m",))
    flow.add("A", state("done", run=make, outputs=("way_m",)), {"done": "B"}, {"way_m": "route"})
    flow.add("B", state("done", run=use, inputs=("path",)), remapping={"path": "route"})
    lab = Lab(flow)
    assert lab.sent_texts[0][1] == (1.0, 2.0), "what may only be read cannot be changed"
    assert lab.node.get_data("mission")["userdata"] == {"route": [1.0, 2.0]}


def test_state_counts_over_executions() -> None:
    """The first lesson of smach: a state keeps a counter, and data pass from one to the other."""

    class Count(State):
        outcomes, output_keys, input_keys = ("again", "done"), ("count",), ("count",)

        def __init__(self) -> None:
            self.own = 0

        def run(self, userdata: Userdata) -> Generator[Any, Any, str]:
            yield wait(0.1)
            self.own += 1
            userdata.count = userdata.count + 10
            return "done" if self.own == 3 else "again"

    flow = flow_of(COUNT=(Count(), {"again": "COUNT"}))
    for _ in range(2):  # the second node has states of its own
        lab = Lab(flow, userdata={"count": 0})
        assert lab.node.get_data("mission")["userdata"] == {"count": 30}


@pytest.mark.parametrize(
    ("run", "message"),
    [
        (lambda self, userdata: userdata.taget, "reads userdata.taget"),
        (lambda self, userdata: userdata.target, "'target' has not been set"),
        (lambda self, userdata: setattr(userdata, "target", 1), "writes userdata.target"),
        (lambda self, userdata: setattr(userdata, "out", object()), "an object of the type object"),
    ],
)
def test_undeclared_data_are_refused(run: Work, message: str) -> None:
    with pytest.raises(ComponentFailedError) as caught:
        Lab(flow_of(A=state("done", run=run, inputs=("target",), outputs=("out",))))
    assert message in str(caught.value)


def test_container_copies_its_data() -> None:
    def change(self: State, userdata: Userdata) -> str:
        values = userdata.values
        values.append(9)
        userdata.values = values
        return "done"

    def inner(outputs: tuple[str, ...]) -> Flow:
        flow = Flow("inner", outcomes=("done",), input_keys=("values",), output_keys=outputs)
        flow.add("A", state("done", run=change, inputs=("values",), outputs=("values",)))
        return flow

    for outputs, expected in (((), [1]), (("values",), [1, 9])):
        lab = Lab(flow_of(I=inner(outputs)), userdata={"values": [1]})
        assert lab.node.get_data("mission")["userdata"] == {"values": expected}


# -- side by side -----------------------------------------------------------------------------------------------------


def test_concurrence_ends_when_all_have_ended() -> None:
    both = Concurrence(("done", "failed"), "failed", {"done": {"A": "ok", "B": "ok"}})
    both.add("A", waiting(0.2, "ok"))
    both.add("B", waiting(0.5, "ok"))
    lab = Lab(flow_of(BOTH=both))
    assert lab.done == ["done"]
    assert lab.sent[-1][0] == pytest.approx(0.5, abs=0.011)


def test_rule_with_most_criteria_decides_and_function_comes_first() -> None:
    def both(**settings: Any) -> Concurrence:
        made = Concurrence(
            ("one", "two", "three", "none"), "none", {"one": {"A": "ok"}, "two": {"A": "ok", "B": "ok"}}, **settings
        )
        made.add("A", state("ok"))
        made.add("B", state("ok"))
        return made

    ends = dict.fromkeys(("one", "two", "three", "none"), "done")
    for settings, expected in (
        ({}, "two"),
        ({"outcome_function": lambda found: "three"}, "three"),
        ({"outcome_function": lambda found: None}, "two"),
    ):
        flow = Flow("mission", outcomes=("done",))
        flow.add("BOTH", both(**settings), ends)
        assert Lab(flow).moves == [("BOTH", expected, "done")]


def test_ambiguous_map_is_refused() -> None:
    both = Concurrence(("x", "y"), "x", {"x": {"A": "ok"}, "y": {"A": "ok"}})
    both.add("A", state("ok"))
    flow = Flow("mission", outcomes=("x", "y"))
    flow.add("BOTH", both)
    with pytest.raises(ConfigError, match="same criteria for 'x' and 'y'"):
        flow_parts(flow)


def test_first_end_preempts_others() -> None:
    noted = []

    def stubborn(self: State, userdata: Userdata) -> Generator[Any, Any, str]:
        try:
            yield wait(10.0)
        except Preempted:
            yield send_text("asked to end")
            yield wait(0.3)
            yield send_text("ends")
        finally:
            noted.append("closed")
        return "ok"

    both = Concurrence(("done",), "done", ends_when=lambda found: any(found.values()))
    both.add("A", waiting(0.5, "ok"))
    both.add("B", state("ok", run=stubborn))
    lab = Lab(flow_of(BOTH=both))
    assert lab.sent_texts == [(pytest.approx(0.5, abs=0.011), "asked to end"), (pytest.approx(0.8, abs=0.011), "ends")]
    assert noted == ["closed"]
    assert lab.done == ["done"]


def test_both_see_the_same_event() -> None:
    def run(self: State, userdata: Userdata) -> Generator[Any, Any, str]:
        yield event("go")
        return "ok"

    both = Concurrence(("done",), "done")
    both.add("A", state("ok", run=run))
    both.add("B", state("ok", run=run))
    assert Lab(flow_of(BOTH=both), event_at(1.0, "go")).sent[-1][:2] == (1.0, "mission.done")


# -- again and again --------------------------------------------------------------------------------------------------


def test_iterator_goes_through_its_items() -> None:
    def run(self: State, userdata: Userdata) -> Generator[Any, Any, str]:
        yield send_text(userdata.item)
        yield wait(0.1)
        return "ok" if userdata.item < 3 else "broken"

    def over(items: Any, **settings: Any) -> Flow:
        each = Iterator(("finished", "broken"), items, "item", "finished")
        each.set_behavior("DO", state("ok", "broken", run=run, inputs=("item",)), **settings)
        flow = Flow("mission", outcomes=("done", "failed"))
        flow.add("EACH", each, {"finished": "done", "broken": "failed"})
        return flow

    lab = Lab(over([1, 2]))
    assert ([item for _, item in lab.sent_texts], lab.done) == ([1, 2], ["done"])
    lab = Lab(over(lambda: [1, 4, 2]))
    assert ([item for _, item in lab.sent_texts], lab.done) == ([1, 4], ["failed"])
    lab = Lab(over([1, 4, 2], loops=("ok", "broken")))
    assert ([item for _, item in lab.sent_texts], lab.done) == ([1, 4, 2], ["done"])
    lab = Lab(over([4, 1], loops=("ok", "broken"), breaks=("broken",)))
    assert ([item for _, item in lab.sent_texts], lab.done) == ([4], ["failed"]), "a break comes before a loop"
    assert Lab(over([])).done == ["done"]
    with pytest.raises(UnknownNameError, match="no outcome 'brokn'"):
        over([1], breaks=("brokn",))


# -- from outside -----------------------------------------------------------------------------------------------------


def test_state_with_what_cannot_be_copied_is_named() -> None:
    locked = state("ok")
    locked.lock = threading.Lock()  # type: ignore[attr-defined]
    flow = flow_of(A=(state("ok"), {"ok": "B"}), B=(locked, {"ok": "done"}))
    with pytest.raises(ConfigError, match=r"(?s)State 'B' of flow 'mission' .* make it in run\(\)"):
        Lab(flow)


def test_goto_while_it_is_preempted_is_rejected() -> None:
    def run(self: State, userdata: Any) -> Any:
        try:
            yield wait(9.0)
        except Preempted:
            yield wait(0.5)
        return "ok"

    flow = Flow("mission", outcomes=("done",))
    flow.add("A", state("ok", run=run), {"ok": "B"})
    flow.add("B", state("ok", run=run), {"ok": "done"})
    lab = Lab(flow, event_at(0.5, "mission.preempt"), event_at(0.7, "mission.goto", "B"))
    assert lab.moves == [("A", "preempted", "preempted")]
    assert any("was rejected: it is being preempted" in note for note in lab.node.notes)


def test_goto_start_and_preempt_are_events() -> None:
    flow = flow_of(A=(waiting(1.0, "ok"), {"ok": "B"}), B=(waiting(1.0, "ok"), {"ok": "done"}))
    lab = Lab(flow, event_at(0.5, "mission.goto", "B", {"x": 1}))
    assert lab.moves == [("A", "goto", "B"), ("B", "ok", "done")]
    assert lab.node.get_data("mission")["userdata"] == {"x": 1}
    assert lab.sent[-1][0] == pytest.approx(1.5, abs=0.011)
    lab = Lab(flow, event_at(0.5, "mission.preempt"), event_at(0.7, "mission.preempt"), event_at(1.0, "mission.start"))
    assert lab.done == ["preempted", "done"]
    lab = Lab(flow, event_at(0.5, "mission.goto", "C"), event_at(0.6, "mission.start"), event_at(0.7, "mission.goto"))
    assert lab.done == ["done"]
    assert sum("was rejected" in note for note in lab.node.notes) == 3


def test_end_of_node_closes_states() -> None:
    noted = []

    def run(self: State, userdata: Userdata) -> Generator[Any, Any, str]:
        try:
            yield wait(100.0)
        finally:
            noted.append("closed")
        return "done"

    Lab(flow_of(A=state("done", run=run)), until_s=1.0)
    assert noted == ["closed"]


# Flows of random shape, preempted at any step.
def behaviors(depth: int) -> st.SearchStrategy[Any]:
    leaf = st.tuples(st.just("state"), st.floats(0.0, 1.0), st.sampled_from(("quick", "slow", "deaf")))
    if depth == 0:
        return leaf
    inner = st.lists(behaviors(depth - 1), min_size=1, max_size=3)
    return st.one_of(leaf, st.tuples(st.sampled_from(("flow", "both", "each")), inner))


def build(given: Any, name: str, log: list[str]) -> Any:
    if given[0] == "state":
        return leaf(given[1], given[2], name, log)
    made: Any
    if given[0] == "flow":
        made = Flow(name, outcomes=("ok",), connector="ok")
        for i, one in enumerate(given[1]):
            made.add(f"S{i}", build(one, f"{name}{i}", log))
    elif given[0] == "both":
        made = Concurrence(("ok",), "ok")
        for i, one in enumerate(given[1]):
            made.add(f"S{i}", build(one, f"{name}{i}", log))
    else:
        made = Iterator(("ok",), [1, 2], "item", "ok")
        made.set_behavior("S", build(given[1][0], f"{name}0", log), loops=("ok",))
    return made


def leaf(time_s: float, kind: str, name: str, log: list[str]) -> State:
    def run(self: State, userdata: Userdata) -> Generator[Any, Any, str]:
        log.append(f"+{name}")
        try:
            yield wait(time_s)
        except Preempted:
            log.append(f"!{name}")
            if kind == "slow":
                yield wait(0.2)
            while kind == "deaf":
                yield wait(0.05)
        finally:
            log.append(f"-{name}")
        return "ok"

    return state("ok", run=run)


class Noted:
    """A list that every copy of a flow shares."""

    def __init__(self) -> None:
        self.all: list[str] = []

    def append(self, text: str) -> None:
        self.all.append(text)

    def __deepcopy__(self, memo: Any) -> Noted:
        return self


@pytest.mark.hypothesis
@given(given=behaviors(2), time_s=st.floats(0.0, 2.0), gotos_s=st.lists(st.floats(-0.5, 1.0), max_size=2))
def test_preemption_is_neither_lost_nor_doubled_and_ends_in_time(
    given: Any, time_s: float, gotos_s: list[float]
) -> None:
    log = Noted()
    flow = Flow("mission", outcomes=("ok",))
    flow.add("ALL", build(given, "x", log))  # type: ignore[arg-type]
    events = [event_at(time_s, "mission.preempt") for _ in range(2)]
    events += [event_at(max(0.0, time_s + later_s), "mission.goto", "ALL") for later_s in gotos_s]
    lab = Lab(flow, *events, until_s=60.0)
    (outcome,) = lab.done
    ended = lab.sent[-1][0]
    begun, closed = (sorted(one[1:] for one in log.all if one[0] == sign) for sign in "+-")
    assert begun == closed, "each state that began has ended"
    if outcome == "preempted":
        assert time_s - 1e-6 <= ended <= time_s + 1.0 + 0.011
    else:
        assert ended <= time_s + 0.011, "it had ended before"
    for name in {one[1:] for one in log.all}:
        own = [one[0] for one in log.all if one[1:] == name]
        assert own.count("!") <= 1 or "each" in str(given)
