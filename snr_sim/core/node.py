"""Node: one running role of a robot. It has components, an event machine, a datastore, and one inbox.

This module has what components use of their node: tasks, data, time, random numbers. `component_registry.py` creates
and orders components, `node_life.py` begins and ends them, `node_report.py` collects the notes of a run.
"""

from __future__ import annotations

import logging
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

from snr_sim.core.clocks import ClockExecutor, SimClock, WallClock
from snr_sim.core.component import CORE_NAME, NodeComponent, data_of_page
from snr_sim.core.component_registry import ComponentRegistry
from snr_sim.core.config import Config, Mode
from snr_sim.core.datastore import PREVIOUS, Datastore, PageStorage, check_executable, page_age_s
from snr_sim.core.endpoint import Endpoint, EndpointFactory
from snr_sim.core.handlers import HandlerLookup, as_tasks
from snr_sim.core.inbox import Inbox
from snr_sim.core.lockstep import run_node
from snr_sim.core.loop import Loop, LoopExecutor
from snr_sim.core.machine import EventMachine, HandlerError
from snr_sim.core.node_life import NodeLife
from snr_sim.core.node_parts import NodeParts
from snr_sim.core.node_report import NodeReport
from snr_sim.core.profiler import Profiler
from snr_sim.core.reload.reload import ComponentManager
from snr_sim.core.reload.rollback import Probations
from snr_sim.core.reload.sources import reloading_file
from snr_sim.core.run_diagnostics import find_writer
from snr_sim.core.source_location import current_location
from snr_sim.core.thesis_members import NodeMembers
from snr_sim.core.thread_executor import ThreadExecutor
from snr_sim.prelude import tasks
from snr_sim.prelude.clock import Clock
from snr_sim.prelude.component import Component, RoleName
from snr_sim.prelude.errors import ComponentFailedError, ConfigError, TaskError
from snr_sim.prelude.recorder import Recorder
from snr_sim.prelude.rng import component_seed, rng_for
from snr_sim.prelude.task import DataKey, Page, SomeTasks, Task, TaskId, TaskName, TaskType

if TYPE_CHECKING:
    import numpy as np

_PROCESS_DATA = TaskType.process_data  # looked up once, as in component.py


