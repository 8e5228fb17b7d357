"""Node around the student's components in their own process; executes one step per request of the grader.

The real node is the grader's. The pages of its datastore are copied here before each step, and the tasks and pages of
the step are sent back: a component cannot detect that sensors, plant and clock run in another process.
"""

from __future__ import annotations

import base64
import pickle
import sys
from collections import deque
from collections.abc import Callable, Sequence
from itertools import dropwhile
from pathlib import Path
from types import ModuleType
from typing import Any

import msgspec

from snr_sim.core.clocks import ClockExecutor, SimClock
from snr_sim.core.config import AnyFactory, Config, Mode
from snr_sim.core.endpoint import Endpoint
from snr_sim.core.handlers import as_tasks, handler_name, schedule_returned
from snr_sim.core.loop import Loop, LoopFactory
from snr_sim.core.machine import EventMachine
from snr_sim.core.node import Node
from snr_sim.core.output_recording import RecordedOutput
from snr_sim.core.source_location import describe_error, location_of
from snr_sim.grading.remote import protocol
from snr_sim.grading.remote.child_values import plain
from snr_sim.grading.sandbox.child_limits import CpuTimeExceeded
from snr_sim.prelude.component import Component
from snr_sim.prelude.errors import SnrError
from snr_sim.prelude.task import Page, Task, TaskType
from snr_sim.prelude.values import encode_value
from snr_sim.scenario import library
from snr_sim.scenario.student_calls import factories_of

MAX_OUTPUT_CHARS = 100_000  # of the output and logs of one step
_STEPS_WITH_TASKS = ("begin", "setup", "loop")
_AUTHORS_STEPS = ("begin", "join", "halt", "terminate")
_OBJECT = b'{"$":"object"'
_KEPT = 64  # pages of a key: a step may make some, which wait to be processed


class ExternalClock(SimClock):
    """Clock whose time is set from outside."""

    def show(self, now_s: float) -> None:
        """Show a time."""
        self._now_s = now_s


class CollectingMachine(EventMachine):
    """Event machine that executes nothing: keeps the tasks that the running component schedules during its step."""

    scheduled: list[Task]

    def schedule(self, tasks: Sequence[Task]) -> None:
        """Keep it."""
        self.scheduled.extend(tasks)


class ExternalExecutor(ClockExecutor):
    """Executor of a loop whose ticks the grader's clock requests."""

    def start(self) -> None:
        """Do nothing: the grader calls."""

    def tick_now(self) -> None:
        """Do nothing: the grader's own loop listens to the pages in `wakes_on`."""


class TypedPages:
    """Pages that hold a dataclass or a Struct: they leave the process as its fields, and come back as they were.

    In `snr run` such a page is the same object for all who read it in the node. Here the node is the grader's, which
    knows no class of the student's. Devices and checks read the fields; the student's own components get the object.
    """

    def __init__(self) -> None:
        self._kept: dict[str, deque[tuple[bytes, Page]]] = {}

    def encode_task(self, task: Task) -> msgspec.Raw:
        """Return a task as it is sent to the grader."""
        raw = task.serialize()
        if _OBJECT in raw and task.type is TaskType.store_page and len(task.val_list) == 1:
            (page,) = task.val_list
            try:
                fields = msgspec.structs.replace(page, data=msgspec.to_builtins(page.data))
            except (TypeError, ValueError, RecursionError):
                return msgspec.Raw(raw)  # the grader reports what of it cannot be sent
            self._kept.setdefault(page.key, deque(maxlen=_KEPT)).append((fields.serialize(), page))
            raw = Task.store_page(fields).serialize()
        return msgspec.Raw(raw)

    def decode_page(self, raw: bytes) -> Page:
        """Return a page from the grader, with its original object if it was made here."""
        page = Page.deserialize(raw)
        kept: Any = self._kept.get(page.key, ())
        return next((made for fields, made in reversed(kept) if fields == raw), page)


