"""The interpreter as a component of a node: its steps are tasks, so a run with machines is recorded and replayed.

StepLoop, or AlarmLoop (see alarm.py) --> event "<name>.step" --.
sensors --> pages in `reacts_to` --+--> MachineEndpoint --> tasks of the blocks
others --> events that are signals'                   `--> event "<name>.transition", page "<name>"
"""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from snr_sim.behaviors.alarm import NEXT_S, AlarmLoopFactory, AlarmTime, alarm_key, check_needs_no_clock, pages_read
from snr_sim.behaviors.bridge import Bridge
from snr_sim.behaviors.context import NS_PER_S, Owner
from snr_sim.behaviors.editing import Edited
from snr_sim.behaviors.guard import EditGuard
from snr_sim.behaviors.interpreter import Change, Interpreter
from snr_sim.behaviors.live_edit import LiveEdits, StaleEditError
from snr_sim.behaviors.program import Place, Problem, Program, ProgramError, show_problem
from snr_sim.core.endpoint import Endpoint, EndpointFactory
from snr_sim.core.factory import ComponentFactory
from snr_sim.core.handlers import as_tasks
from snr_sim.core.loop import Loop, LoopFactory
from snr_sim.prelude import tasks
from snr_sim.prelude.errors import ConfigError, ParameterError, UnknownNameError
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.task import DataKey, Page, SomeTasks, Task, TaskHandlerMap, TaskId, TaskType


def machine_parts(
    program: Program,
    name: str = "machine",
    *,
    step_hz: float = 100.0,
    reacts_to: Sequence[DataKey] = (),
    bridge: Bridge | None = None,
    path: Path | None = None,
) -> list[ComponentFactory]:
    """Return the factories of a machine and of its clock, for a controller's `factories`: see `MachineFactory`.

    Args:
        program, name, reacts_to, bridge, path: of the machine.
        step_hz: how often it takes a step. 0: only at signals, at pages that its conditions read or `reacts_to`, and
            exactly at its time-outs; see `alarm.py`.

    Raises:
        ProgramError: without a clock, the program does something in each step.
    """
    made = MachineFactory(program, name, reacts_to=reacts_to, bridge=bridge, path=path, has_alarm=step_hz == 0)
    return [StepLoopFactory(name, step_hz) if step_hz else AlarmLoopFactory(name), made]


class StepLoopFactory(LoopFactory):
    """Factory of the clock of a machine: event "<name>.step", `step_hz` times a second."""

    def __init__(self, name: str = "machine", step_hz: float = 100.0) -> None:
        super().__init__()
        self.name: str = name
        self.step_hz: float = step_hz

    def get(self, parent: NodeApi) -> StepLoop:
        """Return the loop."""
        return StepLoop(self, parent, f"{self.name}_clock", self.step_hz)


class StepLoop(Loop):
    """Schedules the steps of one machine."""

    factory: StepLoopFactory

    @property
    def event(self) -> str:
        """The event of each tick."""
        return f"{self.factory.name}.step"

    def setup(self) -> None:
        """Make the task once."""
        self._task = tasks.event(self.event)

    def loop(self) -> None:
        """Schedule a step."""
        self.schedule(self._task)


class MachineFactory(EndpointFactory):
    """Factory of a component that runs a program's machines.

    Args:
        program: what `machine(...)` or `parse(...)` returns.
        name: of the component, of its page, and the beginning of its events' names.
        reacts_to: pages that cause a step as soon as they are stored.
        bridge: the parts of the robot that a program in LRP names.
        path: its file, which `--watch` reads again when it is saved.
        has_alarm: whether an `AlarmLoop` is its clock.

    Raises:
        ConfigError: the program is something else, or the name is that of a page of the bridge.
        ProgramError: with an alarm, the program does something in each step.
    """

    def __init__(
        self,
        program: Program,
        name: str = "machine",
        *,
        reacts_to: Sequence[DataKey] = (),
        bridge: Bridge | None = None,
        path: Path | None = None,
        has_alarm: bool = False,
    ) -> None:
        super().__init__()
        if not isinstance(program, Program):
            raise ConfigError(f"MachineFactory is given {program!r}.", fix="what machine(...) returns.")
        if bridge is not None and name in bridge.keys:
            raise ConfigError(f"A machine is named '{name}', and so is a page of the robot.", fix="rename the machine.")
        if has_alarm:
            check_needs_no_clock(program)
        self.has_alarm: bool = has_alarm
        self.guard_s: float | None = None  # see `guard_edits`
        self.program: Program = program
        self.bridge: Bridge | None = bridge
        self.path: Path | None = path
        self.name: str = name
        self.reacts_to: tuple[DataKey, ...] = (reacts_to,) if isinstance(reacts_to, str) else tuple(reacts_to)

    def get(self, parent: NodeApi) -> MachineEndpoint:
        """Return the component."""
        return MachineEndpoint(self, parent, self.name)


