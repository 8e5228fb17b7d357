"""Student's components with given inputs: sends them pages and tasks one by one, and returns what each one produced.

A bare node on a virtual clock, without plant or devices: the node runs here, the student's components run in their own
process.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from snr_sim.core.clocks import SimClock
from snr_sim.core.config import AnyFactory, Config, Mode
from snr_sim.core.lockstep import NO_MORE_EVENTS, TIME_LIMIT, LockStep
from snr_sim.core.node import Node
from snr_sim.grading.lab.submission import Submission
from snr_sim.grading.lab.verdicts import ENDED_EARLY, GraderError, SubmissionError
from snr_sim.grading.remote.remote import Remote
from snr_sim.prelude.errors import SnrError
from snr_sim.prelude.recorder import Handled, TaskRef
from snr_sim.prelude.scenario import RobotInfo
from snr_sim.prelude.task import Page, Task, TaskType
from snr_sim.scenario import library

GIVEN = "given"  # source of inputs, in a trace


@dataclass(frozen=True)
class Stimulus:
    """An input: a page under a key, or a task.

    Args:
        at_s: its time; inputs of the same time keep their order.
        key, value: of a page; each is followed by `process_data`, unless `process` is false.
        task: (type, name, values) instead, such as ("event", "start", []).
        process: whether a page sets off work.
    """

    at_s: float
    key: str = ""
    value: Any = None
    task: tuple[str, str, list[Any]] | None = None
    process: bool = True


@dataclass(frozen=True)
class Output:
    """A task that a component of the student's made.

    Args:
        at_s: when.
        kind: "store_page", "event", "process_data" or "terminate".
        name: a page's key, an event's name.
        value: a page's data; for other tasks, their values.
        after: index of the input that caused it, through whatever lay between; None if none did, but a loop's tick or
            a component's `begin`.
        component: its sender.
        page: the page itself, of store_page.
    """

    at_s: float
    kind: str
    name: str
    value: Any
    after: int | None
    component: str = ""
    page: Page | None = None


def run_inputs(
    student: Submission,
    file: str,
    pages: Sequence[Stimulus],
    *,
    robot: RobotInfo | str = "urov",
    role: str = "",
    options: dict[str, str] | None = None,
    parameters: Any = None,
    order: Sequence[int] | None = None,
    until_s: float | None = None,
    seed: int = 0,
) -> list[Output]:
    """Return what the student's components produced from the inputs, in order.

    Args:
        file: of the submission, which has `factories`.
        pages: the inputs.
        robot: argument of `factories`, or the robot's name in it.
        role, options, parameters: of the robot, if only its name was given.
        order: order of the components: a permutation.
        until_s: how long the student's loops may tick; the time of the last input if not given.
        seed: of the components' random numbers.

    Raises:
        SubmissionError: the student's program failed, or ended the run before the last input.
    """
    if isinstance(robot, str):
        robot = RobotInfo(robot, role or robot, "", "", parameters, options or {})
    found = [one for one in library.list_available("robots") if one.name == robot.name]
    child = student.new_child(file, [one.path for one in found])
    try:
        remote = Remote(child, file)
        module = remote.controller(student.folder / file, [(one.name, one.path) for one in found])
        factories = module.factories(robot)
        if order is not None:
            if sorted(order) != list(range(len(factories))):
                raise SubmissionError(
                    f"{file}: factories(robot) makes {len(factories)} components, where {len(order)} were expected.",
                    "Hand in as many components as the lab asks for.",
                    expected=str(len(order)),
                    actual=str(len(factories)),
                )
            factories = [factories[place] for place in order]
        return _run_node(remote, robot, factories, pages, until_s, seed)
    finally:
        student.close_child(child)


def _run_node(
    remote: Remote,
    robot: RobotInfo,
    factories: Sequence[AnyFactory],
    pages: Sequence[Stimulus],
    until_s: float | None,
    seed: int,
) -> list[Output]:
    clock = SimClock()
    output_log = OutputLog(remote.names)
    try:
        config = Config(Mode.TEST, {robot.role: factories})
        node = Node(robot.role, config, clock=clock, recorder=output_log, seed=seed)
        for number, stimulus in enumerate(pages):  # before the components' loops tick
            clock.call_at(stimulus.at_s, partial(_deliver, stimulus, number, node, output_log), order=-1)
        last_s = max((stimulus.at_s for stimulus in pages), default=0.0)
        LockStep([node], clock, until_s=last_s if until_s is None else until_s).run()
    except (SubmissionError, GraderError):
        raise
    except SnrError as error:
        hint = "Your program raised an error: look at the line named."
        raise remote.submission_error or SubmissionError(str(error), hint) from error
    if remote.submission_error is not None:
        raise remote.submission_error
    if len(output_log.delivered) < len(pages) and node.exit_reason not in (TIME_LIMIT, NO_MORE_EVENTS):
        raise SubmissionError(f"Your program ended the run at {clock.now_s():.2f} s.", ENDED_EARLY, "a whole run")
    return output_log.outputs


def _deliver(stimulus: Stimulus, number: int, node: Node, output_log: OutputLog) -> None:
    """Put an input into the node's inbox."""
    if stimulus.task is not None:
        kind, name, values = stimulus.task
        task = Task(TaskType(kind), name, list(values))
    else:
        page = Page(stimulus.key, stimulus.value, node.name, node.get_time_s(), stimulus.process)
        task = Task.store_page(page)
    output_log.delivered.append(number)
    node.enqueue_input(task, GIVEN)


