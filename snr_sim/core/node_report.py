"""Notes and failures of a node: formatted, kept for the end of the run, and written to the trace."""

from __future__ import annotations

from snr_sim.core.machine import EventMachine, HandlerError
from snr_sim.core.source_location import class_location, describe_error, location_of, without_addresses
from snr_sim.prelude.clock import Clock
from snr_sim.prelude.component import Component
from snr_sim.prelude.errors import CommandError, ComponentFailedError
from snr_sim.prelude.recorder import NodeRecorder
from snr_sim.prelude.task import DataKey, Task

INTERRUPTED = "interrupted"  # prefix of an error record for a handler that did not return
MAX_NOTES = 100  # a limit on memory: failures with ever-changing messages must not fill it


class NodeReport:
    """Collector of the notes and failures of a node's run; `notes` are for its end."""

    def __init__(self, name: str, clock: Clock, machine: EventMachine, recorder: NodeRecorder | None) -> None:
        self.notes: list[str] = []
        self._name, self._clock, self._machine = name, clock, machine
        self._recorder = recorder
        self._lines: dict[str, str] = {}  # by note: the student's lines that it is about
        self._unrecorded: set[str] = set()
        self._objects: set[tuple[DataKey, type]] = set()  # non-data objects in pages, each noted once
        self._failures: list[ComponentFailedError] = []  # those that are in the trace

    def failure_of(self, component: Component, error: BaseException, step: str) -> ComponentFailedError:
        """Return an error in `begin`, `setup`, `loop`, `halt` or `terminate` as a failure with a message."""
        if isinstance(error, ComponentFailedError):
            return error
        where = f"in {step}() of component '{component.name}' at t = {self._clock.now_s():.3f} s"
        # For an error in the call itself, or in what was returned: no line of the student's code raised it.
        begins = location_of(getattr(component, step, None)) or class_location(type(component))
        message = describe_error(error, where, begins)
        if isinstance(error, CommandError):
            return ComponentFailedError(message, self._name, component.name, step, error.suspects, error.stored_at_s)
        return ComponentFailedError(message, self._name, component.name, step)

    def failure_of_handling(self, failed: HandlerError, error: BaseException) -> ComponentFailedError:
        """Return an error that the machine has raised as a failure with a message."""
        if failed.component is not None:
            return self.failure_in_handler(failed.component, failed.task, error)
        where = f"in node '{self._name}', while it looked for handlers of {self._describe_task(failed.task)}"
        return ComponentFailedError(describe_error(error, where), self._name)

    def failure_in_handler(self, component: Component, task: Task, error: BaseException) -> ComponentFailedError:
        """Return an error in a component's handler of a task as a failure with a message."""
        name = component.name
        if isinstance(error, ComponentFailedError) and (error.node, error.component) == (self._name, name):
            return error
        called = [entry for entry in self._machine.lookup.find(task) if entry[0] is component]
        labels = [f"{label[1]}(), " for _, _, _, label in called]
        begins = location_of(called[0][1]) if called else None  # a wrong return value: no line of the handler raised
        where = f"in {''.join(labels)}component '{name}', while it handled {self._describe_task(task)}"
        return ComponentFailedError(describe_error(error, where, begins), self._name, name)

    def _describe_task(self, task: Task) -> str:
        return f"{task.type} '{task.name}' at t = {self._machine.now_s:.3f} s"

    def record_failure(self, failure: ComponentFailedError) -> None:
        """Write a failure of this node into the trace, once."""
        if failure.node != self._name or any(failure is other for other in self._failures):
            return
        self._failures.append(failure)
        if self._recorder is not None:
            self._recorder.error(self._machine.now_s, failure.component, failure.message)

    def record_interrupt(self, component_name: str, message: str) -> None:
        """Record in the trace which handler was interrupted: a replay must not run it again and hang."""
        if self._recorder is not None:
            self._recorder.error(self._machine.now_s, component_name, f"{INTERRUPTED}: {message}")

    def add_note(self, text: str, lines: str = "", *, is_recorded: bool = True) -> None:
        """Keep a note for the end of the run, once: repeated failures must not fill the memory.

        Args:
            text: of the note.
            lines: the student's lines that it is about, printed before it; they are not written to the trace.
            is_recorded: whether the note is written to the trace.
        """
        remark = without_addresses(text)
        if not is_recorded:
            self._unrecorded.add(remark)
        if lines:
            self._lines.setdefault(remark, lines)
        if remark in self.notes or len(self.notes) >= MAX_NOTES:
            return
        self.notes.append(remark if len(self.notes) < MAX_NOTES - 1 else "There was more to note, which is left out.")

    def note_object(self, key: DataKey, kind: type) -> bool:
        """Return whether a page of this key held an object of this class for the first time."""
        is_first = (key, kind) not in self._objects
        self._objects.add((key, kind))
        return is_first

    def recorded_notes(self) -> list[str]:
        """Return the notes that the trace has."""
        return [note for note in self.notes if note not in self._unrecorded]

    def finished_notes(self) -> list[str]:
        """Return the notes, each with the student's lines that it is about before it."""
        return [self._lines.get(note, "") + note for note in self.notes]