FAILSAFE = "failsafe"  # key of the page by which a robot reports that it has stopped
HANDLED = ("step", "set", "pause", "step_once", "go", "edit", "edit_file")  # events, besides its signals
STEP_ONCE_NS = 10_000_000  # by which the time of a machine that is paused advances in a single step


class EditAnswer(NamedTuple):
    """An edit that a machine has answered.

    Args:
        text: that it brought.
        answer: data of the page "<name>.edited".
        program: which runs now.
        t_s: when.
    """

    text: object
    answer: Mapping[str, Any]
    program: Program
    t_s: float


class MachineEndpoint(Endpoint):
    """Takes a step for each event "<name>.step", page in `reacts_to` and signal, and reports changes of state.

    It returns, in this order: what the robot is commanded; the tasks of the blocks; an event "<name>.log" for each
    text that a block logs; for each change an event "<name>.transition" with its fields as
    a dict; and, if a state has changed, one page "<name>". Other events that it handles:

        <name>.set [path, value]    sets a variable, such as "mission.gate"
        <name>.pause, <name>.go     between them it takes no step, and its time stands still; signals are ignored
        <name>.step_once            while it is paused: takes one step, 10 ms later for it; the robot stays in neutral,
                                    and what the step commanded is given by <name>.go
        <name>.edit [text, sha256, files, cause]
                                    continues with another program in LRP; the digest, if given, is that of the program
                                    which was edited, and the edit is refused if it is another one by now; `files` are
                                    the texts of the programs that it imports, if they are not those of before;
                                    `cause`: why the program before an edit is put back. The sender should parse it
                                    before: then `parse` answers from its memory here
        <name>.edit_file [text, file]
                                    continues with another text of a file that is imported

    An edit is answered by the page "<name>.edited": `ok`, `program` (how many there have been), `sha256`, `problems`,
    `notes`, and the machines that were `kept`, `restarted` and `stopped`. A text with mistakes changes nothing.
    """

    factory: MachineFactory

    def __init__(self, factory: MachineFactory, parent: NodeApi, name: str) -> None:
        super().__init__(factory, parent, name)
        owner: Owner = self
        self.interpreter: Interpreter = Interpreter(factory.program, owner, bridge=factory.bridge, rng=self.rng)
        self.is_paused: bool = False
        self.program_number: int = 1
        # Changes and answered edits, each with the number of the program then, for a reader on another thread.
        self.recent: deque[tuple[int, Change | EditAnswer]] | None = None
        self._paused_ns = 0
        self._alarm = AlarmTime() if factory.has_alarm else None
        self._transition = f"{name}.transition"
        # That no other component needs.
        self.optional_events: Collection[str] = [f"{name}.{what}" for what in ("transition", "log", *HANDLED)]
        self._last: Change | None = None
        self._guard = None if factory.guard_s is None else EditGuard(factory.guard_s)
        self._edits = LiveEdits(name, factory.program, factory.bridge, factory.path)
        self._set_handlers()

    @property
    def watched_files(self) -> Mapping[Path, Callable[[], SomeTasks]]:
        """The program's file, and those that it imports or takes actions of."""
        path, now = self.factory.path, self.interpreter.program
        found: dict[Path, Callable[[], SomeTasks]] = dict.fromkeys(self._edits.watched_files(now), self._edits.saved)
        return found if path is None else {path.parent / one: self._saved_actions for one in now.actions} | found

    def _saved_actions(self) -> Task:
        text = "Functions of (actions ...) were saved: they count from the next start."
        return self._answer([Problem(Place(), text, "start the run again.")], None, "")

    def _set_handlers(self) -> None:
        """Handle the signals of the present program, and what is always handled."""
        name = self.name
        program, pages = self.interpreter.program, self.factory.reacts_to
        if self._alarm is not None:
            pages = (*pages, *pages_read(program, self.factory.bridge))
        handlers: TaskHandlerMap = {(TaskType.process_data, key): self.on_step for key in pages}
        handlers |= {(TaskType.event, signal): self.on_signal for signal in program.signals()}
        handlers |= {(TaskType.event, f"{name}.{what}"): getattr(self, f"on_{what}") for what in HANDLED}
        self.task_handlers = handlers

    def begin(self) -> None:
        """Record the program's text, then enter the initial states.

        The text is not a task: a replay with another program differs where the machine does, not where its text does.
        """
        program = self.factory.program
        if self._guard is not None:
            self.parent.add_store_listener(FAILSAFE, self._on_failsafe)
        for one in program.warnings:
            self.parent.add_note(f"Machine '{self.name}': {one.message}")
        self.parent.record_text(self.name, "PROGRAM", program.text)
        for file, text in program.files.items():
            self.parent.record_text(f"{self.name} {file}", "PROGRAM", text)
        self.schedule(self._results(self.interpreter.spawn(self._now_ns())))

    def halt(self) -> None:
        """Note the blocks that failed, and the signals that no state waited for when they came."""
        for problem in (*self.interpreter.past_problems.values(), *self.interpreter.problems.values()):
            self.parent.add_note(
                f"Machine '{problem.machine}', line {problem.line}: [{problem.block}] failed {problem.count} times, "
                f"first at {problem.t_ns / NS_PER_S:g} s. {problem.message}"
            )
        for signal, count in self.interpreter.ignored.items():
            self.parent.add_note(
                f"Machine '{self.name}' was in no state that waits for '{signal}' when it came, {count} times."
            )
        if self._guard is not None:
            self.parent.remove_store_listener(FAILSAFE, self._on_failsafe)

    def on_step(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Take a step."""
        if self.is_paused:
            return None
        changes = self.interpreter.step(self._now_ns())
        return self._results(changes) or None

    def on_signal(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Take a step in which a signal is given."""
        if self.is_paused:
            return None
        return self._results(self.interpreter.step(self._now_ns(), task.name, tuple(task.val_list)))

    def on_set(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Set a variable; a request that cannot be met is noted."""
        try:
            path, value = task.val_list
            self.interpreter.set(path, value)
        except (ValueError, TypeError, ParameterError, UnknownNameError) as error:
            self.parent.add_note(f"'{task.name}' {task.val_list!r:.200} was rejected: {error}")
            return None
        return [self.store_data_task(self.name, self._page()), *self._step_now()]

    def on_pause(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Take no more steps; the robot is at neutral, whatever an edit commands."""
        if self.is_paused:
            return None
        self._paused_ns = self._now_ns()
        return self._hold(is_held=True)

    def on_step_once(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Take a step while paused."""
        if not self.is_paused:
            return None
        self._paused_ns += STEP_ONCE_NS
        changes = self.interpreter.step(self._paused_ns)
        return self._results(changes, has_changed=True)

    def on_go(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Continue as if no time had passed."""
        return self._hold(is_held=False) if self.is_paused else None

    def _hold(self, *, is_held: bool) -> list[Task]:
        self.is_paused = is_held
        if not is_held:
            self.interpreter.delay(self._now_ns() - self._paused_ns)
        robot = self.interpreter.robot
        commands = [] if robot is None else robot.hold(is_held=is_held)
        return [*commands, self.store_data_task(self.name, self._page()), *self._step_now()]

    def on_edit(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Continue with another text, if it is a program."""
        return self._continue_with(task, self._edits.program_of, str(task.val_list[0]) if task.val_list else "")

    def on_edit_file(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Continue with another text of a file that the program imports."""
        return self._continue_with(task, self._edits.program_with_file, self.interpreter.program.text)

    def _continue_with(self, task: Task, read: Callable[[Task, Program], Program], text: str) -> list[Task]:
        """Return what an edit causes, with the answer to it. Problems are in `text`."""
        now, cause = self.interpreter.program, (*task.val_list, "", "", "", "")[3]
        if self._guard is not None and cause:
            self._guard.is_waiting = False
        try:
            program = read(task, now)
            if self._alarm is not None:
                check_needs_no_clock(program)
            problems = list(self.interpreter.problems.values())
            edited, changes = self.interpreter.edit(program, self._now_ns())
        except ProgramError as error:
            present = {"text": now.text} if isinstance(error, StaleEditError) else {}
            done = [self._answer(error.problems, None, text, **present)]
        else:
            self.program_number += 1
            self._set_handlers()
            if cause:
                edited.notes.append(f"The program before an edit is back: {cause}")
                self.parent.add_note(f"Machine '{self.name}' has the program before an edit again: {cause}")
            if self._guard is not None and cause:
                self._guard.remove()
            elif self._guard is not None:
                self._guard.add(now, problems, self._real_ns())
            done = [*self._results(changes, has_changed=True), self._answer(program.warnings, edited, text)]
        if self.recent is not None:
            given, answer = (*task.val_list, None)[0], done[-1].val_list[0].data
            row = EditAnswer(given, answer, self.interpreter.program, self.get_time_s())
            self.recent.append((self.program_number, row))
        return [*done, *self._step_now()]

    def _answer(self, problems: Sequence[Problem], edited: Edited | None, source: str, **more: str) -> Task:
        """Return the task that stores the answer to an edit; log it.

        Args:
            problems: of the edit.
            edited: what it did; None if it was refused.
            source: the text in which the problems are.
            more: fields of the answer.
        """
        for one in problems:
            shown = show_problem(one, self.name, source.splitlines())
            self.log.log(logging.WARNING if one.is_error else logging.INFO, "%s", shown)
        if edited is None:
            self.log.warning("%s: program %s continues.", self.name, self.program_number)
        else:
            for note in edited.notes:
                self.log.info("%s: %s", self.name, note)
            self.log.info("%s: program %s runs.", self.name, self.program_number)
        answer = {
            "ok": edited is not None,
            "program": self.program_number,
            "sha256": self.interpreter.program.sha256,
            "problems": [{**asdict(one.place), "message": one.message, "fix": one.fix} for one in problems],
            **msgspec.structs.asdict(edited or Edited()),
            **more,
        }
        return self.store_data_task(f"{self.name}.edited", answer)

    def _now_ns(self) -> int:
        """Return the time of the machines, which stands still while they are paused."""
        return self._paused_ns if self.is_paused else self._real_ns()

    def _real_ns(self) -> int:
        return round(self.get_time_s() * NS_PER_S)

    def _on_failsafe(self, page: Page) -> None:
        if page.data:
            self._put_back(f"page '{FAILSAFE}' came")

    def _put_back(self, cause: str) -> None:
        """Send the program before the newest guarded edit as an edit; an input, since a replay has no guard."""
        edit = None if self._guard is None else self._guard.newest(self._real_ns())
        if self._guard is None or edit is None:
            return
        self._guard.is_waiting = True
        self.log.warning("%s: %s. The program before the edit is put back.", self.name, cause)
        values = [edit.before.text, self.interpreter.program.sha256, dict(edit.before.files), cause]
        self.parent.enqueue_input(tasks.event(f"{self.name}.edit", values), f"{self.name}.guard")

    def _results(self, changes: list[Change], *, has_changed: bool = False) -> list[Task]:
        """Return the tasks of what the interpreter has done; `has_changed`: something else on the page has."""
        interpreter = self.interpreter
        found = [] if interpreter.robot is None else interpreter.robot.take_tasks()
        for function, output in interpreter.outputs:
            found += as_tasks(output, self, function)
        found += [tasks.event(f"{self.name}.log", [text]) for text in interpreter.context.logged]
        if interpreter.breaks:
            self.log.info("%s: paused by (break ...) in line %s.", self.name, interpreter.breaks[0])
            found.append(tasks.event(f"{self.name}.pause"))
        if changes:
            self._last = changes[-1]
            found += [tasks.event(self._transition, [msgspec.structs.asdict(one)]) for one in changes]
            if self.recent is not None:
                self.recent.extend((self.program_number, one) for one in changes)
        if changes or has_changed:
            found.append(self.store_data_task(self.name, self._page()))
        if self._guard is not None and (cause := self._guard.failure(interpreter.problems.values(), self._real_ns())):
            self._put_back(cause)
        return [*found, *self._alarm_set(is_new=bool(changes))]

    def _step_now(self) -> list[Task]:
        """Return the step that looks at what has changed from outside, if there is no clock."""
        if self._alarm is None:
            return []
        self._alarm.is_stale = True
        return self._alarm_set(is_new=False) if self.is_paused else [tasks.event(f"{self.name}.step")]

    def _alarm_set(self, *, is_new: bool) -> list[Task]:
        """Return the task that sets the alarm to the next step, if there is one and it has to be set."""
        if self._alarm is None:
            return []
        next_ns = None if self.is_paused else self.interpreter.next_ns(is_new=is_new)
        if not self._alarm.must_move(next_ns, self._now_ns(), is_new=is_new):
            return []
        page = {NEXT_S: None if next_ns is None else next_ns / NS_PER_S}
        return [self.store_data_task(alarm_key(self.name), page, process=False)]

    def _page(self) -> dict[str, Any]:
        interpreter, last = self.interpreter, self._last
        return {
            "active": interpreter.active,
            "entered_s": {path: since_ns / NS_PER_S for path, since_ns in interpreter.since_ns.items()},
            "left": [
                {"machine": path, "state": state, "held_s": held_ns / NS_PER_S}
                for path, state, held_ns in interpreter.left
            ],
            "entered": [{"machine": path, "state": state} for path, state in interpreter.entered],
            "last": None if last is None else msgspec.structs.asdict(last),
            "variables": interpreter.variables,
            "program": self.program_number,
            "problems": sum(one.count for one in interpreter.problems.values()),  # exact: integers
            "ignored": sum(interpreter.ignored.values()),  # exact: integers
            "is_paused": self.is_paused,
        }
