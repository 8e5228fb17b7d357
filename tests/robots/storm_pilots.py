"""Pilots of a vehicle that are killed, one after the other: `python storm_pilots.py PORT COUNT SEED`.

Each is a copy of this process with a node of its own, sends numbered controls and is killed at a random moment. The
last one ends normally. Prints a JSON object: of each name what it stored, and of the last one its result.
"""

from __future__ import annotations

import json
import mmap
import os
import random
import signal
import struct
import sys
import threading
import time

from snr_sim import Config, Loop, Node, SocketsPair, tasks
from snr_sim.testing.function_components import FunctionLoopFactory

SECRET = b"a secret of 16 bytes or more"  # that of attackers.py
RATE_HZ = 100.0
LONGEST_S = 1.0  # that a pilot lives
LAST_S = 3.0
_COUNT = struct.Struct("q")


def run_pilot(name: str, port: int, stored: mmap.mmap, lives_s: float | None = None) -> dict[str, int]:
    """Send controls that command nothing; return their result, if the process lives that long."""

    def push(loop: Loop) -> None:
        (number,) = _COUNT.unpack_from(stored)
        _COUNT.pack_into(stored, 0, number + 1)
        loop.store_data("controls", {"number": number + 1})

    pair = SocketsPair(("127.0.0.1", port), name="tether", secret=SECRET)
    link = pair.client("controls", accept=["vehicle"])
    node = Node(name, Config(factories={name: [link, FunctionLoopFactory(push, rate_hz=RATE_HZ)]}))
    if lives_s is not None:
        threading.Timer(lives_s, lambda: node.enqueue_input(tasks.terminate("the storm is over"), "storm")).start()
    node.loop()
    tether = node.components["link_tether"]
    return {"sent": tether.sent, "dropped": tether.dropped, "unsent": tether.transport.peers.unsent}


def main() -> None:
    """Let them fly and fall."""
    port, count, rng = int(sys.argv[1]), int(sys.argv[2]), random.Random(int(sys.argv[3]))
    stored: dict[str, int] = {}
    for i in range(count):
        name, shared = f"pilot_{i}", mmap.mmap(-1, _COUNT.size)
        pid = os.fork()
        if pid == 0:
            try:
                run_pilot(name, port, shared)
            finally:
                os._exit(1)
        time.sleep(rng.uniform(0.0, LONGEST_S))
        os.kill(pid, signal.SIGKILL)
        assert os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == -signal.SIGKILL
        (stored[name],) = _COUNT.unpack_from(shared)
    shared = mmap.mmap(-1, _COUNT.size)
    last = run_pilot("last", port, shared, LAST_S)
    (stored["last"],) = _COUNT.unpack_from(shared)
    print(json.dumps({"stored": stored, "last": last}))


if __name__ == "__main__":
    main()
