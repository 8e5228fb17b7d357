"""The two guarantees of the reference machine, looked for in what was recorded.

Together: no control process begins a state while another one is in the state before.
Every event once: each event that a process publishes changes the state once, or is dropped and reported.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from snr_sim import Page
from snr_sim.grading import Output, ScenarioRun, Stimulus, SubmissionError, Verdict, failed, passed, require_field
from snr_sim.recording import InputRecord, PageRecord, TaskRecord, decode_value

PROCESSES = ("process_2d", "process_3d", "driver")
OF_2D = ("HEAP_SEEN", "HEAP_LOST")
TRANSITION, DROPPED = "reference.transition", "reference.dropped"
OBSERVERS = 'Name all three processes in observers=["process_2d", "process_3d", "driver"], and nothing else.'
OWN_MESSAGES = "Leave the page and the events that begin with 'reference' to the reference machine."


@dataclass(frozen=True)
class Entry:
    """Something that a component has sent: an event with its values, or a page with its data."""

    at_s: float
    source: str
    name: str
    value: Any


@dataclass(frozen=True)
class Change:
    """A change of state.

    Args:
        epoch: that it ended.
        begun_s: when all processes were asked to end their state.
        ended_s: when each process reported that it had.
        over_s: when the next state began.
    """

    epoch: int
    begun_s: float
    ended_s: dict[str, float]
    over_s: float

    @property
    def lasted_s(self) -> float:
        """Return how long it took."""
        return self.over_s - self.begun_s


def entries_of_outputs(made: Iterable[Output], given: Iterable[Stimulus] = ()) -> list[Entry]:
    """Return what the components of a bare node have sent, with the events that were sent to it."""
    events = [Entry(one.at_s, "", one.task[1], one.task[2]) for one in given if one.task is not None]
    sent = [Entry(one.at_s, one.component, one.name, one.value) for one in made if one.kind != "process_data"]
    return sorted([*events, *sent], key=lambda one: one.at_s)  # stable: events come first at their time


def entries_of_run(run: ScenarioRun) -> list[Entry]:
    """Return what the control processes and the reference machine have sent in a run."""
    found = []
    for record in run.trace.records:
        if isinstance(record, InputRecord) and record.type in ("event", "store_page"):
            found.append(Entry(record.t, record.source, record.name, _value(bytes(record.values))))
        elif isinstance(record, (PageRecord, TaskRecord)) and record.name in ("reference", TRANSITION, DROPPED):
            found.append(Entry(record.t, "reference", record.name, _value(bytes(record.values))))
    return found


def _value(raw: bytes) -> Any:
    values = decode_value(raw, {"page": Page})
    return values[0].data if values and isinstance(values[0], Page) else values


@dataclass(frozen=True)
class Reference:
    """The page of the reference machine."""

    at_s: float
    state: str
    epoch: float
    phase: str
    attached: tuple[str, ...]


def reference_page(one: Entry) -> Reference | None:
    """Return the page of the reference machine in an entry; None if it is something else.

    Raises:
        SubmissionError: it has another form, so something else has stored it.
    """
    if one.name != "reference" or one.source != "reference":
        return None
    state, phase = (require_field(one.value, "reference", name, str) for name in ("state", "phase"))
    attached = one.value.get("attached")
    if not isinstance(attached, list) or not all(isinstance(name, str) for name in attached):
        raise SubmissionError("The page 'reference' has no list of names.", OWN_MESSAGES)
    return Reference(one.at_s, state, require_field(one.value, "reference", "epoch", float), phase, tuple(attached))


def together(entries: Iterable[Entry]) -> tuple[Verdict, list[Change]]:
    """Judge whether all processes end each state before the next one begins; return the changes of state, too."""
    changes: list[Change] = []
    ended: dict[str, float] = {}
    epoch, phase, begun_s = 0.0, "", 0.0
    for one in entries:
        page = reference_page(one)
        if page is not None:
            before, epoch, phase = epoch, page.epoch, page.phase
            if sorted(page.attached) != sorted(PROCESSES):
                return failed(OBSERVERS, ", ".join(PROCESSES), ", ".join(page.attached)[:200]), changes
            if phase == "ending":
                begun_s = one.at_s
            elif before and epoch != before:
                missing = [name for name in PROCESSES if name not in ended]
                if missing:
                    hint = f"The next state began before {missing[0]} had ended the one before. {OBSERVERS}"
                    return failed(hint, f"'ended' of all in epoch {before:g}", ", ".join(ended)), changes
                changes.append(Change(int(before), begun_s, dict(ended), one.at_s))
                ended.clear()
        elif one.name == "reference.ended" and one.value == [one.source, epoch]:
            ended[one.source] = one.at_s
        elif one.source == "process_2d" and (phase == "ending" and one.source in ended):
            hint = "process_2d did something after it had ended its state, and before the next one had begun."
            return failed(hint, "nothing between two states", one.name), changes
    return passed(), changes


def each_event_once(entries: Iterable[Entry], table: Mapping[str, Mapping[str, str]]) -> Verdict:
    """Judge whether each event of the processes changes the state once, in the order of arrival, or is dropped.

    Args:
        entries: of a run.
        table: from each state by event to the next.
    """
    waiting: list[str] = []
    for one in entries:
        if one.name in OF_2D and one.source:
            hint = (
                f"{one.name} was sent without the epoch in which it is true, so it counts in whatever state there is "
                "when it arrives. Send it with self.publish_event."
            )
            return failed(hint, "reference.publish", one.name)
        if one.name == "reference.publish":
            name, source = _texts(one, 2)
            if source != one.source or (source == "process_2d") != (name in OF_2D):
                hint = f"{' and '.join(OF_2D)} are the events of process_2d. It sends no others, and they are its own."
                return failed(hint, " or ".join(OF_2D), f"{name} of {source}"[:200])
            waiting.append(name)
        elif not one.source:
            waiting.append(one.name)
        elif one.name == DROPPED:
            (name,) = _texts(one, 1)
            if not waiting or waiting.pop(0) != name:
                return failed("An event was dropped that was not the next one.", "in the order of arrival", name[:200])
        elif one.name == TRANSITION:
            change = one.value[0] if isinstance(one.value, list) and one.value else None
            source, target = (require_field(change, TRANSITION, name, str) for name in ("source", "target"))
            if not waiting or table.get(source, {}).get(waiting.pop(0)) != target:
                hint = "The state changed without an event for it, or twice for one."
                return failed(hint, "one change for each event", f"{source} -> {target}"[:200])
    return passed()


def _texts(one: Entry, count: int) -> list[str]:
    """Return the first values of an event, which are texts.

    Raises:
        SubmissionError: they are not.
    """
    values = one.value[:count] if isinstance(one.value, list) else []
    if len(values) != count or not all(type(value) is str for value in values):
        raise SubmissionError(f"The event '{one.name}' has other values than those of the kit.", OWN_MESSAGES)
    return values