class Node(NodeMembers):
    """Runs the components of one role until a terminate task.

    Args:
        role: which of the config's roles.
        config: factories by role, and mode.
        clock: a `WallClock` if not given; under a `SimClock` the node runs in lock step.
        recorder: writes the trace, if given.
        seed: of the run; all random numbers in the node are derived from it.
        is_replay: loops are not created; their tasks come from the trace.

    Raises:
        UnknownNameError: the config has no such role.
        ConfigError: a factory does not return a component, two components have the same name, or the file that
            creates the node is being read again for a reload.
    """

    def __init__(
        self,
        role: RoleName,
        config: Config,
        *,
        clock: Clock | None = None,
        recorder: Recorder | None = None,
        seed: int = 0,
        is_replay: bool = False,
    ) -> None:
        if reloading_file.get():
            raise ConfigError(
                f"{reloading_file.get()} makes a node while it is read again for a reload.",
                fix="put what starts the robot under: if __name__ == '__main__':",
            )
        if not isinstance(config, Config):
            raise ConfigError(
                f"Node({role!r}, ...) got a {type(config).__name__} where its Config belongs.",
                fix=f"Node({role!r}, Config(factories={{{role!r}: [MyFactory()]}})).",
            )
        self.role: RoleName = role
        self.config: Config = config
        self.mode: Mode = config.mode
        self.name: str = f"{role}_node"
        self.clock: Clock = clock or WallClock()
        self.is_in_lock_step: bool = isinstance(self.clock, SimClock)  # then all nodes have one clock
        self.seed: int = seed
        self.component_seed: int = component_seed(seed)  # seed of its components' generators
        self.is_replay: bool = is_replay  # then without effects outside: no files written, no pages sent
        self.inbox: Inbox = Inbox()
        self.datastore: Datastore = Datastore()
        self.profiler: Profiler | None = config.get_profiler()
        self.exit_reason: str | None = None
        self.registry: ComponentRegistry = ComponentRegistry(self)
        latch = None if isinstance(self.clock, SimClock) else self.clock.now_s
        lookup = HandlerLookup(self.registry.components, self.profiler)
        self._recorder = recorder.for_node(self.name) if recorder is not None else None
        self.machine: EventMachine = EventMachine(lookup, self.inbox, latch, self._recorder)
        self.thread_id: int = threading.get_ident()
        self.never_ran: bool = False  # an error ended it at its start, so do not report missing pages
        self.report: NodeReport = NodeReport(self.name, self.clock, self.machine, self._recorder)
        self.life: NodeLife = NodeLife(self, self.registry, self.report, self._recorder)
        lookup.add_note = self.add_note
        self._storage = PageStorage(self.name, self.machine, self.datastore)
        self._core = NodeCore(self, self.life, self._storage)
        self.registry.add(self._core, 0)
        self.registry.add_all(config.get(role), is_replay)

    @property
    def components(self) -> dict[str, Component]:
        """Components by name."""
        return self.registry.components

    @property
    def factories(self) -> Sequence[Any]:
        """Factories that its role has in the config."""
        return self.config.get(self.role)

    @cached_property
    def log(self) -> logging.Logger:
        """A logger named after the node."""
        return logging.getLogger(f"snr.{self.name}")

    # Life: begin, run until ended, end. `loop` does all three.

    def loop(self) -> None:
        """Run until a terminate task has been executed; raise a ComponentFailedError if a handler or a loop raises."""
        run_node(self)

    def begin(self) -> None:
        """Begin each component: see `NodeLife.begin`."""
        self.life.begin()

    def run_ready(self) -> None:
        """Execute tasks until none is left or the node has ended; raise a ComponentFailedError if a handler raises."""
        try:
            self.machine.run_ready()
        except HandlerError as failed:
            failure = self.life.failure_of(failed)
            raise failure from (None if failure is failed.__cause__ else failed.__cause__)

    def end(self, reason: str | None = None, error: Exception | None = None) -> None:
        """Finish what is queued, then halt and terminates each component: see `NodeLife.end`."""
        self.life.end(reason, error)

    def blame_suspects(self, failure: ComponentFailedError) -> bool:
        """Undo new code that may have caused a failure: see `Probations.blame_suspects`."""
        return self.life.blame_suspects(failure)

    @property
    def is_finished(self) -> bool:
        """Whether the end of the run has begun: components are being halted, or have been."""
        return self.life.is_finished

    @property
    def queued_task_count(self) -> int:
        """Number of waiting tasks, in the inbox or queued."""
        return self.machine.queued

    @property
    def is_terminated(self) -> bool:
        """Whether a terminate task has been executed."""
        return self.machine.is_ended

    def set_terminate_flag(self, reason: str) -> None:
        """End the node after the current task, as a terminate task does; from any thread, and before it begins."""
        self.schedule(Task(TaskType.terminate, reason), "set_terminate_flag")

    def find_writer(self, key: DataKey, reader: str) -> tuple[str, str, tuple[str, ...]]:
        """Return what is known of the component that stores pages of a key: see `run_diagnostics.find_writer`."""
        robot = [one for one in self.components.values() if isinstance(one, NodeComponent) and one.is_robot_component]
        maker = self.life.maker_of(self.datastore.pages.get(key))
        makers = [one for one in robot if one.name == maker]
        return find_writer(key, makers or [one for one in robot if one.name != reader])

    # Tasks

    def schedule(self, tasks: SomeTasks, source: str = "outside") -> None:
        """Queue tasks: as results of the running handler, or as inputs of `source` if none of this node's runs."""
        running, is_own_thread = self.machine.running, threading.get_ident() == self.thread_id
        if running is None or not is_own_thread:
            if self.is_in_lock_step and not is_own_thread:
                self._note_thread(source)
            self.enqueue_input(tasks, source)
        elif isinstance(running, Loop):
            self.enqueue_input(tasks, running.name)
        elif self.life.is_halting:
            self.life.note_too_late(running, tasks)
        else:
            self.machine.schedule([tasks] if type(tasks) is Task else as_tasks(tasks, running, self.schedule))

    def _note_thread(self, source: str) -> None:
        """Note, with the student's line, that an endpoint's own thread sends tasks: no clock decides when."""
        location = current_location(sys._getframe())
        if location is not None and isinstance(self.components.get(source), Endpoint):
            self.add_note(
                f"'{source}' sends tasks from a thread of its own, at moments that differ in each run: the same seed "
                "gives another run.\n  Try: a Loop in place of the thread; it ticks on the simulation's clock.",
                f"{location}\n  ",
                is_recorded=False,  # a replay has no part in when the thread sends
            )

    def enqueue_input(self, tasks: SomeTasks, source: str) -> None:
        """Put tasks in the inbox, from any thread; `source` names the sender. Raise a TaskError for anything else."""
        is_checked = self.machine.guarded_call is not None or not self.is_in_lock_step  # new code, or on the wall clock
        if type(tasks) is Task and not is_checked:
            self.inbox.put(tasks, source)
            return
        for task in tasks if isinstance(tasks, (list, tuple)) else [tasks]:
            if type(task) is Task:
                if is_checked:
                    check_executable(task)
                self.inbox.put(task, source)
            elif task is not None:
                raise TaskError(
                    f"'{source}' scheduled {task!r}, which is not a task.", fix="tasks.event('name') makes one."
                )

    def seen_tasks(self) -> Mapping[TaskType, Mapping[TaskName, Any]]:
        """Return all executed tasks by type and name, with their handlers."""
        return self.machine.lookup.seen_tasks()

    def handlers_changed(self) -> None:
        """Clear the handler cache; components call it when their handlers change."""
        self.machine.lookup.invalidate()

    def start_loop(self, loop: Loop, on_thread: bool = False) -> None:
        """Start a loop's ticks: on the virtual clock, on a thread, or in a process; see `NodeApi.start_loop`."""
        executor: LoopExecutor
        if self.is_in_lock_step and not on_thread:
            executor = ClockExecutor(loop, self.life)
        elif loop.executor == "process" and not on_thread:
            from snr_sim.core.process.process_executor import ProcessExecutor  # slow to import, and few robots need it

            executor = ProcessExecutor(loop, self.life)
        else:
            executor = ThreadExecutor(loop, self.life)
        loop.begin_with(executor)

    # Data

    def page(self, key: DataKey, data: Any, process: bool = True) -> Page:
        """Return a page of this node, created now, with a copy of the data: see `data_of_page`.

        Raises:
            TaskError: the data contain a part of the program, such as an endpoint.
        """
        return Page(key, data_of_page(self, key, data), self.name, self.get_time_s(), process)

    def store_page(self, page: Page) -> None:
        """Queue the task that stores a page."""
        self.schedule(Task(TaskType.store_page, page.key, [page]))

    def store_data(self, key: DataKey, data: Any, process: bool = True) -> None:
        """Queue the task that stores data under a key."""
        self.schedule(self.store_data_task(key, data, process))

    def store_data_task(self, key: DataKey, data: Any, process: bool = True) -> Task:
        """Return the task that stores data under a key."""
        return Task(TaskType.store_page, key, [self.page(key, data, process)])

    def get_page(self, key: DataKey) -> Page | None:
        """Return the newest page of a key, or None; `<key>_prev` is the one before.

        In a handler of `process_data` it is the page that the task carries, and the one before that.
        """
        newest = self.datastore.get(key)
        guarded = self.machine.guarded_call
        if guarded is not None and newest is not None and threading.get_ident() == self.thread_id:
            guarded.read.append(newest)
        task = self.machine.task
        if task is None or task.type is not _PROCESS_DATA or not task.val_list:
            return newest
        page: Page = task.val_list[0]
        if page is newest and key == task.name:  # the usual case
            return newest
        pages = self.datastore.pages
        if type(page) is not Page or page is pages.get(page.key) or threading.get_ident() != self.thread_id:
            return newest
        if key == page.key:
            return page
        return self._storage.page_before(page) if key == page.key + PREVIOUS and key not in pages else newest

    def get_data(self, key: DataKey) -> Any:
        """Return the data of `get_page`, or None."""
        page = self.get_page(key)
        return None if page is None else page.data

    def get_age_s(self, key: DataKey) -> float:
        """Return the age of the page of `get_page` [s]; infinite without one, or if unknown: see core/datastore.py."""
        page = self.get_page(key)
        return float("inf") if page is None else page_age_s(self, page)

    def received_at_s(self, key: DataKey) -> float:
        """Return when the newest page of a key from another node arrived here [s]; -inf if none did."""
        return self.datastore.received_s.get(key, float("-inf"))

    def add_store_listener(self, key: DataKey, callback: Callable[[Page], None]) -> None:
        """Call `callback` with every page of a key right after it was stored, on the node's thread: see `NodeCore`."""
        self.datastore.listeners.setdefault(key, []).append(callback)

    def remove_store_listener(self, key: DataKey, callback: Callable[[Page], None]) -> None:
        """End what `add_store_listener` began."""
        self.datastore.listeners[key].remove(callback)

    # Time and random numbers

    def get_time_s(self) -> float:
        """Return the time latched for the running task [s]; outside of tasks, the clock's."""
        machine = self.machine
        if machine.running is not None and threading.get_ident() == self.thread_id:
            return machine.now_s
        return self.clock.now_s()

    @property
    def rng(self) -> np.random.Generator:
        """The random generator of the running component, so that components do not affect each other's numbers.

        On another thread, or outside of any component, it is the node's own.
        """
        running = self.machine.running
        if isinstance(running, (Endpoint, Loop)) and threading.get_ident() == self.thread_id:
            return running.rng
        if "_rng" not in self.__dict__:
            self._rng = rng_for(self.component_seed, self.name)
        return self._rng

    # Report

    @property
    def notes(self) -> list[str]:
        """Remarks for the end of the run."""
        return self.report.notes

    def add_note(self, text: str, lines: str = "", *, is_recorded: bool = True) -> None:
        """Keep a remark for the end of the run, once: see `NodeReport.add_note`."""
        self.report.add_note(text, lines, is_recorded=is_recorded)

    def note_object(self, key: DataKey, kind: type) -> bool:
        """Return whether a page of this key held an object of this class for the first time."""
        return self.report.note_object(key, kind)

    def has_begun(self, component: Component) -> bool:
        """Return whether a component has begun and has not been terminated."""
        return self.life.has_begun(component)

    def record_text(self, component: str, level: str, text: str) -> None:
        """Record a text that a component has printed or logged; from any thread.

        Args:
            component: its name.
            level: PRINT, INFO, WARNING, ...
            text: with its line ends; text after the last one is kept until its line is complete.
        """
        if self._recorder is not None:
            self._recorder.record_text(self.get_time_s(), component, level, text)


