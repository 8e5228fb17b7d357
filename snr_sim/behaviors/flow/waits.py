"""What a state waits for: a page, an event, a time, a condition."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from snr_sim.prelude import tasks
from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.task import DataKey, Task


class Preempted(Exception):  # noqa: N818 -- the name in smach; not a failure
    """Raised in a state where it waits, when it is to end; it may send tasks and wait for a short time more."""


@dataclass(frozen=True)
class Wait:
    """What a state waits for; made by the functions below.

    Args:
        kind: of what is waited for.
        name: of the page or event.
        timeout_s: after which the wait is over.
        condition: of no arguments; the wait is over when it returns true.
        is_uninterrupted: whether it lasts also if its state is to end; in a control process only.
    """

    kind: Literal["page", "event", "time", "condition"]
    name: str = ""
    timeout_s: float = math.inf
    condition: Callable[[], Any] | None = None
    is_uninterrupted: bool = False


@dataclass
class Step:
    """What a step of a flow brings, and what it sends.

    Args:
        now_ns: node time.
        preempt_deadline_s: how long a state may take to end once it is preempted.
        kind, name, value: of the page or event that caused it, if one did.
        tasks: that states have sent, in order.
        moves: changes of state, in order.
    """

    now_ns: int
    preempt_deadline_s: float
    kind: str
    name: str
    value: Any
    tasks: list[Task]
    moves: list[dict[str, Any]]


def page(key: DataKey, timeout_s: float | None = None) -> Wait:
    """Wait for the next page of a key; `yield` returns its data, or None after the time-out."""
    return Wait("page", str(key), _time("page", timeout_s))


def event(name: str, timeout_s: float | None = None) -> Wait:
    """Wait for an event; `yield` returns the list of its values, or None after the time-out."""
    return Wait("event", name, _time("event", timeout_s))


def wait(time_s: float, *, uninterrupted: bool = False) -> Wait:
    """Wait for a time; `yield` returns None.

    Args:
        time_s: how long.
        uninterrupted: it lasts also if its state is to end: work that cannot be given up, in a control process.
    """
    return Wait("time", timeout_s=_time("wait", time_s), is_uninterrupted=uninterrupted)


def until(condition: Callable[[], Any], timeout_s: float | None = None) -> Wait:
    """Wait until a condition holds in a step; `yield` returns True, or None after the time-out."""
    if not callable(condition):
        raise ParameterError(f"until({condition!r}) is given no function.", fix="until(lambda: self.is_near()).")
    return Wait("condition", timeout_s=_time("until", timeout_s), condition=condition)


def ask(
    request: str, answer: str, timeout_s: float | None = None, values: Sequence[Any] = ()
) -> Generator[Any, Any, Any]:
    """Send an event and wait for another one: `values = yield from ask("grab", "grabbed", 2.0)`; None if none came."""
    yield tasks.event(request, list(values))
    return (yield event(answer, timeout_s))


def _time(what: str, time_s: float | None) -> float:
    if time_s is None:
        return math.inf
    if isinstance(time_s, bool) or not isinstance(time_s, (int, float)) or not 0.0 <= time_s < math.inf:
        raise ParameterError(f"{what} is given the time {time_s!r}.", fix="seconds, such as 2.0; None: no time-out.")
    return float(time_s)
