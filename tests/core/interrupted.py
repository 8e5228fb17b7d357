"""Forks children that run a node each, interrupts each at a random moment, and prints how they ended.

A program of its own, so that the children are forked from a process that has no threads and nothing of pytest in it:
`python interrupted.py COUNT SEED`. Prints one JSON object: for each child its kind, signal, what it wrote, the time
from the signal to its end, and its exit status.
"""

import json
import os
import random
import select
import signal
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from snr_sim import Config, SimClock, SimRunner, SynchronousRunner, TaskType, tasks
from snr_sim.core.interrupts import RunInterrupted
from snr_sim.testing.function_components import FunctionEndpointFactory, FunctionLoopFactory

AT_ONCE = 4
GIVE_UP_S = 40.0


def doze(*args: Any) -> None:
    time.sleep(60)


def spin(*args: Any) -> None:
    while True:
        pass


def stubborn(*args: Any) -> None:
    """A handler of a student who catches every exception."""
    while True:
        with suppress(Exception):
            time.sleep(0.005)


def handles(function: Callable[..., Any]) -> FunctionEndpointFactory:
    return FunctionEndpointFactory(
        {TaskType.event: function}, "worker", begin=lambda part: part.schedule(tasks.event("work"))
    )


THREADS = [
    FunctionLoopFactory(lambda loop: loop.store_data("x", 1), f"loop{i}", rate)
    for i, rate in enumerate((0.5, 50, 1000))
]
KINDS: dict[str, list[Any]] = {
    "idle": [],
    "loops on threads": THREADS,
    "busy without end": [handles(lambda task, task_id: task)],
    "busy, with threads": [*THREADS, handles(lambda task, task_id: task)],
    "sleeps in a handler": [handles(doze)],
    "spins in a handler": [handles(spin)],
    "swallows exceptions": [handles(stubborn)],
    "loop sleeps": [FunctionLoopFactory(doze, "sleeper"), *THREADS],
    "loop spins": [FunctionLoopFactory(spin, "spinner")],
    "sleeps in begin": [FunctionEndpointFactory(name="beginner", begin=doze)],
    "slow to begin and end": [
        FunctionLoopFactory(name="slow", setup=lambda loop: time.sleep(0.1), halt=lambda loop: time.sleep(0.05))
    ],
    "halt sleeps": [FunctionEndpointFactory(name="sleeper", halt=doze), *THREADS],
    "in lock step": [FunctionLoopFactory(lambda loop: loop.store_data("x", 1), "ticker", 1000)],
    "in lock step, paced": [FunctionLoopFactory(lambda loop: loop.store_data("x", 1), "ticker", 20)],
    "in lock step, loop spins": [FunctionLoopFactory(spin, "spinner")],
}


def run_child(kind: str, out: int) -> None:
    """Run a node; write h and t when its first component is halted and terminated, e when all is over."""
    motor = FunctionEndpointFactory(
        name="motor",
        begin=lambda part: os.write(out, b"b"),
        halt=lambda part: os.write(out, b"h"),
        terminate=lambda part: os.write(out, b"t"),
    )
    config = Config(factories={"r": [motor, *KINDS[kind]]})
    try:
        if kind.startswith("in lock step"):
            SimRunner(config, clock=SimClock(), pace=1.0 if "paced" in kind else None).run()
        else:
            SynchronousRunner("r", config).run()
        os.write(out, b"e")
    except RunInterrupted:
        os.write(out, b"i")
    os.close(out)


class Child:
    def __init__(self, kind: str, number: int, after_s: float, again_s: float | None) -> None:
        self.kind, self.number = kind, number
        self.read_from, write_to = os.pipe()
        self.wrote = b""
        self.signalled_s: float | None = None
        self.result: dict[str, Any] | None = None
        self.pid = os.fork()
        if self.pid == 0:
            os.close(self.read_from)
            os.dup2(os.open(os.devnull, os.O_WRONLY), 2)  # notes about hung loops are not what is looked at here
            status = 1
            try:
                run_child(kind, write_to)
                status = 0
            finally:
                os._exit(status)
        os.close(write_to)
        self.due_s = [time.monotonic() + after_s]
        if again_s is not None:
            self.due_s.append(self.due_s[0] + again_s)

    def look(self) -> bool:
        """Send due signals and read available output; return whether the child has ended."""
        now_s = time.monotonic()
        if select.select([self.read_from], [], [], 0)[0]:
            self.wrote += os.read(self.read_from, 100)
        # Not before the runner has taken over: until then Ctrl-C ends a Python program as it always does.
        if self.due_s and now_s >= self.due_s[0] and self.wrote:
            self.due_s.pop(0)
            os.kill(self.pid, self.number)
            self.signalled_s = self.signalled_s or now_s
        pid, status = os.waitpid(self.pid, os.WNOHANG)
        if pid:
            while more := os.read(self.read_from, 100):
                self.wrote += more
            os.close(self.read_from)
            took_s = now_s - (self.signalled_s or now_s)
            self.result = self.report(took_s, os.waitstatus_to_exitcode(status))
        elif self.signalled_s is not None and now_s - self.signalled_s > GIVE_UP_S:
            os.kill(self.pid, signal.SIGKILL)
            os.waitpid(self.pid, 0)
            self.result = self.report(now_s - self.signalled_s, None)
        return self.result is not None

    def report(self, took_s: float, status: int | None) -> dict[str, Any]:
        name = signal.Signals(self.number).name
        return {"kind": self.kind, "signal": name, "wrote": self.wrote.decode(), "took_s": took_s, "status": status}


def main(count: int, seed: int) -> None:
    chance = random.Random(seed)
    kinds = [list(KINDS)[i % len(KINDS)] for i in range(count)]
    children: list[Child] = []
    results: list[dict[str, Any]] = []
    while kinds or children:
        while kinds and len(children) < AT_ONCE:
            number = chance.choice([signal.SIGINT, signal.SIGTERM])
            again_s = chance.choice([None, None, chance.uniform(0.0, 0.01), chance.uniform(0.0, 0.4)])
            children.append(Child(kinds.pop(), number, chance.choice([0.0, chance.uniform(0.0, 0.15)]), again_s))
        for child in list(children):
            if child.look():
                children.remove(child)
                assert child.result is not None
                results.append(child.result)
        time.sleep(0.001)
    print(json.dumps(results))


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
