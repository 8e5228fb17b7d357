"""Loops for tests of processes, in a module of their own: a child process imports their code by name."""

import os
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

from snr_sim import FakeActuator, Loop, LoopFactory, Node, Page, tasks
from snr_sim.devices.commands import ActuatorLoop, ActuatorLoopFactory
from snr_sim.prelude.signals import EngineCommand


class StepsFactory(LoopFactory):
    """Makes a loop of functions of this file; what it is given besides they find in `loop.factory.given`."""

    def __init__(
        self,
        loop: Callable[[Any], Any],
        *given: Any,
        name: str = "worker",
        rate_hz: float = 100.0,
        setup: Callable[[Any], Any] | None = None,
        halt: Callable[[Any], Any] | None = None,
        terminate: Callable[[Any], Any] | None = None,
        executor: Literal["thread", "process"] = "process",
    ) -> None:
        super().__init__(sys.modules[__name__])  # a module among a factory's attributes
        self.steps = {"loop": loop, "setup": setup, "halt": halt, "terminate": terminate}
        self.given, self.name, self.rate_hz, self.executor = given, name, rate_hz, executor

    def get(self, parent: Node) -> Loop:
        return Steps(self, parent, self.name, self.rate_hz)


class GatedFactory(StepsFactory):
    """Its process reaches `begin` only when the test opens the other end of a pipe."""

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        Path(self.given[1]).read_text()


class Steps(Loop):
    factory: StepsFactory

    def __init__(self, factory: StepsFactory, parent: Node, name: str, rate_hz: float) -> None:
        super().__init__(factory, parent, name, rate_hz)
        self.executor = factory.executor
        self.count = 0

    def step(self, name: str) -> None:
        function = self.factory.steps[name]
        if function is not None:
            function(self)

    def setup(self) -> None:
        self.step("setup")

    def loop(self) -> None:
        self.count += 1
        self.step("loop")

    def halt(self) -> None:
        self.step("halt")

    def terminate(self) -> None:
        self.step("terminate")


def report_position(loop: Any) -> None:
    loop.store_data("where", {"pid": os.getpid(), "time_s": loop.get_time_s(), "role": loop.parent.role})
    loop.schedule(tasks.terminate("said"))


def nothing(loop: Any) -> None:
    pass


def end(loop: Any) -> None:
    loop.schedule(tasks.terminate("end"))


def note_thread(loop: Any) -> None:
    loop.store_data("count", loop.count)
    if loop.count == 5:
        loop.stop()


def raise_error(loop: Any) -> None:
    raise ValueError("no echo")


def exit_python(loop: Any) -> None:
    sys.exit(3)


def exit_at_once(loop: Any) -> None:
    print("bus voltage 9.1 V", file=sys.stderr, flush=True)
    os._exit(3)


def kill_itself(loop: Any) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def read_nowhere(loop: Any) -> None:
    import ctypes

    ctypes.string_at(0)


def hang(loop: Any) -> None:
    loop.store_data("pid", os.getpid())
    while True:
        time.sleep(60)


def hang_in_c(loop: Any) -> None:
    """Holds the interpreter lock and never returns."""
    import ctypes

    loop.store_data("pid", os.getpid())
    ctypes.PyDLL(None).pause()
    ctypes.PyDLL(None).pause()


def write(loop: Any, word: str) -> None:
    with open(loop.factory.given[0], "a") as file:
        file.write(f"{word} {os.getpid()}\n")


def write_halt(loop: Any) -> None:
    write(loop, "halt")


def write_terminate(loop: Any) -> None:
    write(loop, "terminate")


def store_pid(loop: Any) -> None:
    loop.get_data("question")
    loop.store_data("pid", os.getpid())


def ask_for_seven(loop: Any) -> None:
    loop.store_data("answer", "none" if loop.get_page(7) is None else "some")
    end(loop)


class Frame:
    pass


def store_object(loop: Any) -> None:
    loop.store_data("frame", Frame())


def store_array(loop: Any) -> None:
    import numpy as np

    for i in range(20):
        loop.store_data(f"frame{i}", {"image": np.full((300, 200, 3), i, np.uint8), "small": np.array([0.5, i])})
    loop.schedule(tasks.terminate("stored"))


def answer(loop: Any) -> None:
    data = loop.get_data("question")
    if data is not None and loop.get_data("question_prev") is not None:
        loop.store_data("answer", {"sum": float(data.sum()), "before": float(loop.get_data("question_prev").sum())})


def echo(loop: Any) -> None:
    page = loop.get_page("question")
    if page is not None and page is not vars(loop).get("page_before"):
        loop.page_before = page
        loop.store_data("echo", page.data)


def log_something(loop: Any) -> None:
    loop.log.warning("lens %s", "dirty")
    end(loop)


def start_another(loop: Any) -> None:
    """Forks a process that keeps open whatever this one has open."""
    pid = os.fork()
    if pid == 0:
        time.sleep(60)
        os._exit(0)
    with open(loop.factory.given[0], "w") as file:
        file.write(str(pid))  # not a page: what was stored a moment before a kill may be lost
    os.kill(os.getpid(), signal.SIGKILL)


def store_name(loop: Any) -> None:
    loop.store_data(loop.name, loop.count)


def rest(loop: Any) -> None:
    with open(loop.factory.given[0], "a") as file:
        file.write(f"{time.monotonic()}\n")
    time.sleep(0.25)


class EngineFactory(ActuatorLoopFactory):
    """Makes the actuator of an engine, whose page `written` has the newest command that it took."""

    def __init__(self, executor: Literal["thread", "process"]) -> None:
        super().__init__("engine", open_engine, 100.0, timeout_s=60.0)
        self.executor = executor

    def get(self, parent: Node) -> Any:
        loop = Engine(self, parent, "engine_actuator", self.rate_hz)
        loop.executor = self.executor
        return loop


class Engine(ActuatorLoop):
    def _write(self, page: Page) -> None:
        super()._write(page)
        self.store_data("written", page.data)


def open_engine() -> FakeActuator[EngineCommand]:
    return FakeActuator(EngineCommand, {"throttle": (0.0, 1.0)})
