"""Life cycle of a node: its components begin, its machine runs, its components are halted even after an error."""

from __future__ import annotations

import threading
from collections.abc import Callable

from snr_sim.core.component_registry import ComponentRegistry
from snr_sim.core.handlers import as_tasks, describe, schedule_returned
from snr_sim.core.loop import Loop, SetupResult
from snr_sim.core.machine import HandlerError
from snr_sim.core.node_parts import NodeParts
from snr_sim.core.node_report import NodeReport
from snr_sim.core.run_diagnostics import no_writers, run_diagnostics
from snr_sim.prelude.component import Component
from snr_sim.prelude.errors import ComponentFailedError, ConfigError, TraceError
from snr_sim.prelude.recorder import NodeRecorder
from snr_sim.prelude.task import Page, SomeTasks

# From this many waiting tasks on an overload is reported. A burst of a few hundred tasks is normal.
OVERLOAD_TASKS = 1000


class NodeLife:
    """Life cycle of a node's components: begins, runs and ends them.

    Attributes:
        is_finished: whether the end of the run has begun: components are being halted, or have been.
        is_halting: whether it is too late for components to schedule tasks.
        handle_failure: handles the failure of a loop without ending the run if it can, and returns whether it did.
        wrap_loop: returns what is called as a loop's `loop` on the node's thread; None: itself.
        blame_suspects: the same if others have caused a failure, so that what failed continues.
        maker_of: returns the component whose new code has made a page; "": not known.
    """

    def __init__(
        self, node: NodeParts, registry: ComponentRegistry, report: NodeReport, recorder: NodeRecorder | None
    ) -> None:
        self.is_finished: bool = False
        self.is_halting: bool = False
        self.node: NodeParts = node
        self.registry: ComponentRegistry = registry
        self.report: NodeReport = report
        self.handle_failure: Callable[[Loop, ComponentFailedError], bool] = lambda loop, failure: False
        self.wrap_loop: Callable[[Loop], Callable[[], SomeTasks]] | None = None
        self.blame_suspects: Callable[[ComponentFailedError], bool] = lambda failure: False
        self.maker_of: Callable[[Page | None], str] = lambda page: ""
        self._recorder = recorder
        self._begun: list[Component] = []

    def begin(self) -> None:
        """Begin each component, in order; from now on this thread is the node's.

        Raises:
            ComponentFailedError: a component could not begin.
            ConfigError: the node has run before.
        """
        if self._begun or self.is_finished:
            raise ConfigError(f"Node '{self.node.name}' has already run.", fix="make a new Node for a new run.")
        self.node.thread_id = threading.get_ident()
        now_s = self.node.machine.now_s = self.node.clock.now_s()
        if self._recorder is not None:
            self._recorder.begun(now_s, self.node.name, ())  # so that a replay begins at the same time
        for component in self.node.components.values():
            self._begin(component, self.node.machine.begin_component)

    def _begin(self, component: Component, begin: Callable[[Component], None]) -> None:
        self._begun.append(component)
        try:
            begin(component)
        except (ComponentFailedError, TraceError):
            raise
        except (Exception, SystemExit) as error:
            raise self.report.failure_of(component, error, "begin") from error

    def begin_added(self, component: Component) -> None:
        """Begin a component while a task is handled; what it schedules follows from that task.

        Raises:
            ComponentFailedError: it raised, or a loop's `setup` on a thread or in a process raised within its timeout.
        """
        running = self.node.machine.running
        self.node.machine.running = component
        setup_result = SetupResult()
        if isinstance(component, Loop):
            component.setup_result, component.is_removed = setup_result, False
        try:
            self._begin(component, lambda one: schedule_returned(one.begin(), one, one.begin))
            if isinstance(component, Loop) and component.caller is not None and component.caller.setup_timeout_s:
                failure = setup_result.wait(component.caller.setup_timeout_s)
                if failure is not None:
                    raise failure
        finally:
            order_of = self.registry.order_of
            if any(order_of(one.name) > order_of(component.name) for one in self._begun[-2:-1]):
                self._begun.sort(key=lambda one: order_of(one.name))
            self.node.machine.running = running

    def end_removed(self, component: Component) -> list[ComponentFailedError]:
        """Halt and terminate a component before the node ends; return its failures. A second call does nothing."""
        if not self.has_begun(component):
            return []
        self._begun = [one for one in self._begun if one is not component]
        running, failures = self.node.machine.running, list[ComponentFailedError]()
        if isinstance(component, Loop):
            component.is_removed = True
        self._call_last(component, "halt", component.join, failures)
        self._call_last(component, "terminate", component.terminate, failures)
        self.node.machine.running = running
        return failures

    def has_begun(self, component: Component) -> bool:
        """Return whether a component has begun and has not been terminated."""
        return any(one is component for one in self._begun)

    def failure_of(self, failed: HandlerError) -> BaseException:
        """Return what a handler raised as a failure; an interrupt is not one: it is recorded, and returned itself."""
        cause = failed.__cause__
        assert cause is not None
        failure = self.report.failure_of_handling(failed, cause)
        if not isinstance(cause, KeyboardInterrupt):
            return failure
        self.report.record_interrupt(failure.component, failure.message)
        return cause

    def end(self, reason: str | None = None, error: Exception | None = None) -> None:
        """Execute the queued tasks, then halt and terminate each component, even if some of them raise.

        Args:
            reason: why the node ends, if no terminate task gave a reason.
            error: the error that ended it, if any, here or in another node.

        Raises:
            ComponentFailedError: a component could not be halted or terminated; all others have been. Further failures
                are in the notes.
        """
        if self.is_finished:
            return
        self.is_finished = True
        is_of_start = isinstance(error, ComponentFailedError) and error.step in ("begin", "setup")
        self.node.never_ran = is_of_start or (error is not None and not self.node.datastore.stored)
        failures: list[ComponentFailedError] = []
        if self.node.exit_reason is not None:
            self._drain(failures)
        self.node.exit_reason = self.node.exit_reason or reason
        for component in self._begun:  # stop all loops first, so that their sleeps end in parallel
            if isinstance(component, Loop):
                component.stop()
        self.is_halting = True
        for component in self._begun:
            self._call_last(component, "halt", component.join, failures)
            self._call_last(component, "terminate", component.terminate, failures)
        self.node.inbox.close()
        failure = self.node.inbox.failure
        if isinstance(failure, ComponentFailedError) and failure is not error:
            failures.append(failure)  # from a loop's thread, perhaps in its halt
        if error is None:  # else, as after tasks without end, the queue is a result of the error
            self._note_overload()
        first_added, lines = len(self.report.notes), list[str]()
        if not self.node.never_ran:
            ends = self.node.components, self.node.machine.lookup.seen_tasks(), self.node.datastore
            self.report.notes.extend(run_diagnostics(*ends, no_writers))
            lines = run_diagnostics(*ends)
        for failure in failures:
            self.report.record_failure(failure)
        self.report.notes.extend(failure.message for failure in failures[1:])  # the first is raised
        if self._recorder is not None:
            counts = {"tasks": self.node.machine.executed, "pages": self.node.datastore.stored}
            summary = {**counts, "notes": self.report.recorded_notes()}
            self._recorder.end(self.node.machine.now_s, self.node.exit_reason or "", summary)
        # With the student's lines, which a trace does not contain.
        self.report.notes[first_added : first_added + len(lines)] = lines
        self.report.notes = self.report.finished_notes()
        if failures:
            raise failures[0]

    def note_too_late(self, component: Component, tasks: SomeTasks) -> None:
        """Note the tasks that a component has scheduled while it was halted."""
        for task in as_tasks(tasks, component, self.node.schedule):
            self.node.add_note(
                f"'{component.name}' scheduled {describe(task.id())} while it was halted, and no task comes "
                "after that. A handler of TaskType.terminate is called in time."
            )

    def _note_overload(self) -> None:
        longest = self.node.machine.longest_queue
        if longest >= OVERLOAD_TASKS:
            self.report.notes.append(
                f"Up to {longest} tasks waited at a time: they come faster than their handlers "
                "work, so handlers see old data. Lower a loop's max_tick_rate_hz, or do less in a handler."
            )

    def _drain(self, failures: list[ComponentFailedError]) -> None:
        try:
            cut_off = self.node.machine.drain()
            if cut_off:
                self.node.add_note(
                    f"The node ended with {cut_off} tasks undone: there was no end to them, "
                    "or they would have taken too long."
                )
        except HandlerError as failed:
            cause = self.failure_of(failed)
            if isinstance(cause, ComponentFailedError):
                failures.append(cause)
        except ComponentFailedError as failure:
            failures.append(failure)

    def _call_last(
        self, component: Component, step: str, function: Callable[[], None], failures: list[ComponentFailedError]
    ) -> None:
        self.node.machine.running = component
        try:
            function()
        except BaseException as error:  # also an interrupt: the others must still be halted
            self.node.machine.running = None  # first, so that a second interrupt is not raised in between
            failures.append(self.report.failure_of(component, error, step))
        finally:
            self.node.machine.running = None

    def call_loop(self, loop: Loop, step: str) -> None:
        """Call a loop's `setup` or `loop`, on the node's thread in lock step, else on its own; report its error."""
        is_ours = threading.get_ident() == self.node.thread_id
        if is_ours:
            self.node.machine.running = loop
            self.node.machine.now_s = self.node.clock.now_s()
        function = loop.setup if step == "setup" else loop.loop
        if self.wrap_loop is not None and is_ours and step == "loop":
            function = self.wrap_loop(loop)
        try:
            if self.node.profiler is not None:
                returned = self.node.profiler.time(f"{loop.name}.{step}", function)
            else:
                returned = function()
            if returned is not None:  # tested here too, since this is called at each tick
                schedule_returned(returned, loop, function)
        except (Exception, SystemExit) as error:
            failure = self.report.failure_of(loop, error, step)
            if not (failure.suspects and self.blame_suspects(failure)):
                raise failure from error
        finally:
            if is_ours:
                self.node.machine.running = None
