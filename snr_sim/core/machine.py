"""Event machine: takes one task, runs its handlers, and queues the tasks that they return.

One step: tasks in the inbox are queued; a task is taken, oldest first, `terminate` before all others; `now_s` is
latched; all handlers of the task run, in component order; the tasks they returned are queued, in order. With a
recorder every step is recorded, and the queue holds references instead of tasks: each names the record that
scheduled its task.

Nodes without a recorder have an inner loop of their own in `run_ready`, so they pay for the recorder once per call.
"""

from __future__ import annotations

import sys
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import islice
from typing import Any

from snr_sim.core.handlers import HandlerLookup, as_tasks, schedule_returned
from snr_sim.core.inbox import Inbox
from snr_sim.prelude.component import Component
from snr_sim.prelude.errors import ComponentFailedError
from snr_sim.prelude.recorder import Handled, NodeRecorder, TaskRef
from snr_sim.prelude.task import Page, Task, TaskType

# At its end a run executes the queued tasks, and the tasks they return, this many generations deep: the last page is
# stored and processed, and the resulting page is stored. A task that reschedules itself endlessly is cut off here.
DRAIN_GENERATIONS = 10
# On the wall clock it also takes no longer than this: shutdown of a robot must not wait for a long queue.
MAX_DRAIN_S = 0.3
BURST_TASKS = 1000  # inputs in the inbox at once that are counted, for the limit in core/lockstep.py
_TERMINATE = TaskType.terminate


@dataclass
class GuardedCall:
    """A call after which there may be a rollback: see `core/reload/rollback.py`.

    Args:
        component: the one whose code is called.
        is_interruptible: whether it is interrupted if it does not return (`core/interrupts.py`).
        message: of the failure that an interrupt is.
        attempts: number of times it was to be interrupted.
        is_interrupted: whether it was: its code may catch that.
        scheduled: tasks that it has scheduled; they are not queued yet.
        read: pages that it has looked up.
    """

    component: str
    is_interruptible: bool = False
    message: str = ""
    attempts: int = 0
    is_interrupted: bool = False
    scheduled: list[Task] = field(default_factory=list)
    read: list[Page] = field(default_factory=list)


class HandlerError(Exception):
    """Failure in a handler, with the component and the task. The original exception is its cause."""

    def __init__(self, component: Component | None, task: Task) -> None:
        super().__init__()
        self.component: Component | None = component
        self.task: Task = task