class ChildNode(Node):
    """Node whose steps are requested one by one; of the role and the component seed of the grader's node."""

    def __init__(self, role: str, component_seed: int) -> None:
        self._external_clock = ExternalClock()
        self._have_handlers_changed = False
        super().__init__(role, Config(Mode.TEST, {role: []}), clock=self._external_clock)
        self.component_seed: int = component_seed
        machine = CollectingMachine(self.machine.lookup, self.inbox, None)
        machine.scheduled = []
        self.machine: CollectingMachine = machine
        self._sent_notes = 0
        self._output: list[tuple[str, str, str]] = []
        self._output_chars = 0
        self._typed = TypedPages()

    def handlers_changed(self) -> None:
        """Remember to report it to the grader."""
        super().handlers_changed()
        self._have_handlers_changed = True

    def record_text(self, component: str, level: str, text: str) -> None:
        """Keep what a component prints and logs for the grader's trace, up to a bound for each step."""
        self._output_chars += len(text)
        if self._output_chars <= MAX_OUTPUT_CHARS:
            self._output.append((component, level, text.encode(errors="backslashreplace").decode()))

    def add(self, factory: AnyFactory) -> protocol.ComponentInfo:
        """Create a component; return the data of it that the grader needs."""
        component = self.registry.make(factory)
        self._output, self._output_chars = [], 0  # a trace contains nothing from before its first record
        self.registry.add(component, len(self.components))
        kind: type[Any] = Loop if isinstance(component, Loop) else Endpoint
        steps = [step for step in _AUTHORS_STEPS if getattr(type(component), step) is not getattr(kind, step)]
        details: dict[str, Any] = {}
        if isinstance(component, Endpoint):
            details = {"optional_events": [str(name) for name in component.optional_events]}
        if isinstance(component, Loop):
            component.begin_with(ExternalExecutor(component, self.life))
            details = {
                "rate_hz": float(component.max_tick_rate_hz),
                "first_s": float(component.first_tick_after_s),
                "wakes_on": [str(key) for key in component.wakes_on],
                "next_s": component.next_tick_at_s,
                "repeats": repeated_event(component),
            }
        return protocol.ComponentInfo(component.name, list(self.handlers_of(component)), steps, **details)

    @staticmethod
    def handlers_of(component: Component) -> Any:
        """Yield type, name (or None) and label of each handler."""
        for task_id, handler in component.task_handlers.items():
            kind, name = task_id if isinstance(task_id, tuple) else (task_id, None)
            yield kind.value, name, handler_name(handler)

    def sync(self, do: protocol.Handle | protocol.StepRequest) -> None:
        """Set the time, and copy the pages of the grader's datastore to this one."""
        self._external_clock.show(do.now_s)
        self.machine.now_s = do.now_s
        for raw in do.pages:
            self.datastore.put(self._typed.decode_page(bytes(raw)))
        self.datastore.received_s.update(do.came_s)

    def _with_page(self, task: Task, processed: Sequence[msgspec.Raw] | None) -> Task:
        """Return a task with the page that it carries in the grader's node, see `Handle`."""
        if processed is None:
            return task
        if not processed:
            return Task(task.type, task.name, [self.datastore.pages[task.name]])
        page, *before = (self._typed.decode_page(bytes(raw)) for raw in processed)
        self._storage.await_processing(page, before[0] if before else None)
        return Task(task.type, task.name, [page])

    def handle(self, do: protocol.Handle) -> protocol.HandleResult:
        """Call each component's handler of a task, from the one named on."""
        self.sync(do)
        task, machine = self._with_page(Task.deserialize(bytes(do.task)), do.processed), self.machine
        returned: dict[str, list[Task]] = {}
        failed, failure = "", None
        machine.task = task
        entries = dropwhile(lambda entry: entry[0].name != do.component, machine.lookup.find(task))
        for component, handler, task_id, _ in entries:
            if component is self._core:
                continue
            machine.running = component
            try:
                made = as_tasks(handler(task, task_id), component, handler)
                returned[component.name] = [*machine.scheduled, *made]
            except BaseException as error:
                failed, failure = component.name, failure_of(error, location_of(handler))
                break
            finally:
                machine.running = None
                machine.scheduled.clear()
        machine.task = None
        encoded = {name: [self._typed.encode_task(task) for task in tasks] for name, tasks in returned.items()}
        return protocol.HandleResult(encoded, failed=failed, failure=failure, **self.step_effects())

    def step(self, do: protocol.StepRequest) -> protocol.StepResponse:
        """Call one of the steps of a component's life, or a loop's `setup` or `loop`."""
        self.sync(do)
        component, step, machine = self.components[do.component], do.step, self.machine
        machine.running = component
        if step == "join":
            self._is_halting = True
        if step == "loop" and isinstance(component, Loop) and isinstance(component.caller, ExternalExecutor):
            component.caller.ticks += 1
        try:
            if step == "join" and isinstance(component, Loop):
                component.halt()
            else:
                returned = getattr(component, step)()
                if step in _STEPS_WITH_TASKS:
                    schedule_returned(returned, component, getattr(component, step))
        finally:  # also after an error: else the next step would bring the tasks, of another component
            machine.running = None
            scheduled, machine.scheduled = machine.scheduled, []
        encoded = [self._typed.encode_task(task) for task in scheduled]
        effects = self.step_effects()
        if isinstance(component, Loop):
            effects |= {"next_s": component.next_tick_at_s, "is_stopped": component.is_terminated()}
        return protocol.StepResponse(encoded, **effects)

    def step_effects(self) -> dict[str, Any]:
        """Return the other effects of a step: tasks from the inbox, changed handlers, notes, output."""
        entered = [(self._typed.encode_task(task), source) for task, source in self.inbox.waiting]
        self.inbox.waiting.clear()
        handlers = None
        if self._have_handlers_changed:
            self._have_handlers_changed = False
            handlers = {
                name: list(self.handlers_of(one)) for name, one in self.components.items() if one is not self._core
            }
        notes = self.notes[self._sent_notes :]
        self._sent_notes = len(self.notes)
        missed = [key for key in self.datastore.missed if isinstance(key, str)]
        self.datastore.missed.clear()
        output, self._output, self._output_chars = self._output, [], 0
        return {"entered": entered, "handlers": handlers, "notes": notes, "missed": missed, "output": output}


