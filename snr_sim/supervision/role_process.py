"""One role in a process of its own: what runs inside the process. Who started it is `supervision/multi_proc.py`."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import TypeAlias

from snr_sim.core.blame import describe_error
from snr_sim.core.config import Config, Mode
from snr_sim.core.interrupts import PATIENCE_S
from snr_sim.core.node import Node
from snr_sim.core.process import spawned
from snr_sim.core.process.packing import unpack
from snr_sim.core.runners import SynchronousRunner
from snr_sim.prelude import tasks
from snr_sim.prelude.component import RoleName
from snr_sim.prelude.errors import ComponentFailed, SnrError
from snr_sim.prelude.values import decode_value, encode_value

# Runs a role (which, config of it, seed), and tells of its node before that begins.
RoleRun: TypeAlias = Callable[[RoleName, Config, int, Callable[[Node], None]], None]

# So long after who started this process has gone, it goes too, whatever its components do.
_ORPHAN_S = 3.0


def run(line: Connection) -> int:
    """Runs one role until it ends; returns the exit status."""
    order = decode_value(line.recv_bytes())[1]
    ending = Ending(line)
    threading.Thread(target=obey, args=(line, ending), daemon=True).start()
    # Before and after the run, where nothing is to be halted, `end` does without signals.
    signal.signal(signal.SIGTERM, lambda number, frame: None)
    spawned.hear_signals()
    try:
        factories, run_it = unpack(order["packed"])
        config = Config(Mode(order["mode"]), {order["role"]: factories}, **order["bounds"])
        run_it(order["role"], config, order["seed"], ending.has)
    except SnrError as error:
        failure = [str(error), error.component if isinstance(error, ComponentFailed) else ""]
    except (Exception, SystemExit) as error:
        failure = [describe_error(error, f"while role '{order['role']}' was started in its process"), ""]
    else:
        return 0
    with suppress(OSError):  # nobody is there to hear it
        line.send_bytes(encode_value(["failed", *failure]))
    return 1


def run_role(role: RoleName, config: Config, seed: int, has_node: Callable[[Node], None]) -> None:
    """Makes a role's node, and runs it until it ends."""
    runner = SynchronousRunner(role, config, seed=seed)
    has_node(runner.node)
    runner.run()


class Ending:
    """How this process is ended from outside."""

    def __init__(self, line: Connection) -> None:
        self.may_go = threading.Event()
        self._line = line
        self._node: Node | None = None

    def has(self, node: Node) -> None:
        """Takes the node, and lets it begin when the runner still wants it: from then on it is ended in order."""
        self._node = node
        self._line.send_bytes(encode_value(["ready"]))
        self.may_go.wait()

    def in_order(self, name: str) -> None:
        """Ends the node as a signal of that name would, and what does not return a moment later as `orderly` does."""
        if not self.may_go.is_set() or self._node is None:
            os._exit(0)  # nothing has begun, and nothing will
        self._node.enter(tasks.terminate(name), "signal")
        time.sleep(PATIENCE_S)
        os.kill(os.getpid(), signal.SIGTERM)

    def now(self) -> None:
        """Interrupts what runs, as a second Ctrl-C does."""
        for number in (signal.SIGINT, signal.SIGTERM):
            os.kill(os.getpid(), number)


def obey(line: Connection, ending: Ending) -> None:
    """Does what it is told, and ends the role when nobody is left to tell."""
    while True:
        try:
            what, *how = decode_value(line.recv_bytes())
        except (EOFError, OSError):
            spawned.go_quiet()
            ending.in_order("orphaned")
            time.sleep(_ORPHAN_S)
            os._exit(1)
        if what == "go":
            ending.may_go.set()
        elif how == ["now"]:
            ending.now()
        else:
            threading.Thread(target=ending.in_order, args=how, daemon=True).start()
