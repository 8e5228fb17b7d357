"""SCXML that we write: two other tools that read it go through the same states, by signals and by time.

The common subset: signals and time-outs without conditions. A machine inside has signals of its own, and exits others
again, since in SCXML an inner transition wins over an outer one. Only a machine that is alone in its state exits: of
two that exit at once, tools choose differently.
"""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Callable
from typing import Any
from xml.etree import ElementTree

import pytest
from hypothesis import given
from hypothesis import strategies as st

from snr_sim.behaviors import Interpreter, Program, draw
from snr_sim.behaviors.export import as_text
from snr_sim.behaviors.program import ANY, MachineDef, Place, Spawn, StateDef, Transition

TICK_S, TICK_NS = 0.125, 125_000_000  # exact in binary
SIGNALS = [f"{kind}{depth}" for kind in "ste" for depth in range(3)]
# Twenty words for each program: in the nightly lane ten thousand.
WORDS = st.lists(st.lists(st.sampled_from([*SIGNALS, 1, 2, 3]), max_size=30), min_size=20, max_size=20)
NUMBERS = {(low, high): st.integers(low, high) for low, high in ((0, 2), (0, 5), (1, 3))}


@functools.cache  # a strategy takes longer to make and to check than to draw from
def one_of(*values: str) -> st.SearchStrategy[str]:
    return st.sampled_from(values)


@functools.cache
@st.composite
def machines(draw: Any, depth: int, around: tuple[str, ...] | None) -> Spawn:
    names = ("a", "b", "c")[: draw(NUMBERS[1, 3])]
    signals = (f"s{depth}", f"t{depth}")
    states = []
    for name in names:
        count = draw(NUMBERS[0, 2]) if depth else 0
        targets = names if count == 1 else None
        states.append(StateDef(name, tuple(draw(machines(depth - 1, targets)) for _ in range(count))))
    arrows = []
    for _ in range(draw(NUMBERS[0, 5])):
        source, target = draw(one_of(ANY, *names)), draw(one_of(*names))
        kind = draw(one_of("on", "ontime", "exit") if around else one_of("on", "ontime"))
        if kind == "exit":
            arrows.append(Transition("exit", source, draw(one_of(*around)), "", Place(), f"e{depth}"))
        elif kind == "on":
            arrows.append(Transition("on", source, target, "", Place(), draw(one_of(*signals))))
        else:
            after_ns = draw(NUMBERS[1, 3]) * TICK_NS
            arrows.append(Transition("ontime", source, target, "", Place(), after_ns=after_ns))
    return Spawn(MachineDef(draw(one_of("m", "n")), tuple(states), tuple(arrows)), draw(one_of(*names)))


TOP = st.lists(machines(2, None), min_size=1, max_size=2)


@st.composite
def programs(draw: Any) -> Program:
    spawns = tuple(draw(TOP))
    text = as_text(spawns)
    return Program(text, hashlib.sha256(text.encode()).hexdigest(), spawns)


class Clock:
    """A time that a test sets [s]."""

    def __init__(self) -> None:
        self.now_s = 0.0


Tool = tuple[Callable[[str], Any], Callable[[], Any], Callable[[], set[str]]]  # sends a signal, lets time count, states


def compare(program: Program, words: list[list[str | int]], clock: Clock, start: Callable[[], Tool]) -> None:
    """Check that another tool is in the same states after each part of each word."""
    for word in longest(words):
        clock.now_s = 0.0
        send, run, configuration = start()
        ours = Interpreter(program)
        ours.spawn(0)
        assert configuration() == ids_of(ours)
        for one in word:
            if isinstance(one, str):
                send(one)
                ours.step(round(clock.now_s * 1e9), one)
            for _ in range(one if isinstance(one, int) else 0):
                clock.now_s += TICK_S
                run()
                ours.step(round(clock.now_s * 1e9))
            assert configuration() == ids_of(ours), one


def longest(words: list[list[str | int]]) -> list[list[str | int]]:
    """Return the words without those that begin another one: what they would show, that one shows, too."""
    kept: list[list[str | int]] = []
    for word in sorted(words, key=len, reverse=True):
        if not any(other[: len(word)] == word for other in kept):
            kept.append(word)
    return kept


