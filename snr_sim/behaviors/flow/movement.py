"""A server of movements: a goal is several timed requests that overlap, such as to lift while it turns.

event "move.start" [{"goal": {"turn": [0.5, 2.0], "lift": [1.0, 0.5]}}] --> commands --> event "move.done"

Source: Kooi (2018), whose robot has the requests grab, turn, move and lift.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Mapping, Sequence
from typing import Any, TypeAlias

from snr_sim.behaviors.flow.concurrence import Concurrence
from snr_sim.behaviors.flow.endpoint import flow_parts
from snr_sim.behaviors.flow.flow import Flow
from snr_sim.behaviors.flow.state import State
from snr_sim.behaviors.flow.userdata import Userdata
from snr_sim.behaviors.flow.waits import Preempted, wait
from snr_sim.core.factory import ComponentFactory
from snr_sim.prelude.errors import suggest
from snr_sim.prelude.task import DataKey, Task

# From the magnitude of each request, 0 while it does not last, to the data of pages.
Command: TypeAlias = Callable[[Mapping[str, float]], Mapping[DataKey, Any]]
REPEAT_S = 0.1  # how often commands are stored again: actuators stop at those that are older than 0.2 s or more


def movement_parts(
    requests: Sequence[str], command: Command, name: str = "move", *, step_hz: float = 100.0
) -> list[ComponentFactory]:
    """Return the factories of a movement server.

    Event "<name>.start" [{"goal": {request: [magnitude, duration_s]}}] begins all requests of a goal together. Each one
    ends at its own time: its magnitude is 0 then. After the last one comes "<name>.done" with the outcome "reached".
    A duration of 0 is noted, and does nothing. A goal that is malformed is noted, and has the outcome "rejected".
    "<name>.preempt" ends them all. One goal at a time.

    Args:
        requests: their names.
        command: returns the pages to store, by key, for the magnitudes of all requests.
        name: of the server, and of its page.
        step_hz: how often it looks whether a request is over.
    """
    motors = _Motors(requests, command)
    moves = Concurrence(("reached",), "reached", input_keys=("goal",))
    for one in requests:
        moves.add(one, _Timed(one, motors))
    flow = Flow(name, ("reached", "rejected"))
    flow.add("CHECK", _Check(motors), {"valid": "MOVE"})
    flow.add("MOVE", moves)
    return flow_parts(flow, step_hz=step_hz, userdata={"goal": {}})


class _Motors:
    """The magnitude of each request; commands are stored for all of them together."""

    def __init__(self, requests: Sequence[str], command: Command) -> None:
        self.magnitudes: dict[str, float] = dict.fromkeys(requests, 0.0)
        self._command = command
        self._stored: tuple[float, dict[str, float]] | None = None

    def tasks(self, state: State) -> list[Task]:
        """Return the tasks that store the commands, unless this was done at this moment."""
        now = state.get_time_s(), dict(self.magnitudes)
        if now == self._stored:
            return []
        self._stored = now
        return [state.store_data_task(key, data) for key, data in self._command(now[1]).items()]


class _Check(State):
    """Checks a goal, and sets the magnitudes of all its requests: they begin with one command."""

    outcomes: tuple[str, ...] = ("valid", "rejected")
    input_keys: tuple[str, ...] = ("goal",)

    def __init__(self, motors: _Motors) -> None:
        self._motors = motors

    def run(self, userdata: Userdata) -> str:
        """See `State`."""
        goal, known = userdata.goal, self._motors.magnitudes
        problem = _problem_of(goal, known)
        if problem:
            self.owner.parent.add_note(f"The goal of '{self.owner.name}' was rejected: {problem}")
            return "rejected"
        for name in known:
            magnitude, duration_s = goal.get(name, (0.0, 0.0))
            known[name] = magnitude if duration_s else 0.0
            if name in goal and not duration_s:
                self.owner.parent.add_note(f"'{self.owner.name}': '{name}' lasts 0 s, and does nothing.")
        return "valid"


def _problem_of(goal: Any, known: Mapping[str, float]) -> str:
    if not isinstance(goal, Mapping):
        return f"{goal!r:.80} is not a dict, such as {{'{next(iter(known))}': [0.5, 2.0]}}."
    for name, request in goal.items():
        if name not in known:
            return f"there is no request '{name!s:.40}': {suggest(str(name), known)}"
        are_numbers = isinstance(request, tuple) and [type(one) in (int, float) for one in request] == [True, True]
        if not are_numbers or not all(map(math.isfinite, request)) or request[1] < 0.0:
            return f"'{name}' is {request!r:.80}; it takes a magnitude and a duration of 0 s or more."
    return ""


class _Timed(State):
    """One request: its magnitude is 0 when its time is over, or it is preempted."""

    outcomes: tuple[str, ...] = ("done",)
    input_keys: tuple[str, ...] = ("goal",)

    def __init__(self, name: str, motors: _Motors) -> None:
        self._name, self._motors = name, motors

    def run(self, userdata: Userdata) -> Generator[Any, Any, str]:
        """See `State`."""
        _, duration_s = userdata.goal.get(self._name, (0.0, 0.0))
        if not duration_s:
            return "done"
        end_s = self.get_time_s() + duration_s
        try:
            # Rounded, as the difference of two times has errors of 1e-16 s, for which it would wait a step more.
            while (left_s := round(end_s - self.get_time_s(), 9)) > 0.0:
                yield self._motors.tasks(self)
                yield wait(min(left_s, REPEAT_S))
        except Preempted:
            pass
        self._motors.magnitudes[self._name] = 0.0
        yield self._motors.tasks(self)
        return "done"
