"""Student's components with given inputs: sends them pages and tasks one by one, and returns what each one produced.

A bare node on a virtual clock, without plant or devices: the node, and the parts of snr_sim in it, run here; the
student's components run in their own process.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from snr_sim.core.clocks import SimClock
from snr_sim.core.config import AnyFactory, Config, Mode
from snr_sim.core.lockstep import NOTHING_LEFT, TIME_LIMIT, LockStep
from snr_sim.core.node import Node
from snr_sim.grading.lab.submission import Submission
from snr_sim.grading.lab.verdicts import ENDED_EARLY, LabFault, Misbehaved
from snr_sim.grading.remote.remote import Remote
from snr_sim.prelude.errors import SnrError
from snr_sim.prelude.page import Page
from snr_sim.prelude.recorder import Handled, Ticket
from snr_sim.prelude.scenario import Robot
from snr_sim.prelude.task import Task, TaskType
from snr_sim.scenario import library

_SOURCE = "given"


@dataclass(frozen=True)
class Given:
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
class Produced:
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


Reply = Callable[[Produced], "Iterable[Given] | Given | None"]


def feed(
    student: Submission,
    file: str,
    pages: Sequence[Given],
    *,
    robot: Robot | str = "urov",
    role: str = "",
    options: dict[str, str] | None = None,
    parameters: Any = None,
    order: Sequence[int] | None = None,
    with_parts: Sequence[AnyFactory] = (),
    reply: Reply | None = None,
    until_s: float | None = None,
    seed: int = 0,
) -> list[Produced]:
    """Return what the student's components produced from the inputs, in order.

    Args:
        student: the submission.
        file: of the submission, which has `factories`.
        pages: the inputs.
        robot: argument of `factories`, or the robot's name in it.
        role, options, parameters: of the robot, if only its name was given.
        order: order of the components: a permutation of the student's, then the parts.
        with_parts: components of snr_sim in the same node, after the student's.
        reply: is called with each thing produced, and returns further inputs, at that time or later: a closed loop.
        until_s: how long the student's loops may tick; the time of the last input if not given.
        seed: of the components' random numbers.

    Raises:
        Misbehaved: the student's program failed, or ended the run before the last input.
    """
    if isinstance(robot, str):
        robot = Robot(robot, role or robot, "", "", parameters, options or {})
    found = [one for one in library.known("robots") if one.name == robot.name]
    child = student.new_child(file, [one.path for one in found])
    try:
        remote = Remote(child, file)
        module = remote.controller(student.folder / file, [(one.name, one.path) for one in found])
        factories = [*module.factories(robot), *with_parts]
        if order is not None:
            if sorted(order) != list(range(len(factories))):
                raise Misbehaved(
                    f"{file}: factories(robot) makes {len(factories) - len(with_parts)} components, "
                    f"where {len(order) - len(with_parts)} were expected.",
                    "Hand in as many components as the lab asks for.",
                    expected=str(len(order) - len(with_parts)),
                    actual=str(len(factories) - len(with_parts)),
                )
            factories = [factories[place] for place in order]
        return _fed(remote, robot, factories, pages, reply, until_s, seed)
    finally:
        student.done_with(child)


def _fed(
    remote: Remote,
    robot: Robot,
    factories: Sequence[AnyFactory],
    pages: Sequence[Given],
    reply: Reply | None,
    until_s: float | None,
    seed: int,
) -> list[Produced]:
    clock = SimClock()
    ledger = Ledger(remote.names)
    try:
        config = Config(Mode.TEST, {robot.role: factories})
        node = Node(robot.role, config, clock=clock, recorder=ledger, seed=seed)
        desk = _Desk(node, clock, ledger, reply)
        for given in pages:
            desk.take(given)
        ledger.on_produced = desk.answer
        last_s = max((given.at_s for given in pages), default=0.0)
        LockStep([node], clock, until_s=last_s if until_s is None else until_s).run()
    except (Misbehaved, LabFault):
        raise
    except SnrError as error:
        if remote.misbehaved is not None:
            raise remote.misbehaved from error
        raise Misbehaved(str(error), "Your program raised an error: look at the line named.") from error
    if remote.misbehaved is not None:
        raise remote.misbehaved
    if desk.is_left_waiting:
        raise Misbehaved(f"Your program ended the run at {clock.now_s():.2f} s.", ENDED_EARLY, "a whole run")
    return ledger.produced


class _Desk:
    """Lets inputs in at their moments."""

    def __init__(self, node: Node, clock: SimClock, ledger: Ledger, reply: Reply | None) -> None:
        self._node = node
        self._clock = clock
        self._ledger = ledger
        self._reply = reply
        self._count = self._brought = 0

    @property
    def is_left_waiting(self) -> bool:
        """Whether the node was ended from within, and inputs were still to come."""
        return self._brought < self._count and self._node.exit_reason not in (TIME_LIMIT, NOTHING_LEFT)

    def take(self, given: Given) -> None:
        """Send an input to the node at its time, before the components' loops tick."""
        number, self._count = self._count, self._count + 1
        if given.at_s <= self._clock.now_s() and self._clock.now_s() > 0.0:
            self._bring(given, number)
        else:
            self._clock.call_at(given.at_s, lambda: self._bring(given, number), order=-1)

    def _bring(self, given: Given, number: int) -> None:
        if given.task is not None:
            kind, name, values = given.task
            task = Task(TaskType(kind), name, list(values))
        else:
            page = Page(given.key, given.value, self._node.name, self._clock.now_s(), given.process)
            task = Task.store_page(page)
        self._brought += 1
        self._ledger.expect(number)
        self._node.enter(task, _SOURCE)

    def answer(self, produced: Produced) -> None:
        """Call `reply`, which closes the loop."""
        if self._reply is None:
            return
        replies = self._reply(produced)
        for given in [replies] if isinstance(replies, Given) else replies or ():
            self.take(given)