class EventMachine:
    """Queue and execution of one node's tasks.

    Args:
        lookup, inbox: of the node.
        latch: returns the time for the next task; None if `now_s` is set from outside, as in lock step.
        recorder: gets every input and every executed task, if there is one.
    """

    def __init__(
        self,
        lookup: HandlerLookup,
        inbox: Inbox,
        latch: Callable[[], float] | None,
        recorder: NodeRecorder | None = None,
    ) -> None:
        self.lookup: HandlerLookup = lookup
        self.inbox: Inbox = inbox
        self.now_s: float = 0.0
        self.executed: int = 0
        self.max_executed: int = sys.maxsize  # limit of `run_ready`: see core/lockstep.py
        self.accepted: int = 0  # inputs
        self.on_burst: Callable[[int], None] = lambda count: None  # so many inputs are accepted now
        self.longest_queue: int = 0  # right after inputs were queued: there it grows if inputs arrive too fast
        self.running: Component | None = None  # the component whose code runs now
        self.task: Task | None = None  # the task whose handlers run now
        self.is_ended: bool = False
        self.guarded_call: GuardedCall | None = None  # the present call, if it is guarded
        self.on_input: Callable[[Task, str], None] | None = None  # called with each input, and its source
        self._latch = latch
        self._recorder = recorder
        self._scheduled: list[Task] = []  # by the running component of a recorded node, so far
        self.queue: deque[Any] = deque()  # queued tasks other than `terminate`, or their tickets
        self._urgent: deque[Any] = deque()

    @property
    def queued(self) -> int:
        """Number of waiting tasks, in the inbox or queued."""
        return len(self.queue) + len(self._urgent) + len(self.inbox.waiting)

    @property
    def queue_length(self) -> int:
        """Number of queued tasks, without those in the inbox."""
        return len(self.queue) + len(self._urgent)

    @property
    def next_task_ref(self) -> Any:
        """The ticket that `execute_next` will take (the task, without a recorder); None if the queue is empty."""
        waiting = self._urgent or self.queue
        return waiting[0] if waiting else None

    def waiting_tasks(self, at_most: int) -> list[Task]:
        """Return the oldest queued tasks. Safe from another thread, since the queue is copied atomically."""
        oldest = list(islice(self.queue, at_most))
        return oldest if self._recorder is None else [task_ref[0] for task_ref in oldest]

    def run_ready(self) -> None:
        """Execute tasks until none is left, the machine has ended, or it has executed `max_executed` tasks.

        Raises:
            HandlerError: a handler raised, or returned a value that is not tasks.
            ComponentFailedError: a loop failed on its own thread.
        """
        if self._recorder is not None:
            self._run_recorded()
            return
        # The hot loop: local names, and no calls other than the handlers'.
        queue, urgent, waiting = self.queue, self._urgent, self.inbox.waiting
        take, put, cache, latch, terminate = queue.popleft, queue.append, self.lookup.cache, self._latch, _TERMINATE
        executed, limit = 0, self.max_executed - self.executed
        task: Task | None = None
        try:
            while executed < limit:
                if waiting:
                    self.accept_inputs()
                if urgent:
                    self.execute_next()
                    if self.is_ended:
                        return
                    continue
                if not queue:
                    return
                task = self.task = take()
                if latch is not None:
                    self.now_s = latch()
                executed += 1
                try:
                    entries = cache[task.type][task.name]
                except (KeyError, TypeError):
                    self.running = None
                    entries = self.lookup.find(task)
                for self.running, handler, task_id, _ in entries:
                    returned = handler(task, task_id)
                    if returned is None:
                        continue
                    if type(returned) is Task and returned.type is not terminate:
                        put(returned)
                    else:
                        self._queue_all(as_tasks(returned, self.running, handler))
        except (HandlerError, ComponentFailedError):
            raise
        except BaseException as error:
            if task is None:
                raise
            raise HandlerError(self.running, task) from error
        finally:
            self.executed += executed
            self.running = self.task = None

    def _run_recorded(self) -> None:
        queue, urgent, waiting = self.queue, self._urgent, self.inbox.waiting
        while self.executed < self.max_executed:
            if waiting:
                self.accept_inputs()
            if not (queue or urgent):
                return
            self.execute_next()
            if self.is_ended:
                return

    def execute_next(self) -> None:
        """Execute one task of a queue that is not empty; it is recorded even if a handler raises a HandlerError."""
        task_ref = (self._urgent or self.queue).popleft()
        recorder, scheduled = self._recorder, self._scheduled
        task = self.task = task_ref if recorder is None else task_ref[0]
        if self._latch is not None:
            self.now_s = self._latch()
        self.executed += 1
        handled: list[Handled] = []
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
        except (ComponentFailedError, HandlerError):
            raise
        except BaseException as error:
            culprit, self.running = self.running, None  # so that no interrupt is raised in the recorder
            self._queue_handled(task_ref, handled)
            raise HandlerError(culprit, task) from error
        finally:
            self.running = self.task = None
            if scheduled:
                scheduled.clear()
        if recorder is None:
            self._queue_handled(task_ref, handled)
        elif task_refs := recorder.task(self.now_s, task_ref, handled):
            self._queue_task_refs(task_refs)

    def drain(self) -> int:
        """Execute the queued tasks after the machine has ended; return how many were cut off."""
        self.accept_inputs()
        give_up_s = None if self._latch is None else self._latch() + MAX_DRAIN_S
        for _ in range(DRAIN_GENERATIONS):
            for _ in range(self.queue_length):
                if give_up_s is not None and self.now_s > give_up_s:
                    return self.queue_length
                self.execute_next()
            if not self.queue_length:
                return 0
        return self.queue_length

    def accept_inputs(self) -> None:
        """Queue the tasks in the inbox, in the order that a replay repeats; raise what a loop's thread reported."""
        if self.inbox.failure is not None:
            raise self.inbox.failure
        waiting, enqueue = self.inbox.waiting, self._enqueue
        count = len(waiting)  # not until it is empty: another thread may fill it as fast
        if count >= BURST_TASKS:
            self.on_burst(count)
        self.accepted += count
        for _ in range(count):
            enqueue(*waiting.popleft())
        queue_length = self.queue_length
        if queue_length > self.longest_queue:
            self.longest_queue = queue_length

    def begin_component(self, component: Component) -> None:
        """Call a component's `begin`; tasks it schedules or returns are queued as results, not as inputs."""
        self.running = component
        try:
            schedule_returned(component.begin(), component, component.begin)
        finally:
            self.running = None
        if self._recorder is not None and self._scheduled:
            task_refs = self._recorder.begun(self.now_s, component.name, tuple(self._scheduled))
            self._scheduled.clear()
            self._queue_task_refs(task_refs)

    def schedule(self, tasks: Sequence[Task]) -> None:
        """Queue tasks of the running component, before those it will return; the recorder counts them as returned."""
        if self.guarded_call is not None:
            self.guarded_call.scheduled.extend(tasks)
        elif self._recorder is None:
            self._queue_all(tasks)
        else:
            self._scheduled.extend(tasks)

    def discard_queued(self) -> None:
        """Drop all waiting tasks, queued or in the inbox: a replay does not execute what the recorded run left."""
        self.inbox.waiting.clear()
        self.queue.clear()
        self._urgent.clear()

    def enqueue_replayed(self, task: Task, source: str) -> None:
        """Queue an input directly, as a replay does."""
        self._enqueue(task, source)

    def record_effective(self, task: Task, source: str) -> None:
        """Record an input that has taken effect within the running task, at that task's time; queue it all the same."""
        if self._recorder is not None:
            self._queue_task_refs((self._recorder.input(self.now_s, source, task),))

    def _enqueue(self, task: Task, source: str) -> None:
        if self._recorder is None:
            if self.on_input is not None:
                self.on_input(task, source)
            (self._urgent if task.type is _TERMINATE else self.queue).append(task)
            return
        if self._latch is not None:
            self.now_s = self._latch()
        if self.on_input is not None:
            self.on_input(task, source)
        self._queue_task_refs((self._recorder.input(self.now_s, source, task),))

    def _queue_handled(self, task_ref: Any, handled: list[Handled]) -> None:
        if self._recorder is not None:
            self._queue_task_refs(self._recorder.task(self.now_s, task_ref, handled))
            return
        for _, outputs in handled:
            self._queue_all(outputs)

    def _queue_all(self, tasks: Sequence[Task]) -> None:
        for task in tasks:
            (self._urgent if task.type is _TERMINATE else self.queue).append(task)

    def _queue_task_refs(self, task_refs: Sequence[TaskRef]) -> None:
        for task_ref in task_refs:
            (self._urgent if task_ref[0].type is _TERMINATE else self.queue).append(task_ref)
