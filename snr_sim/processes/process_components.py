"""Components of a process's node: an endpoint that calls its handlers, and a loop that says when to call its `loop`.

In lock step the loop sends an event at each due time, and the endpoint's handler calls the process's `loop`: so a
replay, which makes no loops, calls it too. On the wall clock the loop calls it on a thread of its own, as it may block.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from inspect import isgeneratorfunction
from pathlib import Path
from threading import Event, Thread
from typing import Any

from snr_sim.core.clocks import SimClock
from snr_sim.core.endpoint import Endpoint, EndpointFactory
from snr_sim.core.handlers import handler_name
from snr_sim.core.loop import NEVER_S, Loop
from snr_sim.core.source_location import describe_error
from snr_sim.core.thread_executor import JOIN_TIMEOUT_S
from snr_sim.links.link import Link
from snr_sim.prelude import tasks
from snr_sim.prelude.errors import ComponentFailedError, ConfigError, SupervisionError, suggest
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.task import SomeTasks, Task, TaskId, TaskType
from snr_sim.processes.loop_steps import LoopSteps
from snr_sim.processes.message import LINK_PAGE, QUIT, SILENT, RoverMessage
from snr_sim.processes.rover_process import ProcessSpec, RoverProcess
from snr_sim.processes.uplink import Uplink

LOOP_EVENT = "loop"
LOOP_SUFFIX = "_loop"  # of the name of a process's loop


class ProcessEndpoint(Endpoint):
    """Calls the methods of a process, and sends what it publishes to the broker.

    Attributes:
        spec: of the process.
        folder: of the run, for the log; None writes none.
        process: what the student has written.
        steps: of its loop, and of each function that it has spawned.
    """

    optional_events = (LOOP_EVENT,)  # on the wall clock the loop has a thread of its own
    spec: ProcessSpec
    folder: Path | None

    def __init__(self, factory: EndpointFactory, parent: NodeApi, name: str) -> None:
        super().__init__(factory, parent, name)
        self._uplink = Uplink(parent, name, None if self.folder is None else self.folder / name, self.spawn)
        self.process: RoverProcess = self.spec.kind(self._uplink)
        self.steps: list[LoopSteps] = [LoopSteps(name, self.process.loop)]
        self._threads: list[Thread] = []
        self._ending = Event()
        self._quit_data: Any = None
        self._is_quitting = self._is_cleaned_up = False
        self._cleanup = self.process.cleanup
        vars(self.process)["cleanup"] = self._cleanup_once  # a process may call it itself, as the seed's do
        self.task_handlers = {
            TaskType.store_page: self.on_stored,
            TaskType.process_data: self.on_message,
            TaskType.terminate: self.on_end,
            (TaskType.event, LOOP_EVENT): self.on_loop,
        }

    def begin(self) -> SomeTasks:
        """Let the process prepare; messages are handled after this."""
        self.process.setup(dict(self.spec.args))
        return None

    def on_stored(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Send a page of this process to the broker."""
        page, link = task.page, self.parent.components.get(LINK_PAGE)
        if page is not None and page.origin == self.parent.name and page.key != LINK_PAGE and isinstance(link, Link):
            link.send(page)
        return None

    def on_message(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Handle a page of the broker, or one that the process has published and subscribes to itself."""
        key: str = task.name
        data: Any = None if task.page is None else task.page.data
        if key == LINK_PAGE:
            self._uplink.connect(data["up"])
        elif key == SILENT:
            raise SupervisionError(
                f"{self.name} has not reported for {data:g} s, while its handlers work: its loop hangs.",
                fix="watchdog_extend(seconds) before what takes longer.",
            )
        elif key == QUIT:
            self._quit_data = data
            return tasks.terminate(QUIT)
        elif key in self._uplink.keys:
            handle = getattr(self.process, f"on_{key}", None)
            if handle is None:
                self.process.message_trigger(RoverMessage(key, data))
            else:
                handle(data)
        return None

    def on_end(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Let the process prepare for its end, once: a second signal is a second task."""
        if not self._is_quitting:
            self._is_quitting = True
            with suppress(SystemExit):  # the seed's processes end themselves here
                self.process.on_quit(self._quit_data)
        return None

    def on_loop(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Do a step of the process's loop, or of a function that it has spawned, in lock step."""
        index: int = task.val_list[0]
        wait_s = self.step(index)
        self._send_event_at(self.get_time_s() + wait_s, index)
        return None

    def step(self, index: int) -> float:
        """Do a step, and return the time to wait [s]; first report that the process works if it is its loop's."""
        if index == 0:
            self._uplink.pet()
        return self.steps[index].step()

    def _send_event_at(self, time_s: float, index: int) -> None:
        loop = self.parent.components.get(f"{self.name}{LOOP_SUFFIX}")  # there is none in a replay
        if isinstance(loop, ProcessLoop) and time_s < NEVER_S:
            loop.send_event_at(time_s, index)

    def spawn(self, function: Callable[..., Any], arguments: Mapping[str, Any]) -> None:
        """Call a function in addition to the loop: see `RoverServer.spawn_thread`."""
        steps = LoopSteps(self.name, partial(function, **arguments), repeats=False)
        self.steps.append(steps)
        if not self.parent.is_in_lock_step:
            self._threads.append(Thread(target=self._run, args=(len(self.steps) - 1,), daemon=True))
            self._threads[-1].start()
        elif isgeneratorfunction(function):
            self._send_event_at(self.get_time_s(), len(self.steps) - 1)
        else:
            raise ConfigError(
                f"{self.name} spawns {handler_name(function)}, which would block: in lock step there are no threads.",
                fix="a generator function: one that yields the seconds to wait.",
            )

    def _run(self, index: int) -> None:
        try:
            while (wait_s := self.step(index)) < NEVER_S and not self._ending.wait(wait_s):
                pass
        except BaseException as error:
            message = describe_error(error, f"in a thread of '{self.name}' at t = {self.parent.clock.now_s():.3f} s")
            self.parent.inbox.fail(ComponentFailedError(message, self.parent.name, self.name))

    def halt(self) -> None:
        """End the loop and the threads, then let the process clean up."""
        loop = self.parent.components.get(f"{self.name}{LOOP_SUFFIX}")
        if isinstance(loop, ProcessLoop):
            loop.join()
        self._ending.set()
        for thread in self._threads:
            thread.join(JOIN_TIMEOUT_S)
        try:
            for steps in self.steps:
                steps.close()
        finally:
            self._cleanup_once()

    def _cleanup_once(self) -> None:
        if not self._is_cleaned_up:
            self._is_cleaned_up = True
            self._cleanup()

    def terminate(self) -> None:
        """Note the methods that no message could reach, and the keys that no method handles."""
        if self.parent.never_ran:
            return
        kind, ever = type(self.process), self._uplink.ever
        handled = [name.removeprefix("on_") for name in dir(kind) if name.startswith("on_") and name != "on_quit"]
        for key in handled:
            if key not in ever:
                near = suggest(key, ever, "it subscribes to")
                self.parent.add_note(f"{self.name} has on_{key}, but never subscribed to '{key}'; {near}")
        if kind.message_trigger is RoverProcess.message_trigger:
            for key in sorted(ever.difference(handled)):
                near = suggest(key, handled, "it handles")
                self.parent.add_note(f"{self.name} subscribed to '{key}', but has no on_{key}; {near}")


class ProcessLoop(Loop):
    """Brings the times at which the process's loop is due into the node; on the wall clock calls it itself."""

    process: str = ""  # its name

    def begin(self) -> None:
        """Begin at once."""
        if self.parent.is_in_lock_step:
            self.send_event_at(self.get_time_s(), 0)
        else:
            super().begin()

    def send_event_at(self, time_s: float, index: int) -> None:
        """Send the event that lets the endpoint do the next step of a function, at a virtual time [s]."""
        assert isinstance(self.parent.clock, SimClock)
        self.parent.clock.call_at(time_s, partial(self.schedule, tasks.event(LOOP_EVENT, [index])))

    def loop(self) -> SomeTasks:
        """Do a step, on the loop's thread."""
        endpoint = self.parent.components[self.process]
        assert isinstance(endpoint, ProcessEndpoint)
        wait_s = endpoint.step(0)
        self.next_tick_at_s = self.get_time_s() + wait_s
        return None
