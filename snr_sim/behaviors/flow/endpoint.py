"""A flow as a component of a node: it takes steps at the events of its clock, and at what its states wait for."""

from __future__ import annotations

import copy
from collections.abc import Collection, Mapping
from contextlib import suppress
from typing import Any

from snr_sim.behaviors.context import NS_PER_S
from snr_sim.behaviors.endpoint import StepLoopFactory
from snr_sim.behaviors.flow.flow import Flow
from snr_sim.behaviors.flow.sequential import SequentialExecution
from snr_sim.behaviors.flow.state import walk
from snr_sim.behaviors.flow.thread_state import ThreadCallsFactory, ThreadState
from snr_sim.behaviors.flow.userdata import data_copy
from snr_sim.behaviors.flow.waits import Step
from snr_sim.core.endpoint import Endpoint, EndpointFactory
from snr_sim.core.factory import ComponentFactory
from snr_sim.prelude import tasks
from snr_sim.prelude.errors import ConfigError, ParameterError, suggest
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.task import SomeTasks, Task, TaskHandlerMap, TaskId, TaskType


def flow_parts(
    flow: Flow,
    name: str = "",
    *,
    step_hz: float = 100.0,
    userdata: Mapping[str, Any] | None = None,
    preempt_deadline_s: float = 1.0,
) -> list[ComponentFactory]:
    """Return the factories of a flow, of its clock and of its threads, for a controller's `factories`; see
    `FlowFactory`."""
    made = FlowFactory(flow, name, userdata=userdata, preempt_deadline_s=preempt_deadline_s)
    threads = [ThreadCallsFactory(path, one) for path, one in walk(flow.name, flow) if isinstance(one, ThreadState)]
    return [StepLoopFactory(made.name, step_hz), *threads, made]


class FlowFactory(EndpointFactory):
    """Factory of a component that runs a flow.

    Args:
        flow: what it runs, from the begin of the node.
        name: of the component, of its page, and the beginning of its events' names; that of the flow if not given.
        userdata: data with which the flow begins.
        preempt_deadline_s: how long a state may take to end when it is preempted.

    Raises:
        ConfigError: the flow cannot run, or the data are not data.
    """

    def __init__(
        self,
        flow: Flow,
        name: str = "",
        *,
        userdata: Mapping[str, Any] | None = None,
        preempt_deadline_s: float = 1.0,
    ) -> None:
        super().__init__()
        if not isinstance(flow, Flow):
            raise ConfigError(f"FlowFactory is given {flow!r}.", fix='Flow("mission", outcomes=("done",)).')
        if not 0.0 <= preempt_deadline_s < float("inf"):
            raise ParameterError(f"preempt_deadline_s is {preempt_deadline_s!r}.", fix="seconds, such as 1.0.")
        flow.check(flow.name)
        self.flow: Flow = flow
        self.name: str = name or flow.name
        self.userdata: dict[str, Any] = data_copy("userdata", dict(userdata or {}))
        self.preempt_deadline_s: float = preempt_deadline_s

    def get(self, parent: NodeApi) -> FlowEndpoint:
        """Return the component."""
        return FlowEndpoint(self, parent, self.name)


HANDLED = ("step", "preempt", "goto", "start")  # events, besides those that its states wait for


