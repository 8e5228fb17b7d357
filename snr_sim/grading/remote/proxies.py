"""Proxies: what stands in the grader's node for a student's endpoint or loop, and has each step done in its process."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from snr_sim.core.endpoint import Endpoint, EndpointFactory
from snr_sim.core.loop import Loop, LoopFactory
from snr_sim.grading.remote.node_messages import HandlerRow, Made
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.task import SomeTasks, Task, TaskHandler, TaskHandlerMap, TaskId, TaskType

if TYPE_CHECKING:
    from snr_sim.grading.remote.remote import Remote  # which makes these


class RemoteEndpointFactory(EndpointFactory):
    """Makes the proxy of an endpoint."""

    def __init__(self, remote: Remote, number: int) -> None:
        super().__init__()
        self.remote = remote
        self._number = number

    def get(self, parent: NodeApi) -> Endpoint:
        """Returns a proxy; the student's own endpoint is made in its process."""
        return RemoteEndpoint(self, parent, self.remote.make(self._number, parent))


class RemoteEndpoint(Endpoint):
    """Stands for an endpoint of the student's."""

    factory: RemoteEndpointFactory

    def __init__(self, factory: RemoteEndpointFactory, parent: NodeApi, made: Made) -> None:
        super().__init__(factory, parent, made.name)
        self._steps = {"join" if step == "halt" else step for step in made.steps}
        self.task_handlers = self.handlers_of(made.handlers)

    def handlers_of(self, rows: Sequence[HandlerRow]) -> TaskHandlerMap:
        """Returns handlers that have the student's called."""
        handlers: TaskHandlerMap = {}
        for kind, name, label in rows:
            task_type = TaskType(kind)
            handlers[task_type if name is None else (task_type, name)] = self._handler(label)
        return handlers

    def _handler(self, label: str) -> TaskHandler:
        def handle(task: Task, task_id: TaskId) -> SomeTasks:
            return self.factory.remote.handle(self, task)

        handle.__name__ = label
        return handle

    def begin(self) -> None:
        """Has the student's `begin` called, if there is one."""
        self._do("begin")

    def join(self) -> None:
        """Has the student's `halt` called, if there is one."""
        self._do("join")

    def terminate(self) -> None:
        """Has the student's `terminate` called, if there is one."""
        self._do("terminate")

    def _do(self, step: str) -> None:
        if step in self._steps:
            done = self.factory.remote.step(self, step)
            self.schedule(self.factory.remote.admission.tasks(done.scheduled, self.parent, self.name))


class RemoteLoopFactory(LoopFactory):
    """Makes the proxy of a loop."""

    def __init__(self, remote: Remote, number: int) -> None:
        super().__init__()
        self.remote = remote
        self._number = number

    def get(self, parent: NodeApi) -> Loop:
        """Returns a proxy; the student's own loop is made in its process."""
        return RemoteLoop(self, parent, self.remote.make(self._number, parent))


class RemoteLoop(Loop):
    """Stands for a loop of the student's: the grader's clock says when it ticks."""

    factory: RemoteLoopFactory

    def __init__(self, factory: RemoteLoopFactory, parent: NodeApi, made: Made) -> None:
        super().__init__(factory, parent, made.name, made.rate_hz)
        self.first_tick_after_s = made.first_s
        self.next_tick_at_s = made.next_s

    def setup(self) -> None:
        """Has the student's `setup` called."""
        self._do("setup")

    def loop(self) -> None:
        """Has the student's `loop` called."""
        self._do("loop")

    def halt(self) -> None:
        """Has the student's `halt` called."""
        self._do("join")

    def terminate(self) -> None:
        """Has the student's `terminate` called."""
        self._do("terminate")

    def _do(self, step: str) -> None:
        done = self.factory.remote.step(self, step)
        self.next_tick_at_s = done.next_s
        if done.is_stopped:
            self.stop()