class Ledger:
    """Recorder of what the student's components produce, and which input caused it. Implements `Recorder`.

    Args:
        names: of the student's components, known once they are made.
    """

    def __init__(self, names: set[str]) -> None:
        self._names = names
        self._numbers: list[int] = []
        self.produced: list[Produced] = []
        self.on_produced: Callable[[Produced], None] = lambda produced: None

    def expect(self, number: int) -> None:
        """Set the number of the next input through the inbox (`Door`)."""
        self._numbers.append(number)

    def for_node(self, name: str) -> Ledger:
        """Return itself."""
        return self

    def begun(self, now_s: float, component: str, scheduled: Sequence[Task]) -> list[Ticket]:
        """Keep what a component scheduled in `begin`."""
        return self._made(now_s, [(component, task) for task in scheduled], None)

    def input(self, now_s: float, source: str, task: Task) -> Ticket:
        """Keep what a loop of the student's sent."""
        cause = self._numbers.pop(0) if source == _SOURCE else None
        if source in self._names:
            self._keep(now_s, source, task, cause)
        return (task, 0, 0, cause)

    def task(self, now_s: float, ticket: Ticket, handled: Sequence[Handled]) -> list[Ticket]:
        """Keep what handlers returned."""
        return self._made(now_s, [(label[0], task) for label, returned in handled for task in returned], ticket[3])

    def error(self, now_s: float, component: str, message: str) -> None:
        """Keep nothing: the error also ends the run."""

    def said(self, now_s: float, component: str, level: str, text: str) -> None:
        """Keep nothing: the student's process keeps the output of the student's program."""

    def end(self, now_s: float, reason: str, summary: dict[str, Any]) -> None:
        """Keep nothing."""

    def _made(self, now_s: float, made: Sequence[tuple[str, Task]], cause: int | None) -> list[Ticket]:
        for component, task in made:
            if component in self._names:
                self._keep(now_s, component, task, cause)
        return [(task, 0, nth, cause) for nth, (_, task) in enumerate(made)]

    def _keep(self, now_s: float, component: str, task: Task, cause: int | None) -> None:
        page = task.val_list[0] if task.type is TaskType.store_page else None
        value = task.val_list if page is None else page.data
        produced = Produced(now_s, task.type.value, task.name, value, cause, component, page)
        self.produced.append(produced)
        self.on_produced(produced)
