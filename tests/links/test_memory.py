"""The simulated link: when pages arrive, which do, and that none circulates."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from snr_sim import Config, MemoryLink, Node, SimRunner, Task, TaskType
from snr_sim.core.runners import NodeLink
from snr_sim.links.faults import MIN_TRANSIT_S
from snr_sim.prelude.errors import ComponentFailedError, ConfigError, ParameterError, UnknownNameError
from snr_sim.testing.fake_recorder import FakeRecorder
from snr_sim.testing.function_components import FunctionEndpoint, FunctionEndpointFactory, FunctionLoopFactory

from .conftest import simulate

Received = list[tuple[float, Any]]


class CollectorFactory(FunctionEndpointFactory):
    """Records (time, data) of each page stored under a key."""

    def __init__(self, received: Received, key: str = "x") -> None:
        super().__init__(name=f"ear_{key}")
        self.received, self.key = received, key

    def get(self, parent: Node) -> FunctionEndpoint:
        part = super().get(parent)

        def record(task: Task, task_id: Any) -> None:
            self.received.append((parent.get_time_s(), task.val_list[0].data))

        part.task_handlers = {(TaskType.store_page, self.key): record}
        return part


def sends(values: Sequence[Any], rate_hz: float = 10.0, key: str = "x") -> FunctionLoopFactory:
    left = iter(values)

    def send(loop: Any) -> None:
        for value in left:
            loop.store_data(key, value)
            return
        loop.stop()

    return FunctionLoopFactory(send, "sender", rate_hz)


def carry(link: NodeLink, values: Sequence[Any], rate_hz: float = 10.0, seed: int = 0) -> Received:
    received: Received = []
    simulate({"a": [sends(values, rate_hz)], "b": [CollectorFactory(received)]}, links=[link], seed=seed)
    return received


def test_link_without_faults_has_the_minimum_transit_time() -> None:
    min_transit_s = MIN_TRANSIT_S
    assert carry(MemoryLink(["x"], "a", "b"), [1, 2, 3]) == [
        (min_transit_s, 1),
        (0.1 + min_transit_s, 2),
        (0.2 + min_transit_s, 3),
    ]
    assert carry(MemoryLink(["x"], "a", "b", latency_s=1e-9), [1]) == [(min_transit_s, 1)]


def test_latency_is_added_to_the_clock() -> None:
    assert carry(MemoryLink(["x"], "a", "b", latency_s=0.25), [1, 2]) == [(0.25, 1), (0.1 + 0.25, 2)]


def test_jitter_is_within_its_bounds_and_keeps_the_order() -> None:
    for rate_hz in (1, 5, 100):
        link = MemoryLink(["x"], "a", "b", latency_s=0.1, jitter_s=0.5)
        received = carry(link, list(range(200)), rate_hz)
        assert [value for _, value in received] == list(range(200))
        delays = [moment_s - value / rate_hz for moment_s, value in received]
        assert min(delays) >= 0.1 - 1e-9
        assert max(delays) <= 0.6 + 1e-9
        assert max(delays) - min(delays) > 0.15


def test_loss_is_a_fraction_that_depends_on_the_seed() -> None:
    def lost(seed: int, link_seed: int | None = None) -> list[Any]:
        link = MemoryLink(["x"], "a", "b", loss=0.25, seed=link_seed)
        return [value for _, value in carry(link, list(range(1000)), rate_hz=1000, seed=seed)]

    came = lost(1)
    assert 680 < len(came) < 820
    assert came == lost(1)
    assert came != lost(2)
    assert lost(1, link_seed=9) == lost(2, link_seed=9)
    assert came == sorted(came)


def test_more_jitter_does_not_change_which_pages_are_lost() -> None:
    def came(jitter_s: float) -> list[Any]:
        link = MemoryLink(["x"], "a", "b", loss=0.5, jitter_s=jitter_s)
        return [value for _, value in carry(link, list(range(100)))]

    assert came(0.0) == came(0.2)


def test_loss_of_1_delivers_nothing() -> None:
    link = MemoryLink(["x"], "a", "b", loss=1.0)
    assert carry(link, [1, 2, 3]) == []
    assert (link.directions[0].sent, link.directions[0].lost, link.directions[0].delivered) == (3, 3, 0)


def test_bandwidth_limit_delays_each_byte_and_queues_pages() -> None:
    link = MemoryLink(["x"], "a", "b", bandwidth_bps=8000.0)
    received = carry(link, [1, 1, 1], rate_hz=1000)
    arrivals = [moment_s for moment_s, _ in received]
    gaps = [later - earlier for earlier, later in pairwise(arrivals)]
    size_bytes = arrivals[0] * 1000
    assert 60 < size_bytes < 120
    assert gaps == pytest.approx([arrivals[0]] * 2, rel=0.1)  # one page's time each, although they were sent 1 ms apart


def test_delivered_page_is_a_copy_with_time_and_origin_of_the_sender() -> None:
    data = {"pose": (1.0, float("nan")), "image": np.arange(3)}
    runner = simulate({"a": [sends([data])], "b": []}, links=[MemoryLink(["x"], "a", "b", latency_s=0.5)])
    pages = [runner.nodes[role].get_page("x") for role in "ab"]
    assert pages[0] is not None
    assert pages[1] is not None
    assert pages[1].data is not data
    assert repr(pages[1].data) == repr(data)
    assert (pages[1].origin, pages[1].created_at_s) == ("a_node", 0.0)


def test_delivered_page_is_an_input_from_the_link() -> None:
    recorder = FakeRecorder()
    simulate({"a": [sends([1])], "b": []}, links=[MemoryLink(["x"], "a", "b")], recorder=recorder)
    assert [source for source, _ in recorder.inputs] == ["sender", "link_a"]
    assert recorder.inputs[1][1].id() == (TaskType.store_page, "x")


def test_link_sends_only_its_keys() -> None:
    runner = simulate({"a": [sends([1], key="y")], "b": []}, links=[MemoryLink(["x"], "a", "b")])
    assert runner.nodes["b"].datastore.pages == {}


def test_key_sent_in_both_directions_does_not_echo() -> None:
    received_a: Received = []
    received_b: Received = []
    roles = {
        "a": [sends([1, 2]), CollectorFactory(received_a)],
        "b": [
            FunctionLoopFactory(lambda loop: (loop.store_data("x", "b"), loop.stop()), rate_hz=1),
            CollectorFactory(received_b),
        ],
    }
    simulate(roles, links=[MemoryLink(["x"], "a", "b", latency_s=0.01, both_ways=True)])
    assert [value for _, value in received_a] == [1, "b", 2]
    assert [value for _, value in received_b] == ["b", 1, 2]


@pytest.mark.parametrize("ring", [False, True])
def test_pages_pass_a_hub_or_a_ring_once(ring: bool) -> None:
    received: dict[str, Received] = {"a": [], "b": [], "hub": []}
    config = Config(
        factories={
            "a": [sends([1, 2]), CollectorFactory(received["a"])],
            "hub": [CollectorFactory(received["hub"])],
            "b": [CollectorFactory(received["b"])],
        }
    )
    links = [
        MemoryLink(["x"], "a", "hub", 0.01, both_ways=not ring),
        MemoryLink(["x"], "hub", "b", 0.01, both_ways=not ring),
    ]
    if ring:
        links.append(MemoryLink(["x"], "b", "a", 0.01))
    SimRunner(config, links=links, until_s=100.0).run()
    assert {role: [value for _, value in values] for role, values in received.items()} == {
        role: [1, 2] for role in received
    }


def test_ended_node_receives_no_pages() -> None:
    link = MemoryLink(["x"], "a", "b", latency_s=0.05)
    ends = FunctionLoopFactory(
        lambda loop: loop.get_time_s() >= 0.1 and loop.schedule(Task(TaskType.terminate, "done")), "end", 10
    )
    runner = simulate({"a": [sends([1, 2, 3, 4])], "b": [ends]}, links=[link])
    assert link.directions[0].delivered == 1
    assert runner.nodes["b"].exit_reason == "done"


def test_random_numbers_of_a_link_are_independent_of_components() -> None:
    def draws(loss: float) -> list[Any]:
        noisy = FunctionLoopFactory(lambda loop: loop.store_data("x", loop.rng.random()), rate_hz=10)
        received: Received = []
        simulate(
            {"a": [noisy, CollectorFactory(received)], "b": []},
            links=[MemoryLink(["x"], "a", "b", loss=loss)],
            until_s=1.0,
        )
        return received

    assert draws(0.0) == draws(0.9)


@pytest.mark.parametrize("numbers", [{"latency_s": -1}, {"jitter_s": float("nan")}, {"loss": 2}, {"bandwidth_bps": 0}])
def test_number_out_of_range_raises_parameter_error(numbers: dict[str, float]) -> None:
    with pytest.raises(ParameterError, match=next(iter(numbers))):
        MemoryLink(["x"], "a", "b", **numbers)  # type: ignore[arg-type]


def test_invalid_keys_or_roles_raise_an_error() -> None:
    with pytest.raises(ConfigError, match=r"not the string 'depth'(.|\n)*\['depth'\]"):
        MemoryLink("depth", "a", "b")
    with pytest.raises(ConfigError, match="to itself"):
        MemoryLink(["x"], "a", "a")
    config = Config(factories={"robot": [], "topside": []})
    with pytest.raises(UnknownNameError, match=r"needs the role 'topsid'(.|\n)*did you mean 'topside'"):
        SimRunner(config, links=[MemoryLink(["x"], "robot", "topsid")])


def test_unserialisable_page_raises_error_with_its_key_at_the_sender() -> None:
    loop: list[Any] = []
    loop.append(loop)
    for data, reason in ((loop, ""), (object(), "cannot be brought back")):
        with pytest.raises(ComponentFailedError, match=rf"{reason}(.|\n)*store_page 'x'"):
            carry(MemoryLink(["x"], "a", "b"), [data])
