"""A changed program in a recorded run: the first difference comes when a changed element is evaluated, or later."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from snr_sim import Config, ListReplayerFactory, SimClock, SimRunner, TimeoutLoopFactory, tasks
from snr_sim.behaviors import Bridge, Drive, Program, Read, machine_parts, parse
from snr_sim.behaviors.explain import Evaluations, explaining
from snr_sim.behaviors.program import ProgramError
from snr_sim.prelude.errors import TraceError
from snr_sim.recording.checker import NodeReplay
from snr_sim.recording.reader import Trace, read_trace
from snr_sim.recording.replay import replay_node
from snr_sim.recording.trace import FILE_NAME, TraceWriter
from snr_sim.scenario.machine_change import ProgramChange, change_of
from snr_sim.scenario.machine_edits import LINES
from snr_sim.scenario.program import program_header

BRIDGE = Bridge({"depth": Read("depth", "m"), "load": Read("load", "kg", fresh_s=0.3)}, {"up": Drive("up", "n", 0, 99)})
EVENTS = [(0.12, "go"), (0.31, "stop"), (0.47, "go"), (0.9, "go"), (1.23, "stop")]
UNTIL_S = 1.3


def config(text: str, step_hz: float = 100.0, edits: Sequence[tuple[float, str]] = ()) -> Config:
    events = [(at_s, tasks.event(name)) for at_s, name in EVENTS]
    events += [(at_s, tasks.event("m.edit", [one])) for at_s, one in edits]
    return Config(
        factories={
            "r": [
                ListReplayerFactory([{"m": (i * 7) % 10} for i in range(30)], "depth", rate_hz=20.0),
                ListReplayerFactory([{"kg": (i * 3) % 7} for i in range(5)], "load", rate_hz=5.0),
                *(TimeoutLoopFactory(at_s, task=task, name=f"event at {at_s}") for at_s, task in events),
                *machine_parts(
                    parse(text, BRIDGE.parts), "m", step_hz=step_hz, bridge=BRIDGE, reacts_to=["depth", "load"]
                ),
            ]
        }
    )


def record(path: Path, made: Config) -> Trace:
    clock = SimClock()
    writer = TraceWriter(path, program_header(["r"], made, __file__, clock))
    try:
        SimRunner(made, clock=clock, recorder=writer, until_s=UNTIL_S).run()
    finally:
        writer.close()
    return read_trace(path)


def changed(folder: Path, old: str, new: str, **options: Any) -> ProgramChange:
    step_hz = options.setdefault("step_hz", 100.0)
    path = folder / FILE_NAME
    path.unlink(missing_ok=True)
    trace = record(path, config(old, **options))

    def replay(is_new: bool, evaluations: Callable[[Program], Evaluations]) -> list[NodeReplay]:
        with explaining(evaluations):
            return [replay_node(trace, "r", config(new if is_new else old, step_hz), LINES)]

    return change_of(trace, replay)


PROGRAM = """(var limit := [6])
(machine m
  (event go)
  (event stop)
  (state idle (onentry [robot.up.stop()]))
  (state busy (onentry [robot.up.start(5)]) (running [log(limit)]) (onexit [robot.up.start(1)]))
  (state late)
  (on go idle -> busy)
  (on [robot.depth.read() > limit] busy -> late)
  (on stop * -> idle)
  (ontime 120 late -> busy))
