"""Faults: arrival times for given random numbers and time; and the same class under both clocks."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from snr_sim import Faults, SocketsPair, Task, TaskType
from snr_sim.links.faults import Luck, Way
from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.rng import rng_for
from snr_sim.testing.parts import PartFactory

from .conftest import ear, simulate, ticks


def arrivals(faults: Faults, count: int = 2000, seed: int = 1, every_s: float = 0.01) -> list[tuple[float, ...]]:
    way = Way(faults, seed, "link")
    return [way.arrivals_s(100, i * every_s) for i in range(count)]


def test_without_faults_everything_arrives_when_it_is_sent() -> None:
    assert arrivals(Faults(), 3) == [(0.0,), (0.01,), (0.02,)]


def test_duplication_is_a_share_of_the_pages() -> None:
    twice = sum(len(moments) == 2 for moments in arrivals(Faults(duplication=0.25)))
    assert 400 < twice < 600


def test_reordering_lets_pages_be_overtaken_and_nothing_else_does() -> None:
    def overtaken(faults: Faults) -> int:
        order = [moment for (moment,) in arrivals(faults)]
        return sum(later < earlier for earlier, later in pairwise(order))

    assert overtaken(Faults(latency_s=0.05, jitter_s=0.1)) == 0
    assert 100 < overtaken(Faults(latency_s=0.05, jitter_s=0.1, reordering=0.3)) < 600


def test_nothing_that_is_sent_in_a_cut_arrives() -> None:
    came = arrivals(Faults(cut=((1.0, 2.0), (5.0, 5.5))), 1000)
    lost = [i / 100 for i, moments in enumerate(came) if not moments]
    assert lost == [i / 100 for i in range(100, 200)] + [i / 100 for i in range(500, 550)]


def test_a_narrow_way_is_busy_while_it_sends() -> None:
    way = Way(Faults(bandwidth_bps=8000.0), 0, "link")
    assert way.arrivals_s(500, 0.0) == (0.5,)
    assert not way.is_free(0.4)
    assert way.arrivals_s(500, 0.1) == (1.0,)
    assert way.is_free(1.0)


def test_more_of_one_fault_does_not_shift_the_luck_of_another() -> None:
    def lost(**more: float) -> list[int]:
        return [i for i, moments in enumerate(arrivals(Faults(loss=0.3, latency_s=0.1, **more))) if not moments]

    assert lost() == lost(jitter_s=0.5) == lost(duplication=0.5, reordering=0.5)


def test_the_seed_decides_and_a_seed_of_its_own_beats_the_runs() -> None:
    faults = Faults(loss=0.5)
    assert arrivals(faults, seed=1) == arrivals(faults, seed=1) != arrivals(faults, seed=2)
    own = Faults(loss=0.5, seed=7)
    assert arrivals(own, seed=1) == arrivals(own, seed=2)


@pytest.mark.parametrize(
    "numbers",
    [
        {"duplication": 2},
        {"reordering": -1},
        {"reordering": 0.5},
        {"loss": "x"},
        {"loss": True},
        {"loss": float("nan")},
        {"latency_s": "0.05"},
        {"latency_s": None},
        {"latency_s": 1e308},
        {"jitter_s": 10**400},
        {"bandwidth_bps": "9600"},
        {"bandwidth_bps": 1e-320},
        {"bandwidth_bps": float("nan")},
        {"seed": "x"},
        {"seed": 1.5},
        {"cut": None},
        {"cut": 5},
        {"cut": [("a", "b")]},
        {"cut": ((2.0, 1.0),)},
        {"cut": [(1.0,)]},
        {"cut": (20.0, 25.0, 30.0)},
    ],
    ids=str,
)
def test_faults_that_make_no_sense_are_refused(numbers: dict[str, Any]) -> None:
    with pytest.raises(ParameterError, match=r"link with(.|\n)*Try: "):
        Faults(**numbers)


def test_one_cut_without_the_parentheses_around_it_is_understood_and_refused() -> None:
    with pytest.raises(ParameterError, match=r"did you mean cut=\(\(20\.0, 25\.0\),\)\?"):
        Faults(cut=(20.0, 25.0))  # type: ignore[arg-type]


def test_numbers_of_numpy_and_whole_ones_are_numbers() -> None:
    Faults(latency_s=1, loss=np.float32(0.1), bandwidth_bps=np.int64(9600), seed=np.int64(3), cut=[(1, float("inf"))])  # type: ignore[arg-type]


def fly(faults: Faults, seed: int = 0, until_s: float = 20.0) -> tuple[list[Any], list[dict[str, Any]]]:
    """Send 0, 1, 2, ... at 10 Hz from a to b in lock step; return what arrived, and a's reports about the link."""
    pair = SocketsPair(("127.0.0.1", 1), name="t", faults=faults)
    came: list[Any] = []
    reports: list[dict[str, Any]] = []

    def note(task: Task, task_id: Any) -> None:
        reports.append({"t": task.val_list[0].created_at_s, **task.val_list[0].data})

    watch = PartFactory({(TaskType.store_page, "link_t"): note})
    roles: dict[str, list[Any]] = {"a": [ticks("x"), pair.client("x"), watch], "b": [pair.server(), ear(came)]}
    simulate(roles, seed=seed, until_s=until_s)
    return came, reports


