"""Node: one role of a robot, running. Components around an event machine, a datastore, and one door."""

from __future__ import annotations

import inspect
import logging
import threading
from collections.abc import Callable
from functools import cached_property
from typing import TYPE_CHECKING, Any

from snr_sim.core.ages import age_s
from snr_sim.core.blame import describe_error, place_of, place_of_class, put_place_first, without_addresses
from snr_sim.core.clocks import SimClock, WallClock
from snr_sim.core.config import Config
from snr_sim.core.datastore import PREVIOUS, Datastore
from snr_sim.core.door import Door
from snr_sim.core.endpoint import Endpoint, EndpointFactory
from snr_sim.core.handlers import Lookup, check_returns, describe
from snr_sim.core.loop import Loop, LoopFactory
from snr_sim.core.loose_ends import loose_ends, nobody
from snr_sim.core.machine import EventMachine, HandlerFailed, as_tasks
from snr_sim.core.node_core import NodeCore
from snr_sim.core.page_data import data_of_page
from snr_sim.core.reload.sources import being_read
from snr_sim.core.reload.trial import Trial
from snr_sim.core.thesis_members import NodeMembers
from snr_sim.prelude.clock import Clock
from snr_sim.prelude.component import Component, RoleName
from snr_sim.prelude.errors import ComponentFailed, ConfigError, SnrError, TaskError, TraceError
from snr_sim.prelude.page import DataKey, Page
from snr_sim.prelude.recorder import Recorder
from snr_sim.prelude.rng import chance_of, rng_for
from snr_sim.prelude.task import SomeTasks, Task, TaskType

if TYPE_CHECKING:
    import numpy as np

INTERRUPTED = "interrupted"  # so begins the message of an error record that is none: a handler did not return

# From this many waiting tasks on a run is told that it cannot keep up. A burst of a few hundred is nothing unusual.
OVERLOAD_TASKS = 1000
MAX_NOTES = 100  # while it runs: nobody reads more, and what fails in ever other words must not fill the memory

_PROCESS_DATA = TaskType.process_data  # looked up once: in Python 3.11 a member of an Enum takes 0.1 us to find

_STEPS = ("begin", "setup", "loop", "halt", "terminate")  # what a component's author may write, beside handlers


