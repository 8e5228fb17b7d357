"""Control processes: how long a barrier takes, compared with bare threads and bare pipes, and how many events pass.

A barrier is the time from the page "ending" of the reference machine, at which all end their state, until its
next page: all have answered. On the wall clock; all wait for nothing else. Run by `snr bench control_processes`.
"""

from __future__ import annotations

import multiprocessing
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
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
    """Return how long threads take to be asked, and to answer: a barrier each."""
    barrier = threading.Barrier(count + 1)

    def follow() -> None:
        with suppress(threading.BrokenBarrierError):  # the end
            while True:
                barrier.wait()

    for _ in range(count):
        threading.Thread(target=follow, daemon=True).start()
    found = []
    for _ in range(rounds):
        begun_s = time.perf_counter()
        barrier.wait()
        barrier.wait()
        found.append(1e3 * (time.perf_counter() - begun_s))
        time.sleep(0.002)
    barrier.abort()
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


def events_per_s(count: int, names: list[str], *, is_counted_only: bool = False) -> float:
    """Return how many events a second go through the queue of a reference machine that `names` follow on threads."""
    seen = [0]
    begun = [0.0]

    def note(task: Any, key: Any) -> Any:
        seen[0] += 1
        return tasks.terminate("enough") if seen[0] == count else None

    def send(loop: Any) -> None:
        begun[0] = time.perf_counter()
        loop.schedule([tasks.event("go") for _ in range(count)])
        loop.stop()

    states = dict.fromkeys(STATES, Idle)
    event = "go" if is_counted_only else "reference.transition"
    reference = [] if is_counted_only else reference_parts(STATES, "A", observers=names, stop_timeout_s=20.0)
    parts = [
        *reference,
        *(ControlProcessFactory(name, "reference", states) for name in names),
        FunctionEndpointFactory({(TaskType.event, event): note}, "watcher"),
        FunctionLoopFactory(send, "pilot", 1.0, setup=lambda loop: begin_later(loop, 0.3)),
    ]
    Node("bench", Config(factories={"bench": parts}), clock=WallClock()).loop()
    return count / (time.perf_counter() - begun[0])


def measure(is_quick: bool) -> Iterator[Row]:
    """Yield the rows."""
    count = 500 if is_quick else 3000
    counted = events_per_s(count, [], is_counted_only=True)
    for names in ([], ["p0", "p1"]):
        ours = events_per_s(count, names)
        yield Row(
            f"events through the queue, {len(names)} control processes on threads", ours, "per s", more_is_better=True,
            baseline=counted, compared_to="a handler that counts them", ratio=counted / ours,
        )  # fmt: skip
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