def test_a_cut_takes_the_link_down_and_it_comes_back_by_itself() -> None:
    came, reports = fly(Faults(latency_s=0.02, cut=((5.0, 10.0),)))
    ups = [report["up"] for report in reports]
    downs_s = [report["t"] for report in reports if not report["up"] and report["t"] > 1]
    assert ups[-1]
    assert 7.5 < downs_s[0] < 8.2  # 3 s after the last message
    assert "nothing was heard for 3 s" in next(r["reason"] for r in reports if r["t"] == downs_s[0])
    assert came[-1] > 190
    assert came == sorted(came)
    assert not set(range(52, 95)) & set(came)


def test_a_lock_step_run_with_faults_is_the_same_again_and_another_with_another_seed() -> None:
    faults = Faults(latency_s=0.03, jitter_s=0.05, loss=0.2, duplication=0.1, reordering=0.2)
    assert fly(faults) == fly(faults)
    assert fly(faults)[0] != fly(faults, seed=1)[0]


def test_the_round_trip_time_of_a_simulated_link_is_what_was_asked_for() -> None:
    _, reports = fly(Faults(latency_s=0.04), until_s=5.0)
    assert reports[-1]["rtt_s"] == pytest.approx(0.08)


@pytest.mark.slow
def test_the_same_faults_work_on_real_sockets(start: Callable[..., Any]) -> None:
    pair = SocketsPair(
        ("127.0.0.1", 0), name="t", faults=Faults(latency_s=0.02, loss=0.3, duplication=0.2, reordering=0.2, seed=3)
    )
    robot = start("robot", [pair.server()], down="t")
    client = start("client", [pair.client("x")])
    assert client.until_link("t")
    for value in range(300):
        client.store("x", value)
    client.until_stored("x", 300)
    way = client.node.components["link_t"].transport.streams[0].way
    client.end()  # sends what is still delayed
    came = robot.stored["x"]
    robot.until_link("t", up=False)
    assert 60 < way.lost < 120
    assert len(set(came)) == 300 - way.lost
    assert len(came) > len(set(came))
    assert came != sorted(came)


@pytest.mark.slow
def test_the_rtt_over_real_sockets_shows_the_latency(start: Callable[..., Any]) -> None:
    pair = SocketsPair(("127.0.0.1", 0), name="t", faults=Faults(latency_s=0.05))
    start("robot", [pair.server()], down="t")
    client = start("client", [pair.client("x")], up="t")
    client.until(lambda: (client.stored["link_t"][-1]["rtt_s"] or 0) >= 0.1, "rtt")


def test_luck_that_is_drawn_many_at_a_time_is_the_same_as_two_by_two() -> None:
    luck, rng = Luck(rng_for(5, "way")), rng_for(5, "way")
    for _ in range(600):
        assert luck.two() == tuple(rng.random(2).tolist())