class FlowEndpoint(Endpoint):
    """Runs a flow. Each step returns what the states have sent; for each change an event "<name>.transition" with its
    fields as a dict; at the end an event "<name>.done" [outcome, data]; and, if a state has changed, one page "<name>".

    Events that it handles, besides those that its states wait for:

        <name>.preempt                 ends the active states, within the deadline; the outcome is "preempted"
        <name>.goto [label, data]      leaves the active state, and enters another one; data are set before; no effect
                                       while the flow is being preempted
        <name>.start [data]            begins again, once it has ended
    """

    factory: FlowFactory

    def __init__(self, factory: FlowFactory, parent: NodeApi, name: str) -> None:
        super().__init__(factory, parent, name)
        self.outcome: str | None = None
        self._flow = _copy_of(factory.flow)  # its states belong to this component
        self._data = data_copy("userdata", factory.userdata)
        self._execution: SequentialExecution | None = None
        self._last: dict[str, Any] | None = None
        # That no other component needs.
        self.optional_events: Collection[str] = [f"{name}.{what}" for what in ("transition", "done", *HANDLED)]
        self._set_handlers()

    def begin(self) -> None:
        """Enter the initial state."""
        self.schedule(self._start())

    def halt(self) -> None:
        """Close the states that are active."""
        if self._execution is not None:
            self._execution.close()

    def on_step(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Take a step."""
        return self._advance(self._step()) or None

    def on_page(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Take a step with a page that a state waits for."""
        assert task.page is not None
        return self._advance(self._step("page", str(task.page.key), task.page.data))

    def on_event(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Take a step with an event that a state waits for."""
        return self._advance(self._step("event", task.name, list(task.val_list)))

    def on_preempt(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Preempt the flow."""
        execution, step = self._execution, self._step()
        return None if execution is None else self._results(execution.preempt(step), step)

    def on_goto(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Enter another state; a request that cannot be met is noted."""
        label, data = (*task.val_list, {})[:2] if task.val_list else ("", {})
        execution, step = self._execution, self._step()
        known = self._flow.entries
        why = "the flow has ended" if execution is None else "it is being preempted" if execution.is_preempted else ""
        if execution is None or why or not isinstance(label, str) or label not in known or not isinstance(data, dict):
            why = why or suggest(str(label), known)
            self.parent.add_note(f"'{task.name}' {task.val_list!r:.200} was rejected: {why}")
            return None
        execution.scope.data.update(data_copy(task.name, data))
        return self._results(execution.go_to(known[label], step), step)

    def on_start(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Begin again, if it has ended."""
        if self._execution is not None:
            self.parent.add_note(f"'{task.name}' was rejected: the flow has not ended.")
            return None
        data = task.val_list[0] if task.val_list else {}
        if not isinstance(data, dict):
            self.parent.add_note(f"'{task.name}' {task.val_list!r:.200} was rejected: give a dict.")
            return None
        self._data.update(data_copy(task.name, data))
        return self._start()

    def _start(self) -> list[Task]:
        self.outcome = None
        step = self._step()
        # The flow works on the component's own data: all that it was given, and all that it gives back.
        self._execution = self._flow.execution(self._flow.name, self._data, {}, self)
        self._execution.scope.data = self._data
        return self._results(self._execution.begin(step), step, is_new=True)

    def _step(self, kind: str = "", name: str = "", value: Any = None) -> Step:
        now_ns = round(self.get_time_s() * NS_PER_S)
        return Step(now_ns, self.factory.preempt_deadline_s, kind, name, value, [], [])

    def _advance(self, step: Step) -> list[Task]:
        execution = self._execution
        return [] if execution is None else self._results(execution.step(step), step)

    def _results(self, outcome: str | None, step: Step, *, is_new: bool = False) -> list[Task]:
        """Return the tasks of a step."""
        found = step.tasks
        if outcome is not None:
            self._execution, self.outcome = None, outcome
        if step.moves or is_new:
            self._last = step.moves[-1] if step.moves else None
            found += [tasks.event(f"{self.name}.transition", [one]) for one in step.moves]
            found.append(self.store_data_task(self.name, self._page()))
        if outcome is not None:
            found.append(tasks.event(f"{self.name}.done", [outcome, data_copy("userdata", self._data)]))
        self._set_handlers()
        return found

    def _page(self) -> dict[str, Any]:
        return {
            "active": {} if self._execution is None else self._execution.active(),
            "outcome": self.outcome,
            "last": self._last,
            "userdata": data_copy("userdata", self._data),
        }

    def _set_handlers(self) -> None:
        """Handle what the active states wait for, and what is always handled."""
        handlers: TaskHandlerMap = {
            (TaskType.event, f"{self.name}.{what}"): getattr(self, f"on_{what}") for what in HANDLED
        }
        for wait in [] if self._execution is None else self._execution.waits():
            if wait.kind == "page":
                handlers[TaskType.process_data, wait.name] = self.on_page
            elif wait.kind == "event":
                handlers[TaskType.event, wait.name] = self.on_event
        if handlers.keys() != self.task_handlers.keys():
            self.task_handlers = handlers


def _copy_of(flow: Flow) -> Flow:
    """Return a copy of a flow.

    Raises:
        ConfigError: a state has an attribute that cannot be copied.
    """
    try:
        return copy.deepcopy(flow)
    except TypeError as error:
        for label, one in flow.entries.items():
            with suppress(TypeError):
                copy.deepcopy(one)
                continue
            raise ConfigError(
                f"State '{label}' of flow '{flow.name}' has an attribute of which a node can have no copy: {error}.",
                fix="make it in run(): such as a lock, a file or a connection.",
            ) from error
        raise
