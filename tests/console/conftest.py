"""A node with a console session, run by hand: no thread, no port. And one that runs on a thread, with a port."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from snr_sim import CommandReceiverFactory, Config, Mode, Node, SimClock, Task, TaskType
from snr_sim.console.commands import TABLE
from snr_sim.console.session import ConsoleSession
from snr_sim.testing.function_components import FunctionEndpointFactory, FunctionLoopFactory
from tests.on_thread import on_thread


class Talk:
    """A running node and a console's session with it."""

    def __init__(self, mode: Mode = Mode.TEST) -> None:
        self.events: list[Task] = []
        handlers = {
            (TaskType.event, "start"): self._note,
            (TaskType.reload, "part"): self._note,
            (TaskType.process_data, "depth_m"): self._note,
        }
        factories = [
            FunctionEndpointFactory(handlers),
            FunctionLoopFactory(lambda loop: loop.store_data("beat", 1), rate_hz=10.0),
        ]
        self.clock = SimClock()
        self.node = Node("urov", Config(mode, {"urov": factories}), clock=self.clock)
        self.node.begin()
        self.tick()
        self.session = ConsoleSession(self.node, TABLE)

    def _note(self, task: Task, task_id: Any) -> None:
        self.events.append(task)

    def tick(self) -> None:
        """Run the loop's next tick, which stores `beat`."""
        self.clock.run_next()
        self.settle()

    def settle(self) -> None:
        self.node.run_ready()

    def run(self, line: str) -> str:
        """Execute a command and the node's tasks that follow from it; return the answer's text."""
        answer = self.session.execute(line)
        assert not answer.is_error, answer.text
        self.settle()
        answer = self.session.outcome(0.0) or answer
        assert not self.session.is_waiting
        return answer.text

    def refused(self, line: str) -> str:
        """Send a command that is rejected and must have no effect; return the answer's text."""
        answer = self.session.execute(line)
        assert answer.is_error, answer.text
        assert not self.node.inbox.waiting
        return answer.text


@contextmanager
def running(*factories: Any, token: str | None = None, port: int = 0) -> Iterator[tuple[Node, tuple[str, int]]]:
    """Run a node with a console, on a thread of this process."""
    console = CommandReceiverFactory(port, token=token)
    part = FunctionEndpointFactory({(TaskType.event, "start"): lambda task, task_id: None})
    node = Node("urov", Config(factories={"urov": [console, part, *factories]}))
    with on_thread(node, lambda: console.port != 0):
        yield node, ("127.0.0.1", console.port)


@pytest.fixture
def talk() -> Talk:
    return Talk()
