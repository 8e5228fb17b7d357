"""Lines that could have stored a page: found by the key, however the code names it."""

from functools import partial
from typing import Any

import pytest

from snr_sim import Config, Endpoint, EndpointFactory, Node, Page, SimClock, SomeTasks, Task, TaskType, tasks
from snr_sim.core.run_diagnostics import writers_of
from snr_sim.testing.function_components import FunctionEndpointFactory

KEY = "rudder"


def steers(word: str, task: Task, task_id: Any) -> SomeTasks:
    return tasks.store_page(Page("thrust", word, "r_node", 0.0))


class Pilot(Endpoint):
    OWN = "flaps"

    def __init__(self, factory: EndpointFactory, parent: Node, name: str) -> None:
        super().__init__(factory, parent, name)
        self.mine = "brake"

    def plain(self) -> Any:
        last = self.get_data("engine")
        return self.store_data_task("engine", last)

    def by_constant(self) -> Any:
        return self.store_data_task(KEY, 1)

    def by_attribute(self) -> Any:
        return self.store_data_task(self.mine, 1)

    def in_a_comprehension(self) -> Any:
        return [self.page("light", one) for one in range(3)]

    def only_reads(self) -> Any:
        return self.get_data("sonar")


def authors(key: str) -> list[tuple[str, str, str]]:
    factories = [Pilot.factory(), FunctionEndpointFactory({TaskType.event: partial(steers, "up")}, "helm")]
    node = Node("r", Config(factories={"r": factories}), clock=SimClock())
    return [(one.component, one.function, one.location.source) for one in writers_of(key, node.components.values())]


@pytest.mark.parametrize(
    ("key", "expected"),
    [
        ("engine", [("pilot", "plain", 'return self.store_data_task("engine", last)')]),
        ("rudder", [("pilot", "by_constant", "return self.store_data_task(KEY, 1)")]),
        ("brake", [("pilot", "by_attribute", "return self.store_data_task(self.mine, 1)")]),
        ("light", [("pilot", "in_a_comprehension", 'return [self.page("light", one) for one in range(3)]')]),
        ("sonar", [("pilot", "only_reads", 'return self.get_data("sonar")')]),
        ("thrust", [("helm", "steers", 'return tasks.store_page(Page("thrust", word, "r_node", 0.0))')]),
        ("nobody's", []),
    ],
)
def test_writers_of_key_returns_storing_line(key: str, expected: list[tuple[str, str, str]]) -> None:
    assert authors(key) == expected
