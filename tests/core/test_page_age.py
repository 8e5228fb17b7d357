"""The age of a page by the clock of the node that has it, whichever node made it; in doubt it is old."""

import math
from typing import Any

import pytest

from snr_sim import Config, Node, Page, SimClock, tasks
from snr_sim.testing.function_components import FunctionEndpointFactory


class SetClock:
    """A wall clock that a test sets."""

    def __init__(self, time_s: float) -> None:
        self.time_s = time_s

    def now_s(self) -> float:
        return self.time_s

    def sleep_until(self, time_s: float) -> None:
        self.time_s = time_s


def node_with(*pages: Page, clock: Any) -> Node:
    """A node that has just got these pages."""
    node = Node("rov", Config(factories={"rov": [FunctionEndpointFactory()]}), clock=clock)
    node.begin()
    for page in pages:
        node.store_page(page)
    node.run_ready()
    return node


def link_page(origin: str = "rov_node", **peer: Any) -> Page:
    return Page("link_tether", {"up": True, "peers": {"topside_node": peer}}, origin, 7.0)


COMMAND = Page("controls", 1, "topside_node", 100.0)
NONSENSE: list[Any] = [
    {"peers": 5},
    {"peers": {"topside_node": 5}},
    {"peers": {"topside_node": {"clock_offset_s": "soon"}}},
    {"peers": {"topside_node": {"clock_offset_s": {}}}},
]


def test_own_page_age_equals_clock_difference() -> None:
    assert node_with(Page("depth", 1, "rov_node", 3.0), clock=SetClock(7.5)).get_age_s("depth") == 4.5


def test_virtual_clock_age_uses_origin_time() -> None:
    clock = SimClock()
    node = node_with(Page("controls", 1, "topside_node", -2.0), clock=clock)
    assert node.get_age_s("controls") == 2.0


def test_wall_clock_age_uses_clock_offset_of_link() -> None:
    node = node_with(COMMAND, link_page(clock_offset_s=-92.0), clock=SetClock(8.25))
    assert node.get_age_s("controls") == pytest.approx(0.25)


@pytest.mark.parametrize(
    "known",
    [
        [],
        [link_page()],
        [link_page(clock_offset_s=None)],
        [link_page("topside_node", clock_offset_s=-92.0)],  # the far end's own offset is not trusted
        [Page("link_tether", {"peers": {"other_node": {"clock_offset_s": -92.0}}}, "rov_node", 7.0)],
        [Page("link_tether", {"peers": {}}, "rov_node", 7.0), Page("link_x", "of the student's", "rov_node", 7.0)],
        *([Page("link_tether", nonsense, "rov_node", 7.0)] for nonsense in NONSENSE),
    ],
)
def test_page_of_unknown_clock_has_infinite_age(known: list[Page]) -> None:
    assert node_with(COMMAND, *known, clock=SetClock(8.25)).get_age_s("controls") == math.inf


def test_missing_page_has_infinite_age() -> None:
    assert node_with(clock=SetClock(8.25)).get_age_s("controls") == math.inf


def test_component_age_equals_node_age() -> None:
    ages: list[float] = []
    part = FunctionEndpointFactory(
        begin=lambda part: [ages.append(part.get_age_s("x")), part.schedule(tasks.terminate("done"))]
    )
    Node("r", Config(factories={"r": [part]})).loop()
    assert ages == [math.inf]


def test_duplicate_node_names_overestimate_age() -> None:
    peers = {"topside_node": {"clock_offset_s": 5.0}, "topside_node#2": {"clock_offset_s": -92.0}}
    state = Page("link_tether", {"peers": peers}, "rov_node", 7.0)
    node = node_with(COMMAND, Page("young", 1, "topside_node", 3.0), state, clock=SetClock(8.25))
    assert node.get_age_s("controls") == pytest.approx(0.25)
    assert node.get_age_s("young") > 90.0


@pytest.mark.parametrize("clock", [SetClock(0.0), SimClock()])
def test_page_age_is_at_least_time_since_arrival(clock: Any) -> None:
    """The program of its origin was restarted, so that clock shows less: the page seems to be from the future."""
    node = Node("rov", Config(factories={"rov": [FunctionEndpointFactory()]}), clock=clock)
    node.begin()
    node.store_page(COMMAND)
    node.store_page(link_page(clock_offset_s=-2.0))
    node.run_ready()
    assert node.get_age_s("controls") == 0.0
    if isinstance(clock, SetClock):
        clock.time_s = 1.5
    else:
        clock.call_at(1.5, lambda: None)
        clock.run_next()
    assert node.get_age_s("controls") == 1.5
    node.end()
