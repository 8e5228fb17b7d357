"""Loops that are called at once when a page is stored: on the virtual clock, on a thread, in a process."""

from __future__ import annotations

import time
from typing import Any

import pytest

from snr_sim import Config, Loop, Node, Page, SimClock, TaskType, TimeoutLoopFactory, WallClock, tasks
from snr_sim.core.lockstep import LockStep
from snr_sim.core.loop import NEVER_S
from snr_sim.testing.function_components import FunctionEndpointFactory, FunctionLoopFactory


class Echo(Loop):
    """Answers page "ask" with page "answer"."""

    wakes_on = ("ask",)
    max_tick_rate_hz = 2.0

    def setup(self) -> None:
        """Begin without an answer."""
        self.seen = 0

    def loop(self) -> None:
        """Answer a new page."""
        page = self.parent.get_page("ask")
        if page is not None and page.data != self.seen:
            self.seen = page.data
            self.store_data("answer", page.data)


class EchoInProcess(Echo):
    executor = "process"


class LateEchoInProcess(EchoInProcess):
    def setup(self) -> None:
        """Begin late, as on a busy computer."""
        time.sleep(2.5)
        super().setup()


def answers(
    clock: Any, kind: type[Loop], asked: list[float], until_s: float = 3.0, *, is_one_by_one: bool = False
) -> list[tuple[float, float]]:
    """Return when each question was asked, and how long its answer took.

    Args:
        is_one_by_one: whether none is asked before the last one is answered: a process that is still starting sees the
            newest page only.
    """
    found: list[tuple[float, float]] = []
    sent: dict[int, float] = {}

    def ask(loop: Any) -> None:
        due = [time_s for time_s in asked if time_s <= loop.get_time_s() + 1e-9]
        if len(due) > len(sent) and not (is_one_by_one and len(found) < len(sent)):
            sent[len(sent) + 1] = loop.get_time_s()
            loop.store_data("ask", len(sent))
        if len(found) == len(asked):
            loop.schedule(tasks.terminate("all answered"))

    def note(task: Any, key: Any) -> None:
        at = sent[task.page.data]
        found.append((at, node.get_time_s() - at))

    factories = [
        FunctionLoopFactory(ask, "asker", 1000.0),
        kind.factory(),
        FunctionEndpointFactory({(TaskType.process_data, "answer"): note}, "watcher"),
        TimeoutLoopFactory(seconds=until_s),
    ]
    node = Node("r", Config(factories={"r": factories}), clock=clock)
    node.loop()
    return found


def test_loop_is_called_at_the_same_moment_in_lock_step() -> None:
    found = answers(SimClock(), Echo, [0.1, 0.2, 0.301, 0.302, 0.75])
    assert [round(at, 6) for at, _ in found] == [0.1, 0.2, 0.301, 0.302, 0.75]
    assert [delay for _, delay in found] == [0.0] * 5


def test_ticks_at_the_rate_stay_where_they_were() -> None:
    times = []

    class Timed(Echo):
        def loop(self) -> None:
            times.append(round(self.get_time_s(), 6))

    answers(SimClock(), Timed, [0.1, 0.2], until_s=1.6)
    assert times == [0.0, 0.1, 0.2, 0.5, 1.0, 1.5]


def test_pages_of_one_moment_cause_one_call() -> None:
    times = []

    class Timed(Echo):
        wakes_on = ("ask", "other")

        def loop(self) -> None:
            times.append(round(self.get_time_s(), 6))

    def store(loop: Any) -> None:
        if loop.get_time_s() == 0.25:
            for key in ("ask", "other", "ask", "unrelated"):
                loop.store_data(key, 1)

    clock = SimClock()
    node = Node("r", Config(factories={"r": [FunctionLoopFactory(store, "s", 4.0), Timed.factory()]}), clock=clock)
    LockStep([node], clock, until_s=0.4).run()
    assert times == [0.0, 0.25]


def test_loop_that_wakes_itself_without_end_is_reported() -> None:
    class Mad(Echo):
        def loop(self) -> None:
            self.store_data("ask", 1)

    clock = SimClock()
    node = Node("r", Config(factories={"r": [Mad.factory()]}), clock=clock)
    with pytest.raises(Exception, match=r"time|moment"):
        LockStep([node], clock, until_s=1.0).run()


def test_removed_loop_listens_no_more() -> None:
    clock = SimClock()
    node = Node("r", Config(factories={"r": [Echo.factory()]}), clock=clock)
    LockStep([node], clock, until_s=0.1).run()
    assert not any(node.datastore.listeners.values())


def moments_of(alarms: list[float | None], at_s: float) -> tuple[list[float], list[float], SimClock]:
    """Return the ticks of a loop that waits for these times in turn, and all moments; a page comes at `at_s`."""
    ticks: list[float] = []
    moments: list[float] = []

    class Waiting(Echo):
        def loop(self) -> None:
            ticks.append(self.get_time_s())
            self.next_tick_at_s = alarms[min(len(ticks), len(alarms)) - 1]

    clock = SimClock()
    clock.follow(moments.append)
    ask = TimeoutLoopFactory(at_s, task=tasks.store_page(Page("ask", 1, "r_node", 0.0)))
    node = Node("r", Config(factories={"r": [ask, Waiting.factory()]}), clock=clock)
    LockStep([node], clock).run()
    return ticks, moments, clock


def test_page_replaces_the_tick_that_a_loop_waited_for() -> None:
    ticks, moments, _ = moments_of([1.0, 0.5, NEVER_S], 0.2)
    assert ticks == [0.0, 0.2, 0.5]
    assert moments == [0.2, 0.5], "time stops no more at 1 s"


def test_loop_that_waits_for_pages_only_leaves_nothing_due() -> None:
    ticks, moments, clock = moments_of([NEVER_S], 0.2)
    assert (ticks, moments, clock.next_s) == ([0.0, 0.2], [0.2], None)


def test_tick_that_a_loop_still_waits_for_stays() -> None:
    assert moments_of([1.0, 1.0, NEVER_S], 0.2)[0] == [0.0, 0.2, 1.0]


def test_loop_that_was_idle_returns_to_the_ticks_of_its_rate() -> None:
    assert moments_of([NEVER_S, None, None, NEVER_S], 1.7)[0] == [0.0, 1.7, 2.0, 2.5]
    assert moments_of([1.5, None, NEVER_S], 1.7)[0] == [0.0, 1.5, 1.7], "a page comes before the tick at 2 s"
    assert moments_of([1.6, None, None, NEVER_S], 1.7)[0] == [0.0, 1.6, 1.7, 2.0]


@pytest.mark.slow
@pytest.mark.wall_clock
@pytest.mark.parametrize("kind", [Echo, EchoInProcess, LateEchoInProcess])
def test_answer_does_not_wait_for_a_tick(kind: type[Loop]) -> None:
    begun_s = time.monotonic()
    found = answers(WallClock(), kind, [1.0 + 0.13 * i for i in range(10)], until_s=20.0, is_one_by_one=True)
    assert len(found) == 10
    assert sorted(delay for _, delay in found)[5] < 0.02, "ticks are half a second apart"
    assert time.monotonic() - begun_s < 10.0
