"""Faults: arrival times for given random numbers and time; and the same class under both clocks."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from snr_sim import LinkFaults, SocketsPair, Task, TaskType
from snr_sim.links.faults import LossyChannel, UniformStream
from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.rng import rng_for
from snr_sim.testing.function_components import FunctionEndpointFactory

from .conftest import collector, simulate, ticks


def arrivals(faults: LinkFaults, count: int = 2000, seed: int = 1, every_s: float = 0.01) -> list[tuple[float, ...]]:
    channel = LossyChannel(faults, seed, "link")
    return [channel.arrivals_s(100, i * every_s) for i in range(count)]


def test_channel_without_faults_has_no_delay() -> None:
    assert arrivals(LinkFaults(), 3) == [(0.0,), (0.01,), (0.02,)]


def test_duplication_is_a_fraction_of_the_pages() -> None:
    twice = sum(len(moments) == 2 for moments in arrivals(LinkFaults(duplication=0.25)))
    assert 400 < twice < 600


def test_only_reordering_changes_the_order_of_pages() -> None:
    def overtaken(faults: LinkFaults) -> int:
        order = [moment for (moment,) in arrivals(faults)]
        return sum(later < earlier for earlier, later in pairwise(order))

    assert overtaken(LinkFaults(latency_s=0.05, jitter_s=0.1)) == 0
    assert 100 < overtaken(LinkFaults(latency_s=0.05, jitter_s=0.1, reordering=0.3)) < 600


def test_frames_sent_during_a_cut_are_lost() -> None:
    came = arrivals(LinkFaults(cut=((1.0, 2.0), (5.0, 5.5))), 1000)
    lost = [i / 100 for i, moments in enumerate(came) if not moments]
    assert lost == [i / 100 for i in range(100, 200)] + [i / 100 for i in range(500, 550)]


def test_channel_with_bandwidth_limit_is_busy_while_it_sends() -> None:
    channel = LossyChannel(LinkFaults(bandwidth_bps=8000.0), 0, "link")
    assert channel.arrivals_s(500, 0.0) == (0.5,)
    assert channel.free_s == 0.5
    assert channel.arrivals_s(500, 0.1) == (1.0,)
    assert channel.free_s == 1.0


def test_faults_use_independent_random_numbers() -> None:
    def lost(**more: float) -> list[int]:
        return [i for i, moments in enumerate(arrivals(LinkFaults(loss=0.3, latency_s=0.1, **more))) if not moments]

    assert lost() == lost(jitter_s=0.5) == lost(duplication=0.5, reordering=0.5)


def test_own_seed_overrides_the_seed_of_the_run() -> None:
    faults = LinkFaults(loss=0.5)
    assert arrivals(faults, seed=1) == arrivals(faults, seed=1) != arrivals(faults, seed=2)
    own = LinkFaults(loss=0.5, seed=7)
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
def test_invalid_faults_raise_parameter_error(numbers: dict[str, Any]) -> None:
    with pytest.raises(ParameterError, match=r"not valid for a link|cut of a link|no effect on a link"):
        LinkFaults(**numbers)


def test_cut_without_outer_parentheses_raises_error_with_fix() -> None:
    with pytest.raises(ParameterError, match=r"did you mean cut=\(\(20\.0, 25\.0\),\)\?"):
        LinkFaults(cut=(20.0, 25.0))  # type: ignore[arg-type]


def test_numpy_and_integer_numbers_are_accepted() -> None:
    numbers: dict[str, Any] = {"loss": np.float32(0.1), "bandwidth_bps": np.int64(9600), "seed": np.int64(3)}
    LinkFaults(latency_s=1, cut=[(1, float("inf"))], **numbers)  # type: ignore[arg-type]


def run_link(faults: LinkFaults, seed: int = 0, until_s: float = 20.0) -> tuple[list[Any], list[dict[str, Any]]]:
    """Send 0, 1, 2, ... at 10 Hz from a to b in lock step; return what arrived, and a's reports about the link."""
    pair = SocketsPair(("127.0.0.1", 1), name="t", faults=faults)
    came: list[Any] = []
    reports: list[dict[str, Any]] = []

    def note(task: Task, task_id: Any) -> None:
        reports.append({"t": task.val_list[0].created_at_s, **task.val_list[0].data})

    watch = FunctionEndpointFactory({(TaskType.store_page, "link_t"): note})
    roles: dict[str, list[Any]] = {"a": [ticks("x"), pair.client("x"), watch], "b": [pair.server(), collector(came)]}
    simulate(roles, seed=seed, until_s=until_s)
    return came, reports


def test_cut_takes_the_link_down_until_its_end() -> None:
    came, reports = run_link(LinkFaults(latency_s=0.02, cut=((5.0, 10.0),)))
    ups = [report["up"] for report in reports]
    downs_s = [report["t"] for report in reports if not report["up"] and report["t"] > 1]
    assert ups[-1]
    assert 7.5 < downs_s[0] < 8.2  # 3 s after the last message
    went_down = next(report for report in reports if report["t"] == downs_s[0])
    assert "nothing was heard for 3 s" in went_down["reason"]  # plain: hear
    assert came[-1] > 190
    assert came == sorted(came)
    assert not set(range(52, 95)) & set(came)


def test_lock_step_run_with_faults_depends_only_on_the_seed() -> None:
    faults = LinkFaults(latency_s=0.03, jitter_s=0.05, loss=0.2, duplication=0.1, reordering=0.2)
    assert run_link(faults) == run_link(faults)
    assert run_link(faults)[0] != run_link(faults, seed=1)[0]


def test_simulated_rtt_equals_twice_the_latency() -> None:
    _, reports = run_link(LinkFaults(latency_s=0.04), until_s=5.0)
    assert reports[-1]["rtt_s"] == pytest.approx(0.08)


@pytest.mark.slow
def test_the_same_faults_work_on_real_sockets(start: Callable[..., Any]) -> None:
    pair = SocketsPair(
        ("127.0.0.1", 0), name="t", faults=LinkFaults(latency_s=0.02, loss=0.3, duplication=0.2, reordering=0.2, seed=3)
    )
    robot = start("robot", [pair.server()], down="t")
    client = start("client", [pair.client("x")])
    assert client.until_link("t")
    for value in range(300):
        client.store("x", value)
    client.until_stored("x", 300)
    channel = client.node.components["link_t"].transport.streams[0].channel
    client.end()  # sends what is still delayed
    came = robot.stored["x"]
    robot.until_link("t", up=False)
    assert 60 < channel.lost < 120
    assert len(set(came)) == 300 - channel.lost
    assert len(came) > len(set(came))
    assert came != sorted(came)


@pytest.mark.slow
def test_the_rtt_over_real_sockets_shows_the_latency(start: Callable[..., Any]) -> None:
    pair = SocketsPair(("127.0.0.1", 0), name="t", faults=LinkFaults(latency_s=0.05))
    start("robot", [pair.server()], down="t")
    client = start("client", [pair.client("x")], up="t")
    client.until(lambda: (client.stored["link_t"][-1]["rtt_s"] or 0) >= 0.1, "rtt")


def test_uniform_stream_equals_draws_in_pairs() -> None:
    uniforms, rng = UniformStream(rng_for(5, "way")), rng_for(5, "way")
    for _ in range(600):
        assert uniforms.next_pair() == tuple(rng.random(2).tolist())