def ids_of(interpreter: Interpreter) -> set[str]:
    found = {"all"}
    for path, name in interpreter.active.items():
        found |= {one.replace("/", ".").replace("#", ".") for one in (path, f"{path}/{name}")}
    return found


@pytest.mark.hypothesis
@given(programs(), WORDS)
def test_python_statemachine_reads_our_scxml(program: Program, words: list[list[str | int]]) -> None:
    pytest.importorskip("statemachine")
    from statemachine import event, event_data
    from statemachine.engines import base, sync
    from statemachine.io.scxml.processor import SCXMLProcessor

    clock = Clock()
    processor = SCXMLProcessor()
    processor.parse_scxml("machine", draw(program, "scxml"))

    def is_empty(queue: Any) -> bool:
        """Of an event that is not due its loop would wait for the real time."""
        with queue.queue.mutex:
            queue._drop_cancelled_head()
            return not queue.queue.queue or queue.queue.queue[0].execution_time > clock.now_s

    def start() -> Tool:
        processor.sessions.clear()  # otherwise the events go to the machine of the word before
        theirs = processor.start()
        return theirs.send, theirs._engine.processing_loop, lambda: {one.id for one in theirs.configuration}

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(event_data, "monotonic", lambda: clock.now_s)
        patch.setattr(sync, "monotonic", lambda: clock.now_s)
        patch.setattr(base.EventQueue, "is_empty", is_empty)
        patch.setattr(event.Event, "match", functools.cache(event.Event.match))  # splits both texts each time
        compare(program, words, clock, start)


@pytest.mark.hypothesis
@given(programs(), WORDS)
def test_sismic_goes_through_the_states_of_our_scxml(program: Program, words: list[list[str | int]]) -> None:
    pytest.importorskip("sismic", reason="needs sismic, of the extra dev")
    from sismic.clock import SimulatedClock
    from sismic.interpreter import Interpreter as Sismic
    from sismic.io.datadict import import_from_dict

    clock, chart = Clock(), import_from_dict(sismic_of(draw(program, "scxml")), ignore_schema=True)
    # In each step, Sismic works out again how the states are nested, and asks them for contracts, which none has.
    for name in ("ancestors_for", "depth_for", "descendants_for"):
        setattr(chart, name, functools.cache(getattr(chart, name)))
    leaf_for = functools.cache(chart.leaf_for)
    chart.leaf_for = lambda names: leaf_for(frozenset(names))

    def start() -> Tool:
        theirs = Sismic(chart, clock=SimulatedClock(), ignore_contract=True)

        def run() -> None:
            theirs.clock.time = clock.now_s
            theirs.execute()

        def send(signal: str) -> None:
            theirs.queue(signal)
            run()

        run()
        return send, run, lambda: set(theirs.configuration) - {"root"}

    compare(program, words, clock, start)


XML = "{http://www.w3.org/2005/07/scxml}"


def sismic_of(text: str) -> dict[str, Any]:
    """Return SCXML as sismic reads it: a delayed event, which the exit cancels, is a guard there."""
    root = ElementTree.fromstring(text)
    states = [state_of(one) for one in root]
    return {"statechart": {"name": "machine", "root state": {"name": "root", "initial": "all", "states": states}}}


def state_of(element: ElementTree.Element) -> dict[str, Any]:
    made: dict[str, Any] = {"name": element.get("id"), "transitions": []}
    delays_s = {
        one.get("event"): float(one.get("delay", "").removesuffix("ms")) / 1000 for one in element.iter(f"{XML}send")
    }
    cancelled = {one.get("sendid") for one in element.findall(f"{XML}onexit/{XML}cancel")}
    inner = [state_of(one) for one in element if one.tag in (f"{XML}state", f"{XML}parallel")]
    arrows = element.findall(f"{XML}transition")
    for i, one in enumerate(arrows):
        event, arrow = one.get("event"), {"target": one.get("target"), "priority": len(arrows) - i}
        if event in cancelled:
            arrow["guard"] = f"after({delays_s[event]})"
        else:
            arrow["event"] = event
        made["transitions"].append(arrow)
    if element.tag == f"{XML}parallel":
        made["parallel states"] = inner
    elif inner:
        made |= {"initial": element.get("initial", inner[0]["name"]), "states": inner}
    return made
