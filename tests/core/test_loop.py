"""A loop's rate and executor may be class attributes, and are checked when the loop is created."""

from __future__ import annotations

from typing import Any

import pytest

from snr_sim import Config, Loop, LoopFactory, Node, SimRunner, SomeTasks, tasks
from snr_sim.prelude.errors import ParameterError


class Slow(Loop):
    max_tick_rate_hz = 5

    def loop(self) -> None:
        self.store_data("ticks", (self.get_data("ticks") or 0) + 1)


class SlowInAProcess(Slow):
    executor = "process"


class LoopOf(LoopFactory):
    def __init__(self, loop_class: type[Loop], *rate: float) -> None:
        super().__init__()
        self.loop_class, self.rate = loop_class, rate

    def get(self, parent: Node) -> Loop:
        return self.loop_class(self, parent, "slow", *self.rate)


def ticks_in_two_seconds(factory: LoopFactory) -> int:
    runner = SimRunner(Config(factories={"robot": [factory]}), until_s=1.99)
    runner.run()
    return int(runner.nodes["robot"].get_data("ticks"))


@pytest.mark.parametrize("loop_class", [Slow, SlowInAProcess])
def test_a_rate_in_the_class_is_the_loops_rate(loop_class: type[Loop]) -> None:
    assert ticks_in_two_seconds(LoopOf(loop_class)) == 10


def test_a_rate_given_to_the_constructor_counts_before_the_class() -> None:
    assert ticks_in_two_seconds(LoopOf(Slow, 10.0)) == 20


@pytest.mark.parametrize("rate", [-1, float("nan"), float("inf"), "5"])
def test_a_rate_in_the_class_is_checked(rate: Any) -> None:
    wrong = type("Wrong", (Slow,), {"max_tick_rate_hz": rate})
    with pytest.raises(ParameterError, match="Loop 'slow' has max_tick_rate_hz="):
        ticks_in_two_seconds(LoopOf(wrong))


def test_unknown_executor_raises_in_lock_step_with_suggestion() -> None:
    wrong = type("Wrong", (Slow,), {"executor": "proces"})
    with pytest.raises(ParameterError, match="did you mean 'process'"):
        ticks_in_two_seconds(LoopOf(wrong))


class Remembering(Loop):
    def setup(self) -> None:
        self.store_data("calibration", {"offset_m": 0.5})

    def loop(self) -> SomeTasks:
        calibration = self.get_data("calibration")
        return tasks.terminate("nothing there" if calibration is None else f"offset {calibration['offset_m']} m")


class RememberingInAProcess(Remembering):
    executor = "process"


@pytest.mark.slow
@pytest.mark.parametrize("loop_class", [Remembering, RememberingInAProcess])
def test_first_loop_on_the_wall_clock_gets_what_setup_stored(loop_class: type[Loop]) -> None:
    node = Node("robot", Config(factories={"robot": [LoopOf(loop_class)]}))
    node.loop()
    assert node.exit_reason == "offset 0.5 m"
