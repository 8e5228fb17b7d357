"""Control processes: how long a barrier takes, compared with bare threads and bare pipes.

A barrier is the time from the page "ending" of the reference machine, at which all end their state, until its
next page: all have answered. On the wall clock; all wait for nothing else. Run by `snr bench control_processes`.
"""

from __future__ import annotations

import multiprocessing
import threading
import time
from collections.abc import Iterator
from multiprocessing.connection import Connection
from statistics import median
from typing import Any, Literal

from harness import Row

from snr_sim import Config, Node, TaskType, WallClock, tasks
from snr_sim.behaviors.flow import wait
from snr_sim.behaviors.processes import ControlProcessFactory, ObserverState, reference_parts
from snr_sim.testing.function_components import FunctionEndpointFactory, FunctionLoopFactory

STATES = {"A": {"go": "B"}, "B": {"go": "A"}}
LIMITS_MS = {("thread", 2): 0.1, ("thread", 8): 0.3, ("process", 2): 0.4, ("process", 8): 3.0}


class Idle(ObserverState):
    """Waits."""

    def run_state(self) -> Any:
        """Wait."""
        yield wait(1000.0)


def barriers_ms(count: int, executor: Literal["thread", "process"], rounds: int) -> list[float]:
    """Return how long each barrier took [ms]."""
    found: list[float] = []
    begun = [0.0]

    def on_page(task: Any, key: Any) -> Any:
        if task.page.data["phase"] == "ending":
            begun[0] = time.perf_counter()
        elif task.page.data["epoch"] > 1:
            found.append(1e3 * (time.perf_counter() - begun[0]))
        return tasks.terminate("enough") if len(found) >= rounds else None

    names = [f"p{i}" for i in range(count)]
    states = dict.fromkeys(STATES, Idle)
    first_s = 3.0 if executor == "process" else 0.3  # until all have started
    go = FunctionLoopFactory(
        lambda loop: loop.schedule(tasks.event("go")), "pilot", 100.0, setup=lambda loop: begin_later(loop, first_s)
    )
    parts = [
        *reference_parts(STATES, "A", observers=names, stop_timeout_s=20.0),
        *(ControlProcessFactory(name, "reference", states, executor=executor) for name in names),
        FunctionEndpointFactory({(TaskType.process_data, "reference"): on_page}, "watcher"),
        go,
    ]
    Node("bench", Config(factories={"bench": parts}), clock=WallClock()).loop()
    return found[len(found) // 10 :]


def begin_later(loop: Any, time_s: float) -> None:
    """Let the first tick of a loop be later."""
    loop.first_tick_after_s = time_s


def bare_threads_ms(count: int, rounds: int) -> list[float]:
    """Return how long threads take to be asked, and to answer."""
    asked = [threading.Event() for _ in range(count)]
    answers = threading.Semaphore(0)
    is_over = threading.Event()

    def follow(own: threading.Event) -> None:
        while True:
            own.wait()
            own.clear()
            if is_over.is_set():
                return
            answers.release()

    threads = [threading.Thread(target=follow, args=(one,), daemon=True) for one in asked]
    for one in threads:
        one.start()
    found = []
    for _ in range(rounds):
        begun_s = time.perf_counter()
        for own in asked:
            own.set()
        for _ in asked:
            answers.acquire()
        found.append(1e3 * (time.perf_counter() - begun_s))
        time.sleep(0.002)
    is_over.set()
    for own in asked:
        own.set()
    return found


def answer(line: Connection) -> None:
    """Answer each byte with a byte."""
    while (data := line.recv_bytes()) != b"over":
        line.send_bytes(data)


def bare_pipes_ms(count: int, rounds: int) -> list[float]:
    """Return how long processes take to be asked over pipes, and to answer."""
    context = multiprocessing.get_context("fork")
    lines, children = [], []
    for _ in range(count):
        ours, theirs = context.Pipe()
        lines.append(ours)
        children.append(context.Process(target=answer, args=(theirs,), daemon=True))
        children[-1].start()
    found = []
    for _ in range(rounds):
        begun_s = time.perf_counter()
        for line in lines:
            line.send_bytes(b"x")
        for line in lines:
            line.recv_bytes()
        found.append(1e3 * (time.perf_counter() - begun_s))
        time.sleep(0.002)
    for line, child in zip(lines, children, strict=True):
        line.send_bytes(b"over")
        child.join()
    return found


def measure(is_quick: bool) -> Iterator[Row]:
    """Yield the rows."""
    rounds = 60 if is_quick else 300
    for (executor, count), limit_ms in LIMITS_MS.items():
        bare = (bare_threads_ms if executor == "thread" else bare_pipes_ms)(count, rounds)
        ours = sorted(barriers_ms(count, executor, rounds))  # type: ignore[arg-type]
        late_ms = ours[int(0.95 * len(ours))]
        compared = "bare threads" if executor == "thread" else "bare pipes"
        kind = "on threads" if executor == "thread" else "in processes"
        yield Row(
            f"a barrier of {count} control processes {kind}", median(ours), "ms", limit=limit_ms,
            baseline=median(bare), compared_to=compared, ratio=median(ours) / median(bare),
            note=f"95 of 100 within {late_ms:.2f} ms",
        )  # fmt: skip
        yield Row(f"the same, 95 of 100 of {count} {kind}", late_ms, "ms", limit=3.0 * limit_ms)
