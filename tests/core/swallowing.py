"""Forks children whose code swallows every interrupt, and prints how a signal ended each: `swallowing.py FOLDER`.

Each child runs a motor, which is a loop, and code that sends itself a signal and does not return. Prints one JSON
object: by kind, the exit status, the names of the loops that were halted, stderr, and the time from the signal on.
"""

import ctypes
import json
import os
import signal
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from snr_sim import Config, Loop, LoopFactory, Node, SimClock, SimRunner, SynchronousRunner, TaskType
from snr_sim.testing.function_components import FunctionEndpointFactory, FunctionLoopFactory


class MotorFactory(LoopFactory):
    def __init__(self, folder: Path, executor: Any = "thread", loops: Callable[[], None] | None = None) -> None:
        super().__init__()
        self.folder, self.executor, self.loops = folder, executor, loops

    def get(self, parent: Node) -> Loop:
        motor = Motor(self, parent, "motor", 50)
        motor.executor = self.executor
        return motor


class Motor(Loop):
    factory: MotorFactory

    def loop(self) -> None:
        self.store_data("turns", 1)
        if self.factory.loops is not None:
            self.factory.loops()

    def halt(self) -> None:
        (self.factory.folder / "halted").touch()


def swallow(depth: int = 3) -> None:
    """Swallows everything; what comes between two turns of a loop is swallowed by the loop around it."""
    while True:
        with suppress(BaseException):
            if depth:
                swallow(depth - 1)
            time.sleep(0.01)


def wait_in_c() -> None:
    """Wait in C without the interpreter's lock, for a lock that it has itself: no signal ends that."""
    lock = ctypes.create_string_buffer(64)
    libc = ctypes.CDLL(None)
    libc.pthread_mutex_lock(lock)
    libc.pthread_mutex_lock(lock)


def stuck_in(wait: Callable[..., None]) -> FunctionEndpointFactory:
    def handle(task: Any, task_id: Any) -> None:
        signal.raise_signal(signal.SIGTERM)
        wait()

    return FunctionEndpointFactory({(TaskType.process_data, "turns"): handle}, "worker")


def sends(number: int) -> FunctionEndpointFactory:
    return FunctionEndpointFactory(
        {(TaskType.process_data, "turns"): lambda task, task_id: signal.raise_signal(number)}, "sender"
    )


KINDS: dict[str, Callable[[Path], list[Any]]] = {
    "handler": lambda folder: [MotorFactory(folder), stuck_in(swallow)],
    "handler in C": lambda folder: [MotorFactory(folder), stuck_in(wait_in_c)],
    "handler, and a motor that hangs": lambda folder: [MotorFactory(folder, loops=swallow), stuck_in(swallow)],
    "handler, and a motor in a process": lambda folder: [MotorFactory(folder, "process"), stuck_in(swallow)],
    "begin": lambda folder: [
        MotorFactory(folder),
        FunctionEndpointFactory(name="worker", begin=lambda part: (signal.raise_signal(signal.SIGTERM), swallow())),
    ],
    "halt": lambda folder: [
        FunctionEndpointFactory(name="worker", halt=lambda part: swallow()),
        MotorFactory(folder),
        sends(signal.SIGINT),
    ],
    "lock step": lambda folder: [MotorFactory(folder), stuck_in(swallow)],
    "lock step, another loop": lambda folder: [
        MotorFactory(folder),
        FunctionLoopFactory(lambda loop: (signal.raise_signal(signal.SIGINT), swallow()), "worker", 50),
    ],
}


def run_child(kind: str, folder: Path) -> None:
    os.dup2(os.open(folder / "err", os.O_WRONLY | os.O_CREAT), 2)
    config = Config(factories={"r": KINDS[kind](folder)})
    if kind.startswith("lock step"):
        SimRunner(config, clock=SimClock(), pace=1.0).run()
    else:
        SynchronousRunner("r", config).run()


def main(place: Path) -> None:
    """Run all kinds at once: they wait."""
    begun_s, pids = time.monotonic(), {}
    for kind in KINDS:
        (place / kind).mkdir()
        pids[kind] = os.fork()
        if pids[kind] == 0:
            try:
                run_child(kind, place / kind)
            finally:
                os._exit(0)
    rows: dict[str, Any] = {}
    while len(rows) < len(pids):
        time.sleep(0.02)
        for kind in pids.keys() - rows.keys():
            pid, status = os.waitpid(pids[kind], os.WNOHANG)
            took_s = time.monotonic() - begun_s
            if not pid and took_s > 60.0:
                os.kill(pids[kind], signal.SIGKILL)
            elif pid:
                folder = place / kind
                rows[kind] = {
                    "status": os.waitstatus_to_exitcode(status),
                    "is_halted": (folder / "halted").exists(),
                    "err": (folder / "err").read_text(),
                    "took_s": took_s,
                }
    print(json.dumps(rows))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
