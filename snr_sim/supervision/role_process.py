"""One role in its own process: the code inside that process. `supervision/child.py` starts it."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Any, TypeAlias

from snr_sim.core.config import Config, Mode
from snr_sim.core.interrupts import GRACE_PERIOD_S
from snr_sim.core.node import Node
from snr_sim.core.process import spawned
from snr_sim.core.process.factory_pickling import unpickle_factory
from snr_sim.core.process.messages import MessageLine
from snr_sim.core.runners import SynchronousRunner
from snr_sim.core.source_location import describe_error
from snr_sim.prelude import tasks
from snr_sim.prelude.component import RoleName
from snr_sim.prelude.errors import ComponentFailedError, SnrError
from snr_sim.prelude.task import Page, Task
from snr_sim.supervision.beats import Beats

# Runs a role (its name, its config, seed), and calls the last argument with its node before the node begins.
RoleRun: TypeAlias = Callable[[RoleName, Config, int, Callable[[Node], None]], None]

SUPERVISOR = "supervisor"  # origin of the pages that a node gets from the program that has started its process
# Time from the parent's end until this process exits, whether or not its components have halted.
_ORPHAN_S = 3.0


def run(line: Connection) -> int:
    """Run one role until it ends; return the exit status."""
    messages = MessageLine(line)
    order = messages.receive()[1]
    shutdown = Shutdown(messages)

    def has_node(node: Node) -> None:
        shutdown.register(node)
        if order["beat_s"] is not None:
            beats = Beats(node, messages.send)
            threading.Thread(target=beats.run, args=(order["beat_s"],), name="beats", daemon=True).start()

    orders = (messages.receive, shutdown.end, shutdown.take, _ORPHAN_S)
    threading.Thread(target=spawned.execute_messages, args=orders, daemon=True).start()
    # Before and after the run there is nothing to halt, so `end` needs no signals.
    signal.signal(signal.SIGTERM, lambda number, frame: None)
    spawned.unblock_signals()
    try:
        factories, run_it = unpickle_factory(order["packed"])
        config = Config(Mode(order["mode"]), {order["role"]: factories}, **order["bounds"])
        run_it(order["role"], config, order["seed"], has_node)
    except SnrError as error:
        failure = [str(error), error.component if isinstance(error, ComponentFailedError) else ""]
    except (Exception, SystemExit) as error:
        failure = [describe_error(error, f"while role '{order['role']}' was started in its process"), ""]
    else:
        return 0
    messages.send("failed", *failure)
    return 1


def run_role(role: RoleName, config: Config, seed: int, has_node: Callable[[Node], None]) -> None:
    """Create a role's node, and run it until it ends."""
    runner = SynchronousRunner(role, config, seed=seed)
    has_node(runner.node)
    runner.run()


class Shutdown:
    """Begin and shutdown of this process from outside, and pages for its node."""

    def __init__(self, messages: MessageLine) -> None:
        self._may_go = threading.Event()
        self._messages = messages
        self._node: Node | None = None

    def register(self, node: Node) -> None:
        """Register the node, and wait for the runner's start message; from then on it is shut down gracefully."""
        self._node = node
        self._messages.send("ready")
        self._may_go.wait()

    def take(self, kind: str, *values: Any) -> None:
        """Let the node begin; or give it a page: its key, and its data."""
        if kind == "go":
            self._may_go.set()
        elif self._node is not None:
            key, data = values
            page = Page(key, data, SUPERVISOR, self._node.get_time_s())
            self._node.enqueue_input(Task.store_page(page), SUPERVISOR)

    def end(self, how: str) -> None:
        """End the node as a signal of that name would; code that does not return is interrupted.

        Args:
            how: the signal's name; "now" interrupts the running code at once, as a second Ctrl-C does.
        """
        if how == "now":
            for number in (signal.SIGINT, signal.SIGTERM):
                os.kill(os.getpid(), number)
            return
        if not self._may_go.is_set() or self._node is None:
            os._exit(0)  # the node has not begun, and will not
        self._node.enqueue_input(tasks.terminate(how), "signal")
        time.sleep(GRACE_PERIOD_S)
        os.kill(os.getpid(), signal.SIGTERM)
