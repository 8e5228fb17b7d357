"""A server of movements: a goal is several timed requests that overlap, such as to lift while it turns.

event "move.start" [{"goal": {"turn": [0.5, 2.0], "lift": [1.0, 0.5]}}] --> commands --> event "move.done"

Source: Kooi (2018), whose robot has the requests grab, turn, move and lift.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Mapping, Sequence
from typing import Any, TypeAlias

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
    flow = Flow(name, ("reached", "rejected"))
    flow.add("MOVE", _Move(requests, command))
    return flow_parts(flow, step_hz=step_hz, userdata={"goal": {}})


class _Move(State):
    """All requests of one goal; commands are stored for all of them together."""

    outcomes: tuple[str, ...] = ("reached", "rejected")
    input_keys: tuple[str, ...] = ("goal",)

    def __init__(self, requests: Sequence[str], command: Command) -> None:
        self._requests, self._command = tuple(requests), command

    def run(self, userdata: Userdata) -> Generator[Any, Any, str]:
        """See `State`."""
        goal, begun_s, who = userdata.goal, self.get_time_s(), self.owner.name
        if problem := _problem_of(goal, self._requests):
            self.owner.parent.add_note(f"The goal of '{who}' was rejected: {problem}")
            return "rejected"
        for name, (_, duration_s) in goal.items():
            if not duration_s:
                self.owner.parent.add_note(f"'{who}': '{name}' lasts 0 s, and does nothing.")
        lasting = {name: request for name, request in goal.items() if request[1]}
        try:
            while lasting:
                # Rounded, as the difference of two times has errors of 1e-16 s, for which it would wait a step more.
                passed_s = round(self.get_time_s() - begun_s, 9)
                lasting = {name: request for name, request in lasting.items() if request[1] > passed_s}
                yield self._tasks({name: magnitude for name, (magnitude, _) in lasting.items()})
                left_s = [round(duration_s - passed_s, 9) for _, duration_s in lasting.values()]
                if lasting:
                    yield wait(min([*left_s, REPEAT_S]))
        except Preempted:
            yield self._tasks({})
        return "reached"

    def _tasks(self, magnitudes: Mapping[str, float]) -> list[Task]:
        """Return the tasks that store the commands."""
        pages = self._command({**dict.fromkeys(self._requests, 0.0), **magnitudes})
        return [self.store_data_task(key, data) for key, data in pages.items()]


def _problem_of(goal: Any, known: Sequence[str]) -> str:
    if not isinstance(goal, Mapping):
        return f"{goal!r:.80} is not a dict, such as {{'{known[0]}': [0.5, 2.0]}}."
    for name, request in goal.items():
        if name not in known:
            return f"there is no request '{name!s:.40}': {suggest(str(name), known)}"
        are_numbers = isinstance(request, tuple) and [type(one) in (int, float) for one in request] == [True, True]
        if not are_numbers or not all(map(math.isfinite, request)) or request[1] < 0.0:
            return f"'{name}' is {request!r:.80}; it takes a magnitude and a duration of 0 s or more."
    return ""
