"""A node that runs on a thread of this process, beside its test; and a wait for what it does there."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from snr_sim import Node, tasks

TIMEOUT_S = 60.0  # an upper limit for a very busy machine; usually no test waits this long


def wait_for(what: Callable[[], Any]) -> Any:
    """Return the first true value of a function."""
    until_s = time.monotonic() + TIMEOUT_S
    while not (found := what()):
        assert time.monotonic() < until_s, "timeout"
        time.sleep(0.005)
    return found


@contextmanager
def on_thread(node: Node, is_ready: Callable[[], bool]) -> Iterator[None]:
    """Run a node until the block ends; it must run until then."""
    failure: list[BaseException] = []

    def run() -> None:
        try:
            node.loop()
        except BaseException as error:
            failure.append(error)

    thread = threading.Thread(target=run)
    thread.start()
    try:
        wait_for(lambda: is_ready() or failure)
        yield
        assert not node.is_finished or node.exit_reason == "asked", f"the node has ended: {node.exit_reason}"
    finally:
        node.enqueue_input(tasks.terminate("test"), "test")
        thread.join(TIMEOUT_S)
    assert not failure, failure
    assert not thread.is_alive()
