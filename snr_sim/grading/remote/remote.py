"""Student's components in the grader's node: proxies whose steps run in the student's process.

    grader's node: sensors, proxies, actuators, plant, clock      student's process: the components themselves
        a task for 'depth_hold'    -- task, time, new pages -->    its handler
                                   <-- tasks it returned ------

A proxy has the name, the position and the handlers' names of its component. So the run and its trace are the same as
if the components were here; but everything that comes back is checked first (`task_filter.py`).
"""

from __future__ import annotations

import base64
import io
import pickle
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar

import msgspec

from snr_sim.core.datastore import PREVIOUS
from snr_sim.core.endpoint import Endpoint, EndpointFactory
from snr_sim.core.factory import ComponentFactory
from snr_sim.core.loop import Loop, LoopFactory
from snr_sim.core.node import Node
from snr_sim.core.output_recording import LEVELS
from snr_sim.grading.lab.verdicts import GraderError, SubmissionError
from snr_sim.grading.remote import protocol
from snr_sim.grading.remote.sent_code import LAB_MODULE
from snr_sim.grading.remote.student_process import StudentProcess
from snr_sim.grading.remote.task_filter import TaskFilter
from snr_sim.prelude import tasks
from snr_sim.prelude.errors import SnrError
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.scenario import RobotInfo
from snr_sim.prelude.task import Page, SomeTasks, Task, TaskHandler, TaskHandlerMap, TaskId, TaskType
from snr_sim.scenario import library

STEP_CPU_S = 5.0  # for one handler, or one step of a component's life
LOAD_CPU_S = 20.0  # for reading a file, or calling its `factories`
T = TypeVar("T")


class StudentCodeError(SnrError):
    """Failure of the student's component in its own process; the message has the student's line first."""