class NodeCore(Endpoint):
    """The node's own endpoint, first of its components: it stores pages, and changes or ends the node.

    A page is stored before any other component handles the task, and then its processing is scheduled. The
    page `reload`, `add_component` or `remove_component` has the outcome of such a task.
    """

    is_robot_component = False

    def __init__(self, parent: NodeParts, life: NodeLife, storage: PageStorage) -> None:
        super().__init__(EndpointFactory(), parent, CORE_NAME)
        self._node = parent
        manager = ComponentManager(life, self)
        probations = Probations(manager)
        self.task_handlers = {
            TaskType.store_page: storage.store,
            TaskType.terminate: self.end_node,
            TaskType.reload: manager.reload,
            (TaskType.event, tasks.ADD_COMPONENT_TASK_NAME): manager.add_component,
            (TaskType.event, tasks.REMOVE_COMPONENT_TASK_NAME): manager.remove_component,
            (TaskType.event, tasks.REMOVE_ENDPOINT_TASK_NAME): manager.remove_component,
            (TaskType.event, tasks.ROLL_BACK_TASK_NAME): probations.roll_back,
            (TaskType.event, tasks.FAILED_CALL_TASK_NAME): probations.end_failed_call,
            (TaskType.event, tasks.FINISH_TASK_NAME): self.finish,
        }

    def end_node(self, task: Task, task_id: TaskId) -> SomeTasks:
        """End the node; the task's name is the reason."""
        if self._node.exit_reason is None:
            self._node.exit_reason = task.name
        self._node.machine.is_ended = True
        return None

    def finish(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Requeue the task as often as its second value states, then end the node."""
        reason, generations = task.val_list
        if generations > 0:
            return Task(task.type, task.name, [reason, generations - 1])
        return tasks.terminate(reason)