class Node(NodeMembers):
    """Runs the components of one role until a terminate task.

    Args:
        role: which of the config's roles.
        config: factories by role, and mode.
        clock: a `WallClock` if not given; under a `SimClock` the node runs in lock step.
        recorder: writes the trace, if given.
        seed: of the run; all chance in the node comes from it.
        is_replay: loops are not made; somebody else brings their tasks.

    Raises:
        UnknownName: the config has no such role.
        ConfigError: a factory makes no component, two components have one name, or the file that makes the node is
            only read again for a reload.
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
        if being_read.get():
            raise ConfigError(
                f"{being_read.get()} makes a node while it is read again for a reload.",
                fix="put what starts the robot under: if __name__ == '__main__':",
            )
        if not isinstance(config, Config):
            raise ConfigError(
                f"Node({role!r}, ...) got a {type(config).__name__} where its Config belongs.",
                fix=f"Node({role!r}, Config(factories={{{role!r}: [MyFactory()]}})).",
            )
        self.role = role
        self.config = config
        self.mode = config.mode
        self.name = f"{role}_node"
        self.clock = clock or WallClock()
        self.is_in_lock_step = isinstance(self.clock, SimClock)  # then all nodes have one clock
        self.seed = seed
        self.chance = chance_of(seed)  # what its components draw from
        self.is_replay = is_replay  # then nothing may be done to the outside: no file written, no page sent
        self.door = Door()
        self.datastore = Datastore()
        self.profiler = config.get_profiler()
        self.components: dict[str, Component] = {}  # a new dict after each change at run time: threads read it
        self.exit_reason: str | None = None
        self.notes: list[str] = []
        self.objects_noted: set[tuple[DataKey, type]] = set()  # that pages hold and that are no data: noted once
        self._lines: dict[str, str] = {}  # of notes: the student's lines that they are about
        latch = None if isinstance(self.clock, SimClock) else self.clock.now_s
        lookup = Lookup(self.components, self.profiler)
        self._recorder = recorder.for_node(self.name) if recorder is not None else None
        self.machine = EventMachine(lookup, self.door, latch, self._recorder)
        self._thread_id = threading.get_ident()
        self._begun: list[Component] = []
        self._is_over = False
        self.never_ran = False  # an error ended it at its start: what it waited for could not come
        self._is_halting = False
        self._failures: list[ComponentFailed] = []  # those that stand in the trace
        self._places: dict[str, int] = {}
        self._last_place = 0
        self._core = NodeCore(self)
        self.probations = self._core.probations  # new code that may still fail
        self._add(self._core, 0)
        for self._last_place, factory in enumerate(config.get(role), 1):
            if not (is_replay and isinstance(factory, LoopFactory)):
                self._add(self.make(factory), self._last_place)

    @cached_property
    def log(self) -> logging.Logger:
        """A logger named after the node."""
        return logging.getLogger(f"snr.{self.name}")

    def make(self, factory: Any) -> Endpoint | Loop:
        """Returns what a factory makes, checked; it is not yet a part of the node.

        Raises:
            ConfigError: that is no component.
        """
        name = type(factory).__name__
        if not isinstance(factory, (EndpointFactory, LoopFactory)):
            owner = getattr(factory, "__self__", None)
            if inspect.ismethod(factory) and owner is not None and not isinstance(owner, type):
                raise ConfigError(
                    f"Role '{self.role}' lists {type(owner).__name__}.{factory.__name__} where a factory belongs.",
                    fix=f'call it: .{factory.__name__}(...), as in tether.server("depth").',
                )
            if hasattr(factory, "attach"):  # runners.Link
                raise ConfigError(
                    f"Role '{self.role}' lists a {name}, which links roles of one simulation, where a factory belongs.",
                    fix="SimRunner(config, links=[link]); between processes a SocketsPair or a PipesPair.",
                )
            raise ConfigError(
                f"Role '{self.role}' lists {factory!r} where a factory belongs.",
                fix="list instances: [MyFactory()], not the class and not the endpoint itself.",
            )
        try:
            component = factory.get(self)
        except SnrError as error:
            put_place_first(error)
            raise
        except (Exception, SystemExit) as error:
            what = f"while {name}.get() made a component of role '{self.role}'"
            raise ConfigError(describe_error(error, what, place_of_class(type(factory)))) from error
        wanted: type[Endpoint | Loop] = Endpoint if isinstance(factory, EndpointFactory) else Loop
        a_wanted = f"{'an' if wanted is Endpoint else 'a'} {wanted.__name__}"
        if not isinstance(component, wanted):
            place = place_of(factory.get)
            where = f"{place}\n  " if place is not None else ""
            raise ConfigError(
                f"{where}{name}.get() of role '{self.role}' returned {without_addresses(repr(component))}, "
                f"but should return {a_wanted}.",
                fix=f"end get(self, parent) with: return My{wanted.__name__}(self, parent, 'its_name').",
            )
        if not hasattr(component, "name"):
            raise ConfigError(
                f"{type(component).__name__} of role '{self.role}' has not called its parent's __init__.",
                fix="begin its __init__ with: super().__init__(factory, parent, name).",
            )
        for step in _STEPS:
            check_returns(f"{step}() of component '{component.name}'", getattr(component, step, None))
        if isinstance(component, Endpoint) and hasattr(component, "task_source"):
            self.note(f"'{component.name}' has a task_source(), which nothing calls: a Loop brings in what is outside.")
        if isinstance(component, Loop) and component.task_handlers:
            raise ConfigError(
                f"Loop '{component.name}' of role '{self.role}' registers handlers, but a loop only brings tasks in.",
                fix="put the handlers into an endpoint beside it: loops are not there in a replay, endpoints are.",
            )
        return component

    def _add(self, component: Component, place: int) -> None:
        other = self.components.get(component.name)
        if other is not None:
            raise ConfigError(
                f"Role '{self.role}' has two components named '{component.name}': "
                f"a {type(other).__name__} and a {type(component).__name__}.",
                fix="give each component a name of its own in its factory.",
            )
        self.components[component.name] = component
        self._places[component.name] = place
        self.machine.lookup.forget()

    def exchange(self, old: Component | None, new: Component | None) -> None:
        """Puts a component in the place of another one of its name; None: last, or nothing."""
        lookup = self.machine.lookup
        if old is None and new is not None:
            components = self.components.copy()  # which is quicker than to put 1000 into a new one
            components[new.name] = new
            self.components = components
            self.give_place(new.name)
            lookup.components = self.components
            lookup.added(new)
            return
        items = [(name, new if one is old else one) for name, one in self.components.items()]
        self.components = {name: one for name, one in items if one is not None}
        lookup.components = self.components
        lookup.forget()

    # Life: begin, run until ended, end. `loop` does all three.

    def loop(self) -> None:
        """Runs until a terminate task has been executed.

        Raises:
            ComponentFailed: a handler or a loop raised; everything has been halted.
        """
        from snr_sim.core.lockstep import run_alone  # the one step up: lock step runs nodes

        run_alone(self)

    def begin(self) -> None:
        """Begins each component, in order; from now on this thread is the node's.

        Raises:
            ComponentFailed: a component could not begin.
            ConfigError: the node has run before.
        """
        if self._begun or self._is_over:
            raise ConfigError(f"Node '{self.name}' has already run.", fix="make a new Node for a new run.")
        self._thread_id = threading.get_ident()
        self.machine.now_s = self.clock.now_s()
        if self._recorder is not None:
            self._recorder.begun(self.machine.now_s, self.name, ())  # so that a replay begins at the same time
        for component in self.components.values():
            self._begin(component, self.machine.begin_component)

    def said(self, component: str, level: str, text: str) -> None:
        """Have a text recorded that a component has printed or logged; from any thread.

        Args:
            component: its name.
            level: PRINT, INFO, WARNING, ...
            text: with its line ends; what follows the last one waits for the rest.
        """
        if self._recorder is not None:
            self._recorder.said(self.get_time_s(), component, level, text)

    def _begin(self, component: Component, begin: Callable[[Component], None]) -> None:
        self._begun.append(component)
        try:
            begin(component)
        except (ComponentFailed, TraceError):
            raise
        except (Exception, SystemExit) as error:
            raise self.failure_of(component, error, "begin") from error

    def begin_late(self, component: Component) -> None:
        """Begins a component while a task is handled; what it schedules follows from that task.

        Raises:
            ComponentFailed: it raised; so did the `setup` of a loop, on a thread or in a process, if it did so soon.
        """
        running = self.machine.running
        self.machine.running = component
        trial = Trial()
        if isinstance(component, Loop):
            component.trial, component.is_taken_out = trial, False
        try:
            self._begin(component, lambda one: one.begin())
            if isinstance(component, Loop) and component.caller is not None and component.caller.setup_patience_s:
                failure = trial.wait(component.caller.setup_patience_s)
                if failure is not None:
                    raise failure
        finally:
            if any(self._places[one.name] > self._places[component.name] for one in self._begun[-2:-1]):
                self._begun.sort(key=lambda one: self._places[one.name])
            self.machine.running = running

    def end_early(self, component: Component) -> list[ComponentFailed]:
        """Halts and terminates a component before the node ends; returns what went wrong. Does nothing twice."""
        if not self.has_begun(component):
            return []
        self._begun = [one for one in self._begun if one is not component]
        running, failures = self.machine.running, list[ComponentFailed]()
        if isinstance(component, Loop):
            component.is_taken_out = True
        self._call_last(component, "halt", component.join, failures)
        self._call_last(component, "terminate", component.terminate, failures)
        self.machine.running = running
        return failures

    def has_begun(self, component: Component) -> bool:
        """Returns whether a component has begun and has not been terminated."""
        return any(one is component for one in self._begun)

    def run_ready(self) -> None:
        """Executes tasks until none is left or the node has ended.

        Raises:
            ComponentFailed: a handler or a loop raised.
        """
        try:
            self.machine.run_ready()
        except HandlerFailed as failed:
            cause = failed.__cause__
            assert cause is not None
            if isinstance(cause, KeyboardInterrupt):
                interrupt = self._failure_of(failed, cause)
                self.record_interrupt(interrupt.component, interrupt.message)
                raise cause from None  # an interrupt, not a failure
            raise self._failure_of(failed, cause) from cause

    def end(self, reason: str | None = None, error: Exception | None = None) -> None:
        """Finishes what is queued, then halts and terminates each component, whatever any of them raises.

        Args:
            reason: why, if no terminate task said so.
            error: that ended it, if one has, here or in another node.

        Raises:
            ComponentFailed: a component could not be halted or terminated; all others have been. If several could
                not, the others stand in the notes.
        """
        if self._is_over:
            return
        self._is_over = True
        is_of_start = isinstance(error, ComponentFailed) and error.step in ("begin", "setup")
        self.never_ran = is_of_start or (error is not None and not self.datastore.stored)
        failures: list[ComponentFailed] = []
        if self.exit_reason is not None:
            self._drain(failures)
        self.exit_reason = self.exit_reason or reason
        for component in self._begun:  # all loops are told first: then none waits for another's sleep
            if isinstance(component, Loop):
                component.stop()
        self._is_halting = True
        for component in self._begun:
            self._call_last(component, "halt", component.join, failures)
            self._call_last(component, "terminate", component.terminate, failures)
        self.door.close()
        failure = self.door.failure
        if isinstance(failure, ComponentFailed) and failure is not error:  # of a loop's thread, perhaps in its halt
            failures.append(failure)
        self._note_overload()
        of_the_run, told = len(self.notes), list[str]()
        if not self.never_ran:
            ends = self.components, self.machine.lookup.seen(), self.datastore
            self.notes.extend(loose_ends(*ends, nobody))
            told = loose_ends(*ends)
        for failure in failures:
            self.record_failure(failure)
        self.notes.extend(failure.message for failure in failures[1:])  # the first is raised
        if self._recorder is not None:
            self._recorder.end(self.machine.now_s, self.exit_reason or "", self.summary())
        self.notes[of_the_run : of_the_run + len(told)] = told  # with the student's lines, which a trace has not
        self.notes = [self._lines.get(note, "") + note for note in self.notes]
        if failures:
            raise failures[0]

    def _note_too_late(self, component: Component, tasks: SomeTasks) -> None:
        for task in as_tasks(tasks, component, self.schedule):
            self.note(
                f"'{component.name}' scheduled {describe(task.id())} while it was halted, and no task comes "
                "after that. A handler of TaskType.terminate is called in time."
            )

    def _note_overload(self) -> None:
        if self.machine.longest_queue >= OVERLOAD_TASKS:
            self.notes.append(
                f"Up to {self.machine.longest_queue} tasks waited at a time: they come faster than their handlers "
                "work, so handlers see old data. Lower a loop's max_tick_rate_hz, or do less in a handler."
            )

    def _drain(self, failures: list[ComponentFailed]) -> None:
        try:
            cut_off = self.machine.drain()
        except HandlerFailed as failed:
            cause = failed.__cause__
            if cause is not None and not isinstance(cause, KeyboardInterrupt):
                failures.append(self._failure_of(failed, cause))
            elif cause is not None:
                interrupt = self._failure_of(failed, cause)
                self.record_interrupt(interrupt.component, interrupt.message)
        except ComponentFailed as failure:
            failures.append(failure)
        else:
            if cut_off:
                self.note(
                    f"The node ended with {cut_off} tasks undone: there was no end to them, "
                    "or they would have taken too long."
                )

    def _call_last(
        self, component: Component, step: str, function: Callable[[], None], failures: list[ComponentFailed]
    ) -> None:
        self.machine.running = component
        try:
            function()
        except BaseException as error:  # also an interrupt: the others must still be halted
            self.machine.running = None  # first of all, so that a second one does not come in between
            failures.append(self.failure_of(component, error, step))
        finally:
            self.machine.running = None

    @property
    def is_over(self) -> bool:
        """Whether the end of the run has begun: components are being halted, or have been."""
        return self._is_over

    @property
    def is_terminated(self) -> bool:
        """Whether a terminate task has been executed."""
        return self.machine.is_ended

    def set_terminate_flag(self, reason: str) -> None:
        """Ends the node after the current task, as a terminate task does; from any thread, and before it begins."""
        self.schedule(Task(TaskType.terminate, reason), "set_terminate_flag")

    def note_terminated(self, reason: str) -> None:
        """Keeps the reason of the first terminate task, which has been executed, and ends the machine."""
        if self.exit_reason is None:
            self.exit_reason = reason
        self.machine.is_ended = True

    def summary(self) -> dict[str, Any]:
        """Returns counts of the run, as they stand in the trace's last record."""
        return {"tasks": self.machine.executed, "pages": self.datastore.stored, "notes": self.notes}

    # Tasks

    def schedule(self, tasks: SomeTasks, source: str = "outside") -> None:
        """Queues tasks: as the running handler's doing, or as an input if none of this node's handlers runs.

        Args:
            tasks: a task, several, or None.
            source: who brings them, if they are inputs.
        """
        running = self.machine.running
        if running is None or threading.get_ident() != self._thread_id:
            self.enter(tasks, source)
        elif isinstance(running, Loop):
            self.enter(tasks, running.name)
        elif self._is_halting:
            self._note_too_late(running, tasks)
        else:
            self.machine.schedule([tasks] if type(tasks) is Task else as_tasks(tasks, running, self.schedule))

    def enter(self, tasks: SomeTasks, source: str) -> None:
        """Lets tasks in through the door, from any thread; `source` says whose they are.

        Raises:
            TaskError: something is not a task.
        """
        if type(tasks) is Task:
            self.door.put(tasks, source)
            return
        for task in tasks if isinstance(tasks, (list, tuple)) else [tasks]:
            if type(task) is not Task:
                if task is None:
                    continue
                raise TaskError(
                    f"'{source}' scheduled {task!r}, which is not a task.", fix="tasks.event('name') makes one."
                )
            self.door.put(task, source)

    def handlers_changed(self) -> None:
        """Has handlers looked up anew; components call it when theirs change."""
        self.machine.lookup.forget()

    def order_of(self, component_name: str) -> int:
        """Returns a component's place among the node's components; one that is made anew keeps it."""
        return self._places[component_name]

    def give_place(self, component_name: str, place: int | None = None) -> None:
        """Says where a component stands; behind all others, if no place is given."""
        if place is None:
            place = self._last_place = self._last_place + 1
        self._places[component_name] = place

    # Data

    def page(self, key: DataKey, data: Any, process: bool = True) -> Page:
        """Returns a page made by this node, now, of the data as they are now.

        Dicts, lists, arrays and dataclasses are copied, so what their owner does with them later does not change the
        page. An object of another class is noted at the end of the run, with the line that stored it.

        Raises:
            TaskError: a part of the program, such as an endpoint, stands where data belong.
        """
        return Page(key, data_of_page(self, key, data), self.name, self.get_time_s(), process)

    def store_page(self, page: Page) -> None:
        """Queues the task that stores a page."""
        self.schedule(Task(TaskType.store_page, page.key, [page]))

    def store_data(self, key: DataKey, data: Any, process: bool = True) -> None:
        """Queues the task that stores data under a key."""
        self.schedule(self.store_data_task(key, data, process))

    def store_data_task(self, key: DataKey, data: Any, process: bool = True) -> Task:
        """Returns the task that stores data under a key."""
        return Task(TaskType.store_page, key, [self.page(key, data, process)])

    def get_page(self, key: DataKey) -> Page | None:
        """Returns the newest page of a key, or None; `<key>_prev` is the one before.

        In a handler of `process_data` it is the page that the task carries, and the one before that: each page that
        was stored is processed, also where newer ones have come since.
        """
        newest = self.datastore.get(key)
        task = self.machine.task
        if task is None or task.type is not _PROCESS_DATA or not task.val_list:
            return newest
        page: Page = task.val_list[0]
        if page is newest and key == task.name:  # nearly always
            return newest
        pages = self.datastore.pages
        if type(page) is not Page or page is pages.get(page.key) or threading.get_ident() != self._thread_id:
            return newest
        if key == page.key:
            return page
        return self._core.page_before(page) if key == page.key + PREVIOUS and key not in pages else newest

    def get_data(self, key: DataKey) -> Any:
        """Returns the data of `get_page`, or None."""
        page = self.get_page(key)
        return None if page is None else page.data

    def get_age_s(self, key: DataKey) -> float:
        """Returns how old the page of `get_page` is [s], whoever made it; infinite if there is none.

        Of another node's page on the wall clock that is known as far as a link to that very node knows its clock:
        see core/ages.py. Else it is infinite: a command must not count as fresh because nobody knows better.
        """
        page = self.get_page(key)
        return float("inf") if page is None else age_s(self, page)

    def came_at_s(self, key: DataKey) -> float:
        """Returns when the newest page of a key that another node has made came here; -inf if none did."""
        return self._core.came_s.get(key, float("-inf"))

    def tap(self, key: DataKey, way_out: Callable[[Page], None]) -> None:
        """Has every page of a key handed to `way_out` right after it was stored, on the node's thread.

        This is how links get pages out. It is no part of the machine: a replay has no taps and does not miss them.
        """
        self._core.taps.setdefault(key, []).append(way_out)

    def untap(self, key: DataKey, way_out: Callable[[Page], None]) -> None:
        """Ends what `tap` began."""
        self._core.taps[key].remove(way_out)

    # Time and chance

    def get_time_s(self) -> float:
        """Returns the time latched for the running task, or else the clock's."""
        machine = self.machine
        if machine.running is not None and threading.get_ident() == self._thread_id:
            return machine.now_s
        return self.clock.now_s()

    @property
    def rng(self) -> np.random.Generator:
        """The random generator of the component that runs now: so none shifts another's chance.

        From a thread, or outside of any component, it is the node's own.
        """
        running = self.machine.running
        if isinstance(running, (Endpoint, Loop)) and threading.get_ident() == self._thread_id:
            return running.rng
        if "_rng" not in self.__dict__:
            self._rng = rng_for(self.chance, self.name)
        return self._rng

    # Failures

    def call_loop(self, loop: Loop, step: str) -> None:
        """Calls a loop's `setup` or `loop`: on the node's thread in lock step, on the loop's own otherwise.

        Raises:
            ComponentFailed: it raised.
        """
        is_ours = threading.get_ident() == self._thread_id
        if is_ours:
            self.machine.running = loop
            self.machine.now_s = self.clock.now_s()
        function = loop.setup if step == "setup" else loop.loop
        try:
            if self.profiler is not None:
                self.profiler.time(f"{loop.name}.{step}", function)
            else:
                function()
        except (Exception, SystemExit) as error:
            raise self.failure_of(loop, error, step) from error
        finally:
            if is_ours:
                self.machine.running = None

    def failure_of(self, component: Component, error: BaseException, step: str) -> ComponentFailed:
        """Returns what went wrong in `begin`, `setup`, `loop`, `halt` or `terminate`, in words."""
        if isinstance(error, ComponentFailed):
            return error
        where = f"in {step}() of component '{component.name}' at t = {self.clock.now_s():.3f} s"
        return ComponentFailed(describe_error(error, where), self.name, component.name, step)

    def _failure_of(self, failed: HandlerFailed, error: BaseException) -> ComponentFailed:
        if failed.component is not None:
            return self.failure_in_handler(failed.component, failed.task, error)
        where = f"in node '{self.name}', while it looked for handlers of {self._shown(failed.task)}"
        return ComponentFailed(describe_error(error, where), self.name)

    def failure_in_handler(self, component: Component, task: Task, error: BaseException) -> ComponentFailed:
        """Returns what went wrong in a component's handler of a task, in words."""
        name = component.name
        entries = self.machine.lookup.find(task)
        called = [entry for entry in entries if entry[0] is component]
        labels = [f"{label[1]}(), " for _, _, _, label in called]
        begins = place_of(called[0][1]) if called else None  # what it returned was wrong: then no line of its raised
        where = f"in {''.join(labels)}component '{name}', while it handled {self._shown(task)}"
        return ComponentFailed(describe_error(error, where, begins), self.name, name)

    def _shown(self, task: Task) -> str:
        return f"{task.type} '{task.name}' at t = {self.machine.now_s:.3f} s"

    def record_failure(self, failure: ComponentFailed) -> None:
        """Writes a failure of this node into the trace, once."""
        if failure.node != self.name or any(failure is other for other in self._failures):
            return
        self._failures.append(failure)
        if self._recorder is not None:
            self._recorder.error(self.machine.now_s, failure.component, failure.message)

    def record_interrupt(self, component_name: str, message: str) -> None:
        """Writes into the trace which handler was interrupted: a replay must not wait for it again."""
        if self._recorder is not None:
            self._recorder.error(self.machine.now_s, component_name, f"{INTERRUPTED}: {message}")

    def note(self, text: str, lines: str = "") -> None:
        """Keeps a remark for the end of the run, once: what fails again and again must not fill the memory.

        Args:
            text: of the remark.
            lines: the student's lines that it is about, to stand before it when it is told; a trace has them not.
        """
        remark = without_addresses(text)
        if lines:
            self._lines.setdefault(remark, lines)
        if remark in self.notes or len(self.notes) >= MAX_NOTES:
            return
        self.notes.append(remark if len(self.notes) < MAX_NOTES - 1 else "There was more to note, which is left out.")