class Remote:
    """The student's components in all of the grader's nodes; a file of the submission has their `factories`."""

    def __init__(self, child: StudentProcess, file: str) -> None:
        self._child = child
        self._file = file
        self.task_filter: TaskFilter = TaskFilter(file)
        self.submission_error: SubmissionError | None = None  # kept here, as a node that ends loses its message
        self.files: list[tuple[str, str]] = []  # that were read: the folder's name and the path in it
        self.names: set[str] = set()  # of the student's components
        self._made = 0  # factories, so far
        self._sent: dict[str, dict[str, Page]] = {}
        self._task: Task | None = None  # that was sent last, from which node
        self._node: Node | None = None
        self._answers: dict[str, list[Task] | StudentCodeError] = {}  # to it, by component

    def ask(self, verb: protocol.Verb, decoder: msgspec.json.Decoder[T], cpu_s: float = STEP_CPU_S) -> T:
        """Send a request to the student's process, as `StudentProcess.ask`; return its answer, of the decoder's type.

        Raises:
            SubmissionError: the answer has another type; kept too, as a node that runs replaces the message by its own.
            StudentCodeError: a step of a component's life cycle raised.
        """
        try:
            answer = self._child.ask(verb, cpu_s)
            if answer.error is not None and isinstance(verb, protocol.StepRequest) and answer.error.step != "slow":
                raise StudentCodeError(answer.error.text, answer.error.fix)
            return protocol.decode_as(decoder, answer.result())
        except protocol.ProtocolError as error:
            self.submission_error = SubmissionError(
                error.message, "Do not use file descriptors that your program has not opened."
            )
            raise self.submission_error from error
        except SubmissionError as error:
            self.submission_error = error
            raise

    def controller(self, path: Path, robots: Sequence[tuple[str, Path]]) -> ModuleType:
        """Return a module that stands for the student's file: its `factories` makes proxies.

        The path is for the trace's header. The student may import the modules of the robots.
        """
        load = protocol.LoadRequest(self._file, [(name, str(folder)) for name, folder in robots])
        loaded = self.ask(load, _loaded, LOAD_CPU_S)
        module = ModuleType(Path(self._file).stem)
        names = {"OPTIONS": loaded.options, "ROLES": loaded.roles, "factories": self.factories, "__file__": str(path)}
        vars(module).update((name, value) for name, value in names.items() if value is not None)
        return module

    def factories(self, robot: RobotInfo) -> list[RemoteEndpointFactory | RemoteLoopFactory]:
        """Have the student's `factories(robot)` called; return a proxy for each of its factories."""
        opened = self.ask(protocol.Open(self._file, _pickled(robot)), _opened, LOAD_CPU_S)
        self.files = opened.files
        first, self._made = self._made, self._made + len(opened.are_loops)
        return [
            RemoteLoopFactory(self, number) if is_loop else RemoteEndpointFactory(self, number)
            for number, is_loop in enumerate(opened.are_loops, start=first)
        ]

    def make(self, factory: int, parent: NodeApi) -> protocol.ComponentInfo:
        """Have a component made in the student's process."""
        made = self.ask(protocol.Make(parent.role, factory, parent.component_seed), _made)
        self.task_filter.component(made)
        self.names.add(made.name)
        return made

    def handle(self, component: RemoteEndpoint, task: Task) -> SomeTasks:
        """Have a task handled; the student's components behind this one handle it in the same request."""
        is_next = self._task is task and self._node is component.parent
        if not is_next or component.name not in self._answers:
            self._send(component, task)
        answer = self._answers.pop(component.name, [])
        if isinstance(answer, StudentCodeError):
            raise answer
        return answer

    def _send(self, component: RemoteEndpoint, task: Task) -> None:
        node = component.parent
        self._task, self._node, self._answers = task, node, {}
        processed = _processed_by(task, node)
        raw = msgspec.Raw((task if processed is None else Task(task.type, task.name)).serialize())
        answer = self.ask(protocol.Handle(*self._address(component, node.machine.now_s), raw, processed), _returned)
        for name, raws in answer.returned.items():
            self._answers[name] = self.task_filter.tasks(raws, node, name)
        if answer.failure is not None:
            if answer.failure.step == "slow":
                self.submission_error = SubmissionError(answer.failure.text, protocol.SLOW_HINT)
            self._answers[answer.failed] = StudentCodeError(answer.failure.text, answer.failure.fix)
        self._apply(answer, node)

    def step(self, component: RemoteEndpoint | RemoteLoop, step: str) -> protocol.StepResponse:
        """Have a step of a component's life done."""
        node = component.parent
        done = self.ask(protocol.StepRequest(*self._address(component, node.get_time_s()), step), _step_done)
        self._apply(done, node)
        return done

    def _apply(self, effects: protocol.StepEffects, node: Node) -> None:
        """Apply the other effects of a step."""
        for raw, source in effects.entered:
            (task,) = self.task_filter.tasks([raw], node, source)
            node.enqueue_input(task, source)
        for name, rows in (effects.handlers or {}).items():
            changed = node.components.get(name)
            if isinstance(changed, RemoteEndpoint):
                changed.task_handlers = changed.handlers_of(rows)
        for note in self.task_filter.notes(effects.notes):
            node.add_note(note)
        for component, level, text in effects.output:
            if (component in self.names or component.partition(" ")[0] in self.names) and level in LEVELS:
                node.record_text(component, level, text)
        for key in self.task_filter.missed(effects.missed):
            node.datastore.missed[key] = None

    def _address(
        self, component: RemoteEndpoint | RemoteLoop, now_s: float
    ) -> tuple[str, str, float, list[msgspec.Raw], dict[str, float]]:
        """Count a request to a component, and return the fields that each has.

        The pages are those in the datastore that were not sent yet, each after the page before it.
        """
        self.task_filter.count(now_s)
        node = component.parent
        sent = self._sent.setdefault(node.role, {})
        pages: list[msgspec.Raw] = []
        came_s: dict[str, float] = {}
        previous = node.datastore.previous
        for key, page in node.datastore.pages.items():
            before = sent.get(key)
            if page is before:
                continue
            sent[key] = page
            older = previous.get(key)
            if older is not None and older is not before:
                pages.append(msgspec.Raw(older.serialize()))
            pages.append(msgspec.Raw(page.serialize()))
            if page.origin != node.name:
                came_s[key] = node.received_at_s(key)
        return node.role, component.name, now_s, pages, came_s


def _processed_by(task: Task, node: Node) -> list[msgspec.Raw] | None:
    """Return the page that the task of a node carries, see `Handle`."""
    page = task.page if task.type is TaskType.process_data else None
    if page is None or page.key != task.name:
        return None
    if page is node.datastore.pages.get(page.key):
        return []
    before = node.get_page(page.key + PREVIOUS)
    return [msgspec.Raw(one.serialize()) for one in (page, before) if one is not None]


def _pickled(robot: RobotInfo) -> str:
    """Return the argument of `factories` for its process; raise GraderError if something in it is unknown there."""
    buffer = io.BytesIO()
    try:
        _RobotPickler(buffer).dump(robot)
    except GraderError:
        raise
    except Exception as error:
        raise GraderError(f"The argument of the student's `factories` cannot be sent: {error}") from error
    return base64.b64encode(buffer.getvalue()).decode()


