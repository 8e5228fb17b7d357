"""Components of a process's node: an endpoint that calls its handlers, and a loop that says when to call its `loop`.

In lock step the loop sends an event at each due time, and the endpoint's handler calls the process's `loop`: so a
replay, which makes no loops, calls it too. On the wall clock the loop calls it on a thread of its own, as it may block.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

from snr_sim.core.clocks import SimClock
from snr_sim.core.endpoint import Endpoint, EndpointFactory
from snr_sim.core.loop import Loop, LoopFactory
from snr_sim.links.link import Link
from snr_sim.prelude import tasks
from snr_sim.prelude.errors import ParameterError, suggest
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.task import SomeTasks, Task, TaskId, TaskType
from snr_sim.processes.message import LINK_PAGE, QUIT, RoverMessage
from snr_sim.processes.rover_process import ProcessSpec, RoverProcess
from snr_sim.processes.uplink import Uplink

LOOP_EVENT = "loop"
# A loop that returns None is called again after this time: no loop takes a whole core, and in lock step time advances.
MIN_WAIT_S = 0.001


class LoopSteps:
    """The process's `loop` as steps, each followed by a wait: a call of a function, or a generator up to its yield."""

    def __init__(self, process: RoverProcess) -> None:
        self._process = process
        self._generator: Iterator[float] | None = None

    def step(self) -> float:
        """Do the next step; return the time to wait after it [s].

        Raises:
            ParameterError: what the loop has returned or yielded is not a time.
        """
        waited: Any = None
        if self._generator is None:
            waited = self._process.loop()
            if isinstance(waited, Iterator):
                self._generator = waited
        if self._generator is not None:
            try:
                waited = next(self._generator)
            except StopIteration:
                self._generator = waited = None
        if waited is None:
            return MIN_WAIT_S
        if isinstance(waited, (int, float)) and 0 <= waited < math.inf:
            return max(float(waited), MIN_WAIT_S)
        verb = "returned" if self._generator is None else "yielded"
        raise ParameterError(
            f"loop() of {self._process.name} {verb} {repr(waited)[:80]}, which is not a time to wait.",
            fix="seconds, such as 0.05; or None.",
        )

    def close(self) -> None:
        """Leave the generator: its `finally` blocks are executed."""
        close = getattr(self._generator, "close", None)
        if close is not None:
            with suppress(ValueError):  # it is being executed: its thread did not end in time
                close()


class ProcessFactory(EndpointFactory):
    """Makes the endpoint of a process; `folder` is that of the run, for its log."""

    def __init__(self, spec: ProcessSpec, folder: Path | None) -> None:
        super().__init__()
        self.spec = spec
        self.folder = folder

    def get(self, parent: NodeApi) -> Endpoint:
        """Return the endpoint, with the process."""
        return ProcessEndpoint(self, parent, self.spec.name)


class ProcessEndpoint(Endpoint):
    """Calls the methods of a process, and sends what it publishes to the broker.

    Attributes:
        process: what the student has written.
        steps: of its loop.
    """

    factory: ProcessFactory
    optional_events = (LOOP_EVENT,)  # on the wall clock the loop has a thread of its own

    def __init__(self, factory: ProcessFactory, parent: NodeApi, name: str) -> None:
        super().__init__(factory, parent, name)
        spec = factory.spec
        self._uplink = Uplink(parent, name, None if factory.folder is None else factory.folder / name)
        self.process: RoverProcess = spec.kind(self._uplink)
        self.steps: LoopSteps = LoopSteps(self.process)
        self._quit_data: Any = None
        self._is_cleaned_up = False
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
        self.process.setup(self.factory.spec.args)
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
        """Let the process prepare for its end."""
        with suppress(SystemExit):  # the seed's processes end themselves here
            self.process.on_quit(self._quit_data)
        return None

    def on_loop(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Do a step of the process's loop, in lock step."""
        wait_s = self.step()
        loop = self.parent.components.get(loop_name(self.name))
        if isinstance(loop, ProcessLoop):
            loop.send_event_at(self.get_time_s() + wait_s)
        return None

    def step(self) -> float:
        """Report that the process works, do a step of its loop, and return the time to wait [s]."""
        self._uplink.pet(is_implicit=True)
        return self.steps.step()

    def halt(self) -> None:
        """End the loop, then let the process clean up."""
        loop = self.parent.components.get(loop_name(self.name))
        if isinstance(loop, ProcessLoop):
            loop.join()
        try:
            self.steps.close()
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


def loop_name(process: str) -> str:
    """Return the name of the loop of a process."""
    return f"{process}_loop"


class ProcessLoopFactory(LoopFactory):
    """Makes the loop of a process."""

    def __init__(self, process: str) -> None:
        super().__init__()
        self.process = process

    def get(self, parent: NodeApi) -> Loop:
        """Return the loop."""
        endpoint = parent.components[self.process]
        assert isinstance(endpoint, ProcessEndpoint)
        return ProcessLoop(self, parent, endpoint)


class ProcessLoop(Loop):
    """Brings the times at which the process's loop is due into the node; on the wall clock calls it itself."""

    def __init__(self, factory: LoopFactory, parent: NodeApi, endpoint: ProcessEndpoint) -> None:
        super().__init__(factory, parent, loop_name(endpoint.name))
        self._endpoint = endpoint

    def begin(self) -> None:
        """Begin at once."""
        if self.parent.is_in_lock_step:
            self.send_event_at(self.get_time_s())
        else:
            super().begin()

    def send_event_at(self, time_s: float) -> None:
        """Send the event that lets the endpoint do the next step, at a virtual time [s]."""
        assert isinstance(self.parent.clock, SimClock)
        self.parent.clock.call_at(time_s, partial(self.schedule, tasks.event(LOOP_EVENT)))

    def loop(self) -> SomeTasks:
        """Do a step, on the loop's thread."""
        wait_s = self._endpoint.step()
        self.next_tick_at_s = self.get_time_s() + wait_s
        return None
