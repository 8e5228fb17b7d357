"""The event machine with a witness: the same steps in the same order, and every one of them taken down."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import islice

from snr_sim.core.door import Door
from snr_sim.core.handlers import Lookup
from snr_sim.core.machine import EventMachine, HandlerFailed, as_tasks
from snr_sim.prelude.component import Component
from snr_sim.prelude.errors import ComponentFailed
from snr_sim.prelude.recorder import Handled, NodeRecorder, Ticket
from snr_sim.prelude.task import Task, TaskType


class RecordingMachine(EventMachine):
    """Queues tickets instead of tasks: a ticket knows which record brought its task.

    Args:
        lookup, door, latch: as for `EventMachine`.
        recorder: is told of every input and every executed task.
    """

    def __init__(self, lookup: Lookup, door: Door, latch: Callable[[], float] | None, recorder: NodeRecorder) -> None:
        super().__init__(lookup, door, latch)
        self._recorder = recorder
        self._scheduled: list[Task] = []  # by the running component, so far

    def waiting_tasks(self, at_most: int) -> list[Task]:
        """Returns the oldest tasks that have been let in."""
        return [ticket[0] for ticket in list(islice(self.queue, at_most))]

    def run_ready(self) -> None:
        """Executes tasks as `EventMachine.run_ready` does, and raises what that raises."""
        tickets, urgent, waiting = self.queue, self._urgent, self.door.waiting
        while self.executed < self.most_executed:
            if waiting:
                self.let_in()
            if not (tickets or urgent):
                return
            self.execute_next()
            if self.is_ended:
                return

    def execute_next(self) -> None:
        """Executes one task and takes it down, also when a handler raises: the trace is whole up to there."""
        ticket = (self._urgent or self.queue).popleft()
        task = self.task = ticket[0]
        if self._latch is not None:
            self.now_s = self._latch()
        self.executed += 1
        handled: list[Handled] = []
        scheduled = self._scheduled
        try:
            try:
                entries = self.lookup.cache[task.type][task.name]
            except (KeyError, TypeError):
                entries = self.lookup.find(task)
            for self.running, handler, task_id, label in entries:
                returned = handler(task, task_id)
                if type(returned) is not Task or scheduled:
                    outputs = (*scheduled, *as_tasks(returned, self.running, handler))
                    scheduled.clear()
                    handled.append((label, outputs))
                else:
                    handled.append((label, (returned,)))
        except (ComponentFailed, HandlerFailed):
            raise
        except BaseException as error:
            culprit, self.running = self.running, None  # nobody interrupts the recorder
            self._queue_tickets(self._recorder.task(self.now_s, ticket, handled))
            raise HandlerFailed(culprit, task) from error
        finally:
            self.running = self.task = None
            if scheduled:
                scheduled.clear()
        tickets = self._recorder.task(self.now_s, ticket, handled)
        if tickets:
            self._queue_tickets(tickets)

    def begin_component(self, component: Component) -> None:
        """Calls a component's `begin` and takes down what it schedules."""
        super().begin_component(component)
        if self._scheduled:
            tickets = self._recorder.begun(self.now_s, component.name, tuple(self._scheduled))
            self._scheduled.clear()
            self._queue_tickets(tickets)

    def schedule(self, tasks: Sequence[Task]) -> None:
        """Keeps what the running component schedules until it is done: it is part of what it returns."""
        self._scheduled.extend(tasks)

    @property
    def next_ticket(self) -> Ticket | None:
        """The ticket that `execute_next` will take."""
        waiting = self._urgent or self.queue
        return waiting[0] if waiting else None

    @property
    def next_task(self) -> Task | None:
        """The task that `execute_next` will take."""
        ticket = self.next_ticket
        return None if ticket is None else ticket[0]

    def forget_queued(self) -> None:
        """Drops what waits, at the door or inside: a replay does not finish what the recorded run left."""
        self.door.waiting.clear()
        self.queue.clear()
        self._urgent.clear()

    def admit(self, task: Task, source: str) -> None:
        """Queues an input without a door, as a replay does."""
        self._enter(task, source)

    def _enter(self, task: Task, source: str) -> None:
        if self._latch is not None:
            self.now_s = self._latch()
        ticket = self._recorder.input(self.now_s, source, task)
        (self._urgent if task.type is _TERMINATE else self.queue).append(ticket)

    def _queue_tickets(self, tickets: list[Ticket]) -> None:
        for ticket in tickets:
            (self._urgent if ticket[0].type is _TERMINATE else self.queue).append(ticket)


_TERMINATE = TaskType.terminate