def repeated_event(loop: Any) -> str:
    """Return the event that a loop sends at each tick, if it is the clock of a state machine; else an empty text."""
    behaviors = sys.modules.get("snr_sim.behaviors.endpoint")  # not imported for programs without a machine
    return str(loop.event) if behaviors is not None and type(loop) is behaviors.StepLoop else ""


def failure_of(error: BaseException, begins: Any) -> protocol.RemoteFailure:
    """Return the error with the student's line first, and a fix; the grader adds in which step it was."""
    before, _, after = describe_error(error, "\0", begins).partition("\n  \0")
    step = "slow" if isinstance(error, CpuTimeExceeded) else "handle"
    return protocol.RemoteFailure(step, before.replace("CpuTimeExceeded: ", ""), after.partition("Try: ")[2])


class NodeVerbs:
    """The verbs that are about nodes; `read_module` returns a Python file of the student's as a module."""

    def __init__(self, read_module: Callable[[str], ModuleType]) -> None:
        self._read_module = read_module
        self._programs: dict[str, ModuleType] = {}  # that are state machines in text
        self._factories: list[AnyFactory] = []
        self._nodes: dict[str, ChildNode] = {}
        sys.stdout = RecordedOutput(sys.stdout, self._nodes.values())
        self._folders = {protocol.SUBMISSION: Path.cwd()}
        verbs = (self.load, self.open, self.make, self.handle, self.step)
        self.verbs: dict[str, Callable[[Any], bytes]] = {verb.__name__: verb for verb in verbs}

    def load(self, do: protocol.LoadRequest) -> bytes:
        """Read a file; return its OPTIONS and ROLES, if it has any."""
        for name, folder in do.robots:
            self._folders[name] = Path(folder)
            library.name_robot(name, Path(folder))
        if do.robots and Path(do.file).suffix == library.LRP:
            name, folder = do.robots[0]
            robot = library.FoundItem("robots", name, Path(folder), "the grader")
            self._programs[do.file] = library.load_controller(robot, do.file)
        module = self._controller(do.file)
        if not callable(getattr(module, "factories", None)):
            raise SnrError(
                f"{do.file} has no function `factories`, which a controller needs.",
                fix="def factories(robot): return [MyEndpointFactory()].",
            )
        return encode_value(
            {"options": plain(getattr(module, "OPTIONS", None)), "roles": plain(getattr(module, "ROLES", None))}
        )

    def open(self, do: protocol.Open) -> bytes:
        """Have a file make its factories; return for each whether it makes a loop."""
        module = self._controller(do.file)
        robot = pickle.loads(base64.b64decode(do.robot))  # written by the grader, so safe to unpickle
        made = factories_of(module, robot)
        self._factories += made
        return _encode(
            protocol.FactoriesInfo([isinstance(one, LoopFactory) for one in made], _files_read(self._folders))
        )

    def _controller(self, file: str) -> ModuleType:
        return self._programs.get(file) or self._read_module(file)

    def make(self, do: protocol.Make) -> bytes:
        """Create the component of a factory in a node; return the data of it that the grader needs."""
        if do.node not in self._nodes:
            self._nodes[do.node] = ChildNode(do.node, do.chance)
        return _encode(self._nodes[do.node].add(self._factories[do.factory]))

    def handle(self, do: protocol.Handle) -> bytes:
        """Have the components of a node handle a task."""
        return _encode(self._nodes[do.node].handle(do))

    def step(self, do: protocol.StepRequest) -> bytes:
        """Have a component of a node do a step of its life."""
        try:
            return _encode(self._nodes[do.node].step(do))
        except CpuTimeExceeded:
            raise
        except BaseException as error:
            failure = failure_of(error, None)
            raise SnrError(failure.text, failure.fix) from None


def _files_read(folders: dict[str, Path]) -> list[tuple[str, str]]:
    """Return which files in these folders were read as modules: the folder's name and the path in it."""
    files = {Path(file).resolve() for one in list(sys.modules.values()) if (file := getattr(one, "__file__", None))}
    return sorted(
        (name, file.relative_to(folder).as_posix())
        for name, folder in folders.items()
        for file in files
        if file.is_relative_to(folder)
    )


_encode = msgspec.json.Encoder().encode
