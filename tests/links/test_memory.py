"""The simulated link: when pages arrive, which do, and that none circulates."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from snr_sim import Config, MemoryLink, Node, SimRunner, Task, TaskType
from snr_sim.core.runners import Link
from snr_sim.links.faults import LEAST_TRANSIT_S
from snr_sim.prelude.errors import ComponentFailed, ConfigError, ParameterError, UnknownName
from snr_sim.testing.parts import Part, PartFactory, TickerFactory
from snr_sim.testing.witness import Witness

from .conftest import simulate

Heard = list[tuple[float, Any]]


class EarFactory(PartFactory):
    """Records (time, data) of each page stored under a key."""

    def __init__(self, heard: Heard, key: str = "x") -> None:
        super().__init__(name=f"ear_{key}")
        self.heard, self.key = heard, key

    def get(self, parent: Node) -> Part:
        part = super().get(parent)

        def hear(task: Task, task_id: Any) -> None:
            self.heard.append((parent.get_time_s(), task.val_list[0].data))

        part.task_handlers = {(TaskType.store_page, self.key): hear}
        return part


def sends(values: Sequence[Any], rate_hz: float = 10.0, key: str = "x") -> TickerFactory:
    left = iter(values)

    def send(loop: Any) -> None:
        for value in left:
            loop.store_data(key, value)
            return
        loop.stop()

    return TickerFactory(send, "sender", rate_hz)


def carry(link: Link, values: Sequence[Any], rate_hz: float = 10.0, seed: int = 0) -> Heard:
    heard: Heard = []
    simulate({"a": [sends(values, rate_hz)], "b": [EarFactory(heard)]}, links=[link], seed=seed)
    return heard


def test_a_perfect_link_carries_every_page_in_the_least_time_there_is() -> None:
    least_s = LEAST_TRANSIT_S
    assert carry(MemoryLink(["x"], "a", "b"), [1, 2, 3]) == [(least_s, 1), (0.1 + least_s, 2), (0.2 + least_s, 3)]
    assert carry(MemoryLink(["x"], "a", "b", latency_s=1e-9), [1]) == [(least_s, 1)]


def test_latency_is_added_to_the_clock() -> None:
    assert carry(MemoryLink(["x"], "a", "b", latency_s=0.25), [1, 2]) == [(0.25, 1), (0.1 + 0.25, 2)]


def test_jitter_delays_within_its_bounds_and_keeps_the_order() -> None:
    for rate_hz in (1, 5, 100):
        link = MemoryLink(["x"], "a", "b", latency_s=0.1, jitter_s=0.5)
        heard = carry(link, list(range(200)), rate_hz)
        assert [value for _, value in heard] == list(range(200))
        delays = [moment_s - value / rate_hz for moment_s, value in heard]
        assert min(delays) >= 0.1 - 1e-9
        assert max(delays) <= 0.6 + 1e-9
        assert max(delays) - min(delays) > 0.15


def test_loss_is_a_share_of_the_pages_and_comes_from_the_seed() -> None:
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


def test_a_link_that_loses_everything_carries_nothing() -> None:
    link = MemoryLink(["x"], "a", "b", loss=1.0)
    assert carry(link, [1, 2, 3]) == []
    assert (link.ways[0].sent, link.ways[0].lost, link.ways[0].delivered) == (3, 3, 0)


def test_a_narrow_link_takes_its_time_for_each_byte_and_pages_queue_for_it() -> None:
    link = MemoryLink(["x"], "a", "b", bandwidth_bps=8000.0)
    heard = carry(link, [1, 1, 1], rate_hz=1000)
    arrivals = [moment_s for moment_s, _ in heard]
    gaps = [later - earlier for earlier, later in pairwise(arrivals)]
    size_bytes = arrivals[0] * 1000
    assert 60 < size_bytes < 120
    assert gaps == pytest.approx([arrivals[0]] * 2, rel=0.1)  # one page's time each, although they were sent 1 ms apart


def test_what_arrives_is_a_copy_with_the_stamp_and_origin_of_the_sender() -> None:
    data = {"pose": (1.0, float("nan")), "image": np.arange(3)}
    runner = simulate({"a": [sends([data])], "b": []}, links=[MemoryLink(["x"], "a", "b", latency_s=0.5)])
    pages = [runner.nodes[role].get_page("x") for role in "ab"]
    assert pages[0] is not None
    assert pages[1] is not None
    assert pages[1].data is not data
    assert repr(pages[1].data) == repr(data)
    assert (pages[1].origin, pages[1].created_at_s) == ("a_node", 0.0)


def test_a_page_that_no_wire_can_carry_fails_where_it_is_sent() -> None:
    with pytest.raises(ComponentFailed, match=r"cannot be brought back(.|\n)*store_page 'x'"):
        carry(MemoryLink(["x"], "a", "b"), [object()])


def test_a_page_enters_as_an_input_from_the_link() -> None:
    witness = Witness()
    simulate({"a": [sends([1])], "b": []}, links=[MemoryLink(["x"], "a", "b")], recorder=witness)
    assert [source for source, _ in witness.inputs] == ["sender", "link_a"]
    assert witness.inputs[1][1].id() == (TaskType.store_page, "x")


def test_only_the_keys_of_the_link_cross_it() -> None:
    runner = simulate({"a": [sends([1], key="y")], "b": []}, links=[MemoryLink(["x"], "a", "b")])
    assert runner.nodes["b"].datastore.pages == {}


def test_a_key_shared_both_ways_does_not_echo() -> None:
    heard_a: Heard = []
    heard_b: Heard = []
    roles = {
        "a": [sends([1, 2]), EarFactory(heard_a)],
        "b": [TickerFactory(lambda loop: (loop.store_data("x", "b"), loop.stop()), rate_hz=1), EarFactory(heard_b)],
    }
    simulate(roles, links=[MemoryLink(["x"], "a", "b", latency_s=0.01, both_ways=True)])
    assert [value for _, value in heard_a] == [1, "b", 2]
    assert [value for _, value in heard_b] == ["b", 1, 2]


@pytest.mark.parametrize("ring", [False, True])
def test_pages_pass_a_hub_or_a_ring_once(ring: bool) -> None:
    heard: dict[str, Heard] = {"a": [], "b": [], "hub": []}
    config = Config(
        factories={
            "a": [sends([1, 2]), EarFactory(heard["a"])],
            "hub": [EarFactory(heard["hub"])],
            "b": [EarFactory(heard["b"])],
        }
    )
    links = [
        MemoryLink(["x"], "a", "hub", 0.01, both_ways=not ring),
        MemoryLink(["x"], "hub", "b", 0.01, both_ways=not ring),
    ]
    if ring:
        links.append(MemoryLink(["x"], "b", "a", 0.01))
    SimRunner(config, links=links, until_s=100.0).run()
    assert {role: [value for _, value in values] for role, values in heard.items()} == {role: [1, 2] for role in heard}


def test_a_node_that_has_ended_receives_nothing_more() -> None:
    link = MemoryLink(["x"], "a", "b", latency_s=0.05)
    ends = TickerFactory(
        lambda loop: loop.get_time_s() >= 0.1 and loop.schedule(Task(TaskType.terminate, "done")), "end", 10
    )
    runner = simulate({"a": [sends([1, 2, 3, 4])], "b": [ends]}, links=[link])
    assert link.ways[0].delivered == 1
    assert runner.nodes["b"].exit_reason == "done"


def test_the_chance_of_a_link_does_not_shift_that_of_components() -> None:
    def draws(loss: float) -> list[Any]:
        noisy = TickerFactory(lambda loop: loop.store_data("x", loop.rng.random()), rate_hz=10)
        heard: Heard = []
        simulate(
            {"a": [noisy, EarFactory(heard)], "b": []}, links=[MemoryLink(["x"], "a", "b", loss=loss)], until_s=1.0
        )
        return heard

    assert draws(0.0) == draws(0.9)


@pytest.mark.parametrize(
    "numbers",
    [
        {"latency_s": -1},
        {"jitter_s": float("nan")},
        {"loss": 1.5},
        {"loss": -0.1},
        {"bandwidth_bps": 0},
        {"latency_s": float("inf")},
    ],
)
def test_a_number_out_of_range_is_refused(numbers: dict[str, float]) -> None:
    with pytest.raises(ParameterError, match=next(iter(numbers))):
        MemoryLink(["x"], "a", "b", **numbers)  # type: ignore[arg-type]


def test_mistakes_in_the_wiring_are_named() -> None:
    with pytest.raises(ConfigError, match=r"not the text 'depth'(.|\n)*\['depth'\]"):
        MemoryLink("depth", "a", "b")
    with pytest.raises(ConfigError, match="to itself"):
        MemoryLink(["x"], "a", "a")
    config = Config(factories={"robot": [], "topside": []})
    with pytest.raises(UnknownName, match=r"needs the role 'topsid'(.|\n)*did you mean 'topside'"):
        SimRunner(config, links=[MemoryLink(["x"], "robot", "topsid")])


def test_a_failure_on_the_way_out_names_the_key() -> None:
    loop: list[Any] = []
    loop.append(loop)
    with pytest.raises(ComponentFailed, match="store_page 'x'"):
        carry(MemoryLink(["x"], "a", "b"), [loop])