class OutputLog:
    """Recorder of what the student's components produce, and which input caused it. Implements `Recorder`.

    `names` are those of the student's components, known once they are made.
    """

    def __init__(self, names: set[str]) -> None:
        self._names = names
        self.delivered: list[int] = []  # numbers of the inputs that were put into the inbox
        self._accepted = 0  # how many of them have left it
        self.outputs: list[Output] = []

    def for_node(self, name: str) -> OutputLog:
        """Return itself."""
        return self

    def begun(self, now_s: float, component: str, scheduled: Sequence[Task]) -> list[TaskRef]:
        """Keep what a component scheduled in `begin`."""
        return self._made(now_s, [(component, task) for task in scheduled], None)

    def input(self, now_s: float, source: str, task: Task) -> TaskRef:
        """Keep what a loop of the student's sent."""
        cause = None
        if source == GIVEN:
            cause = self.delivered[self._accepted]
            self._accepted += 1
        if source in self._names:
            self._keep(now_s, source, task, cause)
        return (task, 0, 0, cause)

    def task(self, now_s: float, task_ref: TaskRef, handled: Sequence[Handled]) -> list[TaskRef]:
        """Keep what handlers returned."""
        return self._made(now_s, [(label[0], task) for label, returned in handled for task in returned], task_ref[3])

    def error(self, now_s: float, component: str, message: str) -> None:
        """Keep nothing: the error also ends the run."""

    def record_text(self, now_s: float, component: str, level: str, text: str) -> None:
        """Keep nothing: the student's process keeps the output of the student's program."""

    def end(self, now_s: float, reason: str, summary: dict[str, Any]) -> None:
        """Keep nothing."""

    def _made(self, now_s: float, made: Sequence[tuple[str, Task]], cause: int | None) -> list[TaskRef]:
        for component, task in made:
            if component in self._names:
                self._keep(now_s, component, task, cause)
        return [(task, 0, index, cause) for index, (_, task) in enumerate(made)]

    def _keep(self, now_s: float, component: str, task: Task, cause: int | None) -> None:
        page = task.val_list[0] if task.type is TaskType.store_page else None
        value = task.val_list if page is None else page.data
        self.outputs.append(Output(now_s, task.type.value, task.name, value, cause, component, page))
