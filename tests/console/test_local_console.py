"""The console in the node's own terminal; here a pipe replaces the keyboard."""

import io
import os
import time
from collections.abc import Iterator
from typing import IO

import pytest

from snr_sim import (
    Config,
    LocalConsoleFactory,
    Node,
    SimClock,
    SimRunner,
    TaskType,
    TimeoutLoopFactory,
    WallClock,
    tasks,
)
from snr_sim.prelude.clock import Clock
from snr_sim.testing.function_components import FunctionEndpointFactory, FunctionLoopFactory

pytestmark = pytest.mark.slow


@pytest.fixture
def keyboard() -> Iterator[tuple[IO[str], IO[str]]]:
    """Provide the two ends of a pipe: the reading and the typing one."""
    out, into = os.pipe()
    with os.fdopen(out) as reads, os.fdopen(into, "w", buffering=1) as types:
        yield reads, types


@pytest.mark.parametrize("clock", [WallClock, None])
def test_typed_command_is_executed_and_answered(keyboard: tuple[IO[str], IO[str]], clock: type[Clock] | None) -> None:
    reads, types = keyboard
    screen = io.StringIO()
    types.write("stroe\n\nwatch depth_m\nstore depth_m 2.5\nexit surfac")
    console = LocalConsoleFactory(reads, screen)
    rest = FunctionEndpointFactory(
        {(TaskType.process_data, "depth_m"): lambda task, task_id: types.write("ed\n") and None}
    )
    config = Config(factories={"r": [console, rest, FunctionLoopFactory(rate_hz=50.0)]})
    if clock is not None:
        node = Node("r", config, clock=clock())
        node.loop()
    else:  # in lock step at real-time speed
        runner = SimRunner(config, pace=1.0, until_s=30.0)
        runner.run()
        node = runner.nodes["r"]
    assert node.exit_reason == "surfaced"
    output = screen.getvalue()
    assert "did you mean 'store'" in output
    assert "Nothing has stored a page 'depth_m'" in output
    assert "depth_m = 2.5 is stored" in output


def test_node_ends_at_once_without_typed_input(keyboard: tuple[IO[str], IO[str]]) -> None:
    config = Config(factories={"r": [LocalConsoleFactory(keyboard[0]), TimeoutLoopFactory(ms=10)]})
    node = Node("r", config)
    start_s = time.monotonic()
    node.loop()
    assert time.monotonic() - start_s < 1.0
    assert node.notes == []


def test_end_of_input_ends_the_console_and_not_the_node(keyboard: tuple[IO[str], IO[str]]) -> None:
    reads, types = keyboard
    types.close()
    closed = FunctionLoopFactory(
        lambda ticker: (
            ticker.schedule(tasks.terminate("console is over"))
            if ticker.parent.components["local_console"].is_terminated()
            else None
        )
    )
    node = Node("r", Config(factories={"r": [LocalConsoleFactory(reads, io.StringIO()), closed]}))
    node.loop()
    assert node.exit_reason == "console is over"


def test_commands_from_a_file_are_executed_in_order(keyboard: tuple[IO[str], IO[str]]) -> None:
    reads, types = keyboard
    types.write("store depth_m 2.5\ndump depth_m\nexit read")
    types.close()
    screen = io.StringIO()
    node = Node("r", Config(factories={"r": [LocalConsoleFactory(reads, screen)]}))
    node.loop()
    assert node.exit_reason == "read"
    assert "depth_m = 2.5  (" in screen.getvalue()


def test_node_runs_without_a_terminal() -> None:
    config = Config(factories={"r": [LocalConsoleFactory(io.StringIO("exit\n")), TimeoutLoopFactory(ms=20)]})
    node = Node("r", config)
    node.loop()
    assert node.exit_reason == "timeout"


def test_local_console_in_lock_step_adds_no_moments() -> None:
    with open(os.devnull) as nothing:
        config = Config(factories={"r": [LocalConsoleFactory(nothing), TimeoutLoopFactory(seconds=3)]})
        clock = SimClock()
        node = Node("r", config, clock=clock)
        node.begin()
        assert clock.next_s == 3.0
        node.end()
