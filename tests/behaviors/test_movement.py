"""The movement server: requests that begin together and end at their own times."""

from __future__ import annotations

from collections.abc import Generator
from itertools import pairwise
from typing import Any

import pytest

from snr_sim import Config, Node, SimClock, TaskType, TimeoutLoopFactory, tasks
from snr_sim.behaviors.flow import movement_parts, wait
from snr_sim.behaviors.processes import ControlProcessFactory, ObserverState, reference_parts
from snr_sim.core.lockstep import LockStep
from snr_sim.testing.function_components import FunctionEndpointFactory

REQUESTS = ("grab", "turn", "move", "lift")
FOUR = {"grab": [1.0, 0.5], "turn": [-0.4, 1.0], "move": [0.2, 1.5], "lift": [2, 0.25]}


class Lab:
    """A movement server whose motors are its requests; when they change, and how goals end."""

    def __init__(self, *more: Any, until_s: float = 5.0) -> None:
        self.stored: list[tuple[float, dict[str, float]]] = []
        self.ended: list[tuple[float, str]] = []
        watcher = FunctionEndpointFactory(
            {(TaskType.process_data, "motors"): self._note_page, (TaskType.event, "move.done"): self._note_end}, "w"
        )
        clock = SimClock()
        server = movement_parts(REQUESTS, lambda magnitudes: {"motors": dict(magnitudes)})
        self.node = Node("r", Config(factories={"r": [*more, *server, watcher]}), clock=clock)
        LockStep([self.node], clock, until_s=until_s).run()

    def _note_page(self, task: Any, key: Any) -> None:
        self.stored.append((round(self.node.get_time_s(), 6), task.page.data))

    def _note_end(self, task: Any, key: Any) -> None:
        self.ended.append((round(self.node.get_time_s(), 6), task.val_list[0]))

    @property
    def changes(self) -> list[tuple[float, dict[str, float]]]:
        return [new for old, new in pairwise([(0.0, {}), *self.stored]) if new[1] != old[1]]


def start_at(time_s: float, goal: Any) -> TimeoutLoopFactory:
    return TimeoutLoopFactory(time_s, task=tasks.event("move.start", [{"goal": goal}]), name=f"at {time_s}")


def test_four_requests_begin_together_and_each_ends_at_its_time() -> None:
    lab = Lab(start_at(1.0, FOUR))
    assert lab.changes == [
        (1.0, {"grab": 1.0, "turn": -0.4, "move": 0.2, "lift": 2}),
        (1.25, {"grab": 1.0, "turn": -0.4, "move": 0.2, "lift": 0.0}),
        (1.5, {"grab": 0.0, "turn": -0.4, "move": 0.2, "lift": 0.0}),
        (2.0, {"grab": 0.0, "turn": 0.0, "move": 0.2, "lift": 0.0}),
        (2.5, {"grab": 0.0, "turn": 0.0, "move": 0.0, "lift": 0.0}),
    ]
    assert lab.ended == [(0.0, "reached"), (2.5, "reached")]
    times = [time_s for time_s, _ in lab.stored]
    assert len(set(times)) == len(times), "one command for all requests at a moment"
    assert max(new - old for old, new in pairwise(times)) < 0.1001, "or actuators would stop"


def test_request_of_no_duration_is_noted_and_does_nothing() -> None:
    lab = Lab(start_at(1.0, {"grab": [1.0, 0.0], "turn": [0.4, 0.3]}))
    assert [data["grab"] for _, data in lab.stored if data["grab"]] == []
    assert lab.ended[1:] == [(1.3, "reached")]
    assert any("'grab' lasts 0 s, and does nothing" in note for note in lab.node.notes)


@pytest.mark.parametrize(
    ("goal", "problem"),
    [
        ({"trun": [0.4, 1.0]}, "there is no request 'trun': did you mean 'turn'?"),
        ({"turn": 0.4}, "'turn' is 0.4"),
        ({"turn": [0.4]}, "'turn' is (0.4,)"),
        ({"turn": [0.4, -1.0]}, "a duration of 0 s or more"),
        ({"turn": [float("nan"), 1.0]}, "a magnitude"),
        ({"turn": ["fast", 1.0], "move": [0.2, 1.0]}, "'turn' is ('fast', 1.0)"),
        ([0.4, 1.0], "is not a dict"),
    ],
)
def test_malformed_goal_is_rejected_and_moves_nothing(goal: Any, problem: str) -> None:
    lab = Lab(start_at(1.0, goal))
    assert (lab.stored, lab.ended[1:]) == ([], [(1.0, "rejected")])
    assert any(problem in note for note in lab.node.notes), lab.node.notes


def test_preempted_movement_stops_all_motors_at_once() -> None:
    lab = Lab(start_at(1.0, FOUR), TimeoutLoopFactory(1.1, task=tasks.event("move.preempt")), start_at(2.0, FOUR))
    assert lab.ended == [(0.0, "reached"), (1.1, "preempted"), (3.5, "reached")]
    assert [set(data.values()) for time_s, data in lab.stored if 1.1 <= time_s < 2.0][-1] == {0.0}


class Mover(ObserverState):
    """Moves, and stores whether it has reached its goal."""

    def run_state(self) -> Generator[Any, None, None]:
        is_reached = yield from self.move(**(FOUR if self.name == "A" else {"trun": (1.0, 1.0)}))
        self.store_data(f"{self.parent.name}.reached", [self.name, round(self.get_time_s(), 2), is_reached])
        yield wait(100.0)


def moving(*names: str) -> list[Any]:
    states = {"A": {"next": "B"}, "B": {"next": "A"}}
    made = [ControlProcessFactory(name, "reference", dict.fromkeys(states, Mover)) for name in names]
    return [*reference_parts(states, observers=names), *made]


def test_state_of_a_control_process_waits_for_its_movement() -> None:
    lab = Lab(*moving("P"))
    assert lab.node.get_data("P.reached") == ["A", pytest.approx(1.5, abs=0.011), True]


def test_movement_ends_with_its_state_and_rejected_one_is_not_reached() -> None:
    lab = Lab(*moving("P"), TimeoutLoopFactory(0.6, task=tasks.event("next")))
    assert lab.ended[1:] == [(0.6, "preempted"), (0.6, "rejected")]
    assert set(lab.stored[-1][1].values()) == {0.0}
    assert lab.node.get_data("P.reached")[::2] == ["B", False]


def test_movement_of_another_process_continues() -> None:
    lab = Lab(*moving("P", "Q"), until_s=3.0)
    assert [lab.node.get_data(f"{name}.reached")[2] for name in "PQ"] == [True, False]
    assert lab.ended[1:] == [(1.5, "reached")]
