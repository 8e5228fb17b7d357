"""A state whose work is a function that blocks: on a thread of its own, outside of lock step.

ThreadState --> page "<path>.call" --> ThreadCalls: function(...) --> event "<path>.returned" --> ThreadState
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Generator, Mapping
from dataclasses import KW_ONLY, dataclass, field, replace
from typing import Any

from snr_sim.behaviors.flow.state import Execution, State
from snr_sim.behaviors.flow.userdata import Userdata, check_known, data_copy, inputs_of
from snr_sim.behaviors.flow.waits import event
from snr_sim.core.endpoint import Endpoint
from snr_sim.core.loop import NEVER_S, Loop, LoopFactory
from snr_sim.core.source_location import after_line, location_of
from snr_sim.prelude import tasks
from snr_sim.prelude.errors import ConfigError, TaskError
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.task import DataKey


@dataclass(eq=False)
class ThreadState(State):
    """A state that calls a function which may block, and ends with what it returns: an outcome, or an outcome and a
    dict of data.

    The function runs in a loop of its own on a thread. What it returns enters the node as an event: a replay does not
    call it. In lock step the virtual clock calls it, so it takes no time there, and a run repeats only if the function
    does; a note says so. A call cannot be interrupted: when the state is preempted it is left, and the next call waits
    until the function has returned.

    Args:
        function: is given the data of `input_keys` by name.
        outcomes: that it returns.
        input_keys, output_keys: data that it is given, and may return.
    """

    function: Callable[..., Any]
    outcomes: tuple[str, ...] = ("done",)
    _: KW_ONLY
    input_keys: tuple[str, ...] = ()
    output_keys: tuple[str, ...] = ()
    _path: str = field(default="", init=False)
    _calls: dict[str, int] = field(default_factory=dict, init=False)  # how many there have been, by path

    def __post_init__(self) -> None:
        if not callable(self.function):
            raise ConfigError(f"ThreadState is given {self.function!r:.80}.", fix="a function, without brackets.")

    def __deepcopy__(self, memo: object) -> ThreadState:
        """Return a copy with the same function: what that works on, such as a connection, has no copy."""
        return replace(self)

    def execution(self, path: str, data: dict[str, Any], remapping: Mapping[str, str], owner: Endpoint) -> Execution:
        """Return one execution."""
        here = copy.copy(self)  # the state may be at several paths at once
        here._path = path
        return State.execution(here, path, data, remapping, owner)

    def run(self, userdata: Userdata) -> Generator[Any, Any, str]:
        """Send the call, and wait for what it returns."""
        node, path = self.owner.parent, self._path
        if not node.is_replay and path not in node.components:
            raise ConfigError(f"State '{path}' has no thread.", fix="flow_parts(flow): it has factories of threads.")
        number = self._calls[path] = self._calls.get(path, 0) + 1
        yield self.store_data_task(f"{path}.call", [number, inputs_of(userdata)], process=False)
        returned = -1
        while returned != number:  # an earlier call may return after its state was left
            returned, outcome, found = yield event(f"{path}.returned")
        for name, value in found.items():
            setattr(userdata, name, value)
        return str(outcome)


class ThreadCallsFactory(LoopFactory):
    """Factory of the loop that calls the function of a state at a path of a flow."""

    def __init__(self, path: str, state: ThreadState) -> None:
        super().__init__()
        self.path: str = path
        self.state: ThreadState = state

    def get(self, parent: NodeApi) -> ThreadCalls:
        """Return the loop."""
        return ThreadCalls(self, parent, self.path, 10.0)


class ThreadCalls(Loop):
    """Calls a function once for each page "<path>.call"."""

    factory: ThreadCallsFactory

    def __init__(self, factory: ThreadCallsFactory, parent: NodeApi, name: str, max_tick_rate_hz: float) -> None:
        super().__init__(factory, parent, name, max_tick_rate_hz)
        self.wakes_on: tuple[DataKey, ...] = (f"{name}.call",)
        self._number = 0

    def setup(self) -> None:
        """Note what a run in lock step does not show."""
        if self.parent.is_in_lock_step:
            self.parent.add_note(
                f"'{self.name}' is called by the virtual clock: it takes no time, and the run repeats only if it does."
            )

    def loop(self) -> None:
        """Call the function, if that is asked for.

        Raises:
            TaskError: it returned something else than text, perhaps with a dict.
            UnknownNameError: that is not an outcome of the state.
        """
        self.next_tick_at_s = NEVER_S
        page = self.parent.get_page(f"{self.name}.call")
        if page is None or page.data[0] == self._number:
            return
        self._number, inputs = page.data
        state = self.factory.state
        returned = state.function(**inputs)
        outcome, found = returned if isinstance(returned, tuple) and len(returned) == 2 else (returned, {})
        text = after_line(location_of(state.function), f"The function of '{self.name}' returned {returned!r:.80}.")
        if not isinstance(outcome, str) or not isinstance(found, dict):
            raise TaskError(text, fix='return "done", or return "done", {"way_m": 2.0}.')
        check_known(outcome, state.outcomes, text, "its outcomes are")
        self.schedule(tasks.event(f"{self.name}.returned", [self._number, outcome, data_copy(self.name, found)]))