(spawn m idle)
"""


@pytest.mark.parametrize(
    ("old", "new", "first", "differs_s"),
    [
        ("ontime 120", "ontime 130", ("transition late->busy", 0.2), 0.67),
        ("start(5)", "start(6)", ("state busy", 0.12), 0.12),
        ("[log(limit)]", "[log(limit + 1)]", ("state busy", 0.12), 0.12),
        ("start(1)", "start(2)", ("state busy", 0.2), 0.2),
        (":= [6]", ":= [7]", ("variable limit", 0.0), 0.0),
        ("  (on stop * -> idle)\n", "", ("transition *->idle", 0.31), 0.31),
        ("(state late)", "(state late (onexit [log('x')]))", ("state late", 0.31), 0.31),
        ("(on stop * -> idle)", "(on stop * -> late)", ("transition *->idle", 0.31), 0.31),
        ("; nothing", "", None, None),
        ("(machine m", "; a comment\n\n(machine m", None, None),
    ],
)
def test_first_evaluation_and_first_difference(
    tmp_path: Path, old: str, new: str, first: tuple[str, float] | None, differs_s: float | None
) -> None:
    found = changed(tmp_path, PROGRAM, PROGRAM.replace(old, new))
    assert found.is_explained
    assert (None if found.divergence is None else found.divergence.t) == differs_s
    shown = None if found.first is None else (f"{found.first.what} {found.first.name}", found.first_s)
    assert shown == first


def test_element_that_is_never_evaluated_changes_nothing(tmp_path: Path) -> None:
    new = PROGRAM.replace("(ontime 120", "(on [robot.load.read() > 5] late -> idle)\n  (ontime 120")
    never = "(state never (onentry [log('x')]))\n  (state late)"
    assert changed(tmp_path, PROGRAM.replace("(state late)", never), PROGRAM).first is None
    found = changed(tmp_path, PROGRAM, new)
    assert found.first is not None
    assert found.first_s == 0.2


def test_difference_without_a_cause_is_unexplained(tmp_path: Path) -> None:
    found = changed(tmp_path, PROGRAM, PROGRAM.replace("start(1)", "start(2)"))
    assert found.divergence is not None
    assert not replace(found, divergence=replace(found.divergence, t=0.19)).is_explained
    assert not replace(found, first=None, first_s=float("inf")).is_explained


def test_run_is_compared_up_to_its_first_edit(tmp_path: Path) -> None:
    edits = [(0.25, PROGRAM.replace("120", "50"))]
    found = changed(tmp_path, PROGRAM, PROGRAM.replace("start(1)", "start(2)"), edits=edits)
    assert (found.until_s, found.first_s) == (0.25, 0.2)
    found = changed(tmp_path, PROGRAM, PROGRAM.replace("  (on stop * -> idle)\n", ""), edits=edits)
    assert (found.first, found.divergence) == (None, None)


def test_run_that_does_not_repeat_is_refused(tmp_path: Path) -> None:
    trace = record(tmp_path / FILE_NAME, config(PROGRAM))

    def replay(is_new: bool, evaluations: Any) -> list[NodeReplay]:
        return [replay_node(trace, "r", config(PROGRAM.replace("start(5)", "start(6)")))]

    with pytest.raises(TraceError, match="This run differs when it is executed again"):
        change_of(trace, replay)


# -- random programs and edits ----------------------------------------------------------------------------------------

STATES = ["a", "b", "c"]
CONDITIONS = ["robot.depth.read() > {}", "robot.load.read() == {}", "count > {}", "(robot.load.read() or 0) < {}"]
numbers = st.integers(0, 9)


@st.composite
def arrows(draw: Any, around: bool) -> str:
    kinds = ["on", "on", "signal", "ontime", "ontime", "variable time", "eps", *(["exit"] if around else [])]
    kind, target = draw(st.sampled_from(kinds)), draw(st.sampled_from(STATES))
    source = draw(st.sampled_from([*STATES, *STATES, "*"] if kind != "exit" else STATES))
    condition = draw(st.sampled_from(CONDITIONS)).format(draw(numbers))
    ends = f"{source} -> {target}"
    made = {
        "on": f"(on [{condition}] {ends})",
        "signal": f"(on {draw(st.sampled_from(['go', 'stop']))} {ends})",
        "ontime": f"(ontime {draw(numbers) * 15} {ends})",
        "variable time": f"(ontime [40 + 10 * count] {ends})",
        "eps": f"(eps {ends})",
        "exit": f"(exit [{condition}] {ends})",
    }
    return made[kind]


@st.composite
def bodies(draw: Any, depth: int) -> list[str]:
    """Return the lines of a machine: each is an element."""
    lines = ["(event go)", "(event stop)"]
    for name in STATES:
        clauses = [f"(onentry [count = count + {draw(numbers)}])", f"(onentry [robot.up.start({draw(numbers)})])"]
        clauses += [f"(running [log({draw(numbers)})])", f"(onexit [robot.up.start(count % {1 + draw(numbers)})])"]
        chosen = draw(st.lists(st.sampled_from(clauses), max_size=3, unique=True))
        if depth and draw(st.integers(0, 2)) == 0:
            inner = " ".join(draw(bodies(depth - 1)))
            chosen += [f"(machine in_{name} {inner})", f"(onentry (spawn in_{name} {draw(st.sampled_from(STATES))}))"]
        lines.append(f"(state {name} {' '.join(chosen)})")
    return lines + draw(st.lists(arrows(depth == 0), min_size=1, max_size=5))


def text_of(lines: list[str], limit: int, initial: str) -> str:
    first = ["(state start)", f"(on go start -> {initial})"]  # so that most elements are not evaluated at once
    return "\n".join([f"(var count := [{limit}])", "(machine m", *lines, *first, ")", "(spawn m start)", ""])


@st.composite
def pairs(draw: Any) -> tuple[str, str]:
    """Return a program, and the same with one element that is changed, added, removed or moved."""
    lines, limit, initial = draw(bodies(1)), draw(numbers), draw(st.sampled_from(STATES))
    new, place = list(lines), draw(st.integers(2, len(lines) - 1))
    how = draw(st.sampled_from(["number", "number", "arrow", "remove", "move", "add", "variable", "initial", "rename"]))
    if how == "number" and (found := list(re.finditer(r"\d+", new[place]))):
        at = draw(st.sampled_from(found))
        new[place] = f"{new[place][: at.start()]}{int(at[0]) + 1 + draw(numbers)}{new[place][at.end() :]}"
    elif how == "remove":
        del new[place]
    elif how == "arrow" and place >= 5:
        new[place] = draw(arrows(False))
    elif how == "move":
        new.insert(draw(st.integers(5, len(new) - 1)), new.pop(max(place, 5) if len(new) > 6 else place))
    elif how == "add":
        new.append(draw(arrows(False)))
    elif how == "rename":
        new = [re.sub(r"\bb\b", "z", one) if "machine" not in one else one for one in new]
    after = limit + 3 if how == "variable" else limit
    return text_of(lines, limit, initial), text_of(new, after, "c" if how == "initial" else initial)


@pytest.mark.hypothesis
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
@given(pairs())
def test_first_difference_of_a_random_change_is_explained(tmp_path: Path, texts: tuple[str, str]) -> None:
    try:
        for text in texts:
            parse(text, BRIDGE.parts)
    except ProgramError:
        return  # such as a state that has been removed and is named elsewhere
    found = changed(tmp_path, *texts, step_hz=40.0)
    assert found.is_explained, (found, *texts)