class _RobotPickler(pickle.Pickler):
    """Refuses what only this process has loaded."""

    def persistent_id(self, value: Any) -> None:
        module = value.__module__ if isinstance(value, type) else type(value).__module__
        if str(module).startswith((library.SCENARIO_MODULE, LAB_MODULE, "__main__")):
            raise GraderError(
                f"The argument of the student's `factories` holds {value!r}, whose class is defined in {module}.",
                fix="define such classes in the robot's folder, which the student's process may read.",
            )


class _ProxyFactory(ComponentFactory):
    """Makes the proxy of a component, of this number; the student's own is made in its process."""

    def __init__(self, remote: Remote, number: int) -> None:
        super().__init__()
        self.remote: Remote = remote
        self._number = number


class RemoteEndpointFactory(_ProxyFactory, EndpointFactory):
    """Makes the proxy of an endpoint."""

    def get(self, parent: NodeApi) -> Endpoint:
        """Return the proxy."""
        return RemoteEndpoint(self, parent, self.remote.make(self._number, parent))


class RemoteEndpoint(Endpoint):
    """Proxy of an endpoint of the student's."""

    factory: RemoteEndpointFactory
    parent: Node

    def __init__(self, factory: RemoteEndpointFactory, parent: NodeApi, made: protocol.ComponentInfo) -> None:
        assert isinstance(parent, Node)  # in the grader
        super().__init__(factory, parent, made.name)
        self._steps = {"join" if step == "halt" else step for step in made.steps}
        self.task_handlers = self.handlers_of(made.handlers)
        self.optional_events = made.optional_events

    def handlers_of(self, rows: Sequence[protocol.HandlerRow]) -> TaskHandlerMap:
        """Return handlers that have the student's called."""
        handlers: TaskHandlerMap = {}
        for kind, name, label in rows:
            task_type = TaskType(kind)
            handlers[task_type if name is None else (task_type, name)] = self._handler(label)
        return handlers

    def _handler(self, label: str) -> TaskHandler:
        def handle(task: Task, _task_id: TaskId) -> SomeTasks:
            return self.factory.remote.handle(self, task)

        handle.__name__ = label
        return handle

    def begin(self) -> None:
        """Have the student's `begin` called, if there is one."""
        self._do("begin")

    def join(self) -> None:
        """Have the student's `halt` called, if there is one."""
        self._do("join")

    def terminate(self) -> None:
        """Have the student's `terminate` called, if there is one."""
        self._do("terminate")

    def _do(self, step: str) -> None:
        if step in self._steps:
            done = self.factory.remote.step(self, step)
            self.schedule(self.factory.remote.task_filter.tasks(done.scheduled, self.parent, self.name))


class RemoteLoopFactory(_ProxyFactory, LoopFactory):
    """Makes the proxy of a loop."""

    def get(self, parent: NodeApi) -> Loop:
        """Return the proxy."""
        return RemoteLoop(self, parent, self.remote.make(self._number, parent))


MAX_WAKES = 100  # of the pages that a loop says it is woken by


class RemoteLoop(Loop):
    """Proxy of a loop of the student's: the grader's clock determines its ticks."""

    factory: RemoteLoopFactory
    parent: Node

    def __init__(self, factory: RemoteLoopFactory, parent: NodeApi, made: protocol.ComponentInfo) -> None:
        assert isinstance(parent, Node)  # in the grader
        super().__init__(factory, parent, made.name, made.rate_hz)
        self.first_tick_after_s: float = made.first_s
        self.next_tick_at_s = None if made.repeats else made.next_s
        self.wakes_on = tuple(made.wakes_on[:MAX_WAKES])
        self._repeated = tasks.event(made.repeats) if made.repeats else None

    def setup(self) -> None:
        """Have the student's `setup` called."""
        self._do("setup")

    def loop(self) -> None:
        """Have the student's `loop` called; the clock of a state machine needs no request for that."""
        if self._repeated is None:
            self._do("loop")
        else:
            self.factory.remote.task_filter.count(self.parent.get_time_s())
            self.schedule(self._repeated)

    def halt(self) -> None:
        """Have the student's `halt` called."""
        self._do("join")

    def terminate(self) -> None:
        """Have the student's `terminate` called."""
        self._do("terminate")

    def _do(self, step: str) -> None:
        done = self.factory.remote.step(self, step)
        self.next_tick_at_s = done.next_s
        if done.is_stopped:
            self.stop()


_loaded = msgspec.json.Decoder(protocol.ModuleInfo)
_opened = msgspec.json.Decoder(protocol.FactoriesInfo)
_made = msgspec.json.Decoder(protocol.ComponentInfo)
_returned = msgspec.json.Decoder(protocol.HandleResult)
_step_done = msgspec.json.Decoder(protocol.StepResponse)
