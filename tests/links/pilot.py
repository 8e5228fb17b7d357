"""An honest pilot, as a program: `python pilot.py PORT`. It sends a number at 50 Hz until its input ends."""

from __future__ import annotations

import itertools
import sys
import threading

import attackers

from snr_sim import Config, Node, SocketsPair, tasks
from snr_sim.testing.function_components import FunctionLoopFactory

RATE_HZ = 50.0


def main() -> None:
    """Send; at the end print how many pages were stored, sent, dropped and kept for later.

    A node that ends may still have the last number in its inbox, so the count is of stored pages.
    """
    numbers = itertools.count(1)
    pair = SocketsPair(("127.0.0.1", int(sys.argv[1])), name="t", secret=attackers.SECRET)
    ticker = FunctionLoopFactory(lambda loop: loop.store_data("stick", next(numbers)), rate_hz=RATE_HZ)
    node = Node("pilot", Config(factories={"pilot": [pair.client("stick"), ticker]}))

    def wait() -> None:
        sys.stdin.read()
        node.enqueue_input(tasks.terminate("the test is over"), "test")

    threading.Thread(target=wait, daemon=True).start()
    node.loop()
    link = node.components["link_t"]
    print(node.get_data("stick"), link.sent, link.dropped, link.transport.peers.unsent)


if __name__ == "__main__":
    main()
