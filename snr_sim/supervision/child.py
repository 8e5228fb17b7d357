"""Processes of roles, as their owner starts them: what `MultiProcRunner` and `SupervisedRunner` have in common.

    main thread                      a MonitoredProcess per role   the process (supervision/role_process.py)
    events: signals, ends  <-----    receives messages, lines  <---    runs the node, prints, fails, ends
    end("SIGTERM"), end("now"), kill  -------------------------->      a terminate task; an interrupt; nothing to say

The processes are in groups of their own, so Ctrl-C at the terminal reaches only this program, once. Listening ports
are opened before anything starts, and passed as descriptors (`PortFactory`), so a port in use is reported first. A
role that is started again opens its port itself, with the number that was found first: meanwhile clients are refused
and try again. If the port stayed open here, they would connect to it and give up on a role that is still starting.
"""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from queue import Empty
from types import FrameType
from typing import Any, TypeAlias

from snr_sim.core.config import Config
from snr_sim.core.process.factory_pickling import pickle_factory
from snr_sim.core.process.monitored_process import MonitoredProcess
from snr_sim.core.standard_streams import forward_line
from snr_sim.prelude.component import PortFactory, RoleName
from snr_sim.prelude.errors import ConfigError
from snr_sim.prelude.interfaces import implements
from snr_sim.prelude.waiting import TimedQueue
from snr_sim.supervision.role_process import RoleRun

TARGET = "snr_sim.supervision.role_process:run"
POLL_PERIOD_S = 0.1
IDLE_PERIOD_S = 0.25
_PRINTED_NOTHING = "It had printed nothing on stderr.\n  Try: run that role alone and watch its memory."

# Events for the main thread: ("signal", name), ("failed", role, message, component), ("over", role, status),
# ("beat", role, ...) as in `supervision/beats.py`.
ProcessEvent: TypeAlias = tuple[Any, ...]


class RoleProcesses:
    """The roles of a config that run in processes, and the events of these processes.

    Args:
        config: of the robot. Its factories are sent to a process: see `core/process/factory_pickling.py`.
        roles: that run.
        seed: of the run.
        run: runs one role, in its process: a function at the top level of a file.

    Raises:
        ConfigError: a role is unknown or named twice.
    """

    def __init__(self, config: Config, roles: Sequence[RoleName], seed: int, run: RoleRun) -> None:
        if len(set(roles)) != len(roles):
            raise ConfigError(f"A role is named twice: {', '.join(roles)}.", fix="each role runs once.")
        for role in roles:
            config.get(role)
        self.roles: list[RoleName] = list(roles)
        self.running: dict[RoleName, MonitoredProcess] = {}
        self._events: TimedQueue[ProcessEvent] = TimedQueue()
        self._config = config
        self._seed = seed
        self._run = run
        self._has_run = False
        self._orders: dict[RoleName, dict[str, Any]] = {}
        self._ports = [one for role in roles for one in config.get(role) if implements(one, PortFactory)]

    def run(
        self, begin: Callable[[], object], handle: Callable[..., object], do_due: Callable[[], float], runner: str
    ) -> None:
        """Start processes, and pass on what happens to them, until the caller says that all is over.

        Listening ports and pipes are opened here and inherited, so all roles know the number chosen for a port 0.

        Args:
            begin: starts the first ones.
            handle: gets each event.
            do_due: does what is due, after the events of a moment; returns how long to wait for further events, such as
                `POLL_PERIOD_S`, 0 at the end.
            runner: name of the caller's class, for messages.

        Raises:
            ConfigError: an object cannot be sent to a process, so none was started; or it has run before.
            LinkError: a port is in use, so none was started.
        """
        if self._has_run:
            raise ConfigError(f"This {runner} has already run.", fix="make a new one for a new run.")
        self._has_run = True
        with signals_as(self._events):
            try:
                self._prepare()
                begin()
                self._release()
                while (wait_s := do_due()) > 0.0:
                    self._wait(handle, wait_s)
            finally:
                for process in self.running.values():  # only if this program fails itself
                    process.kill()
                    process.listener.join()
                self._release()

    def _prepare(self) -> None:
        """Open the ports, and pack what each process gets, so that a failure is reported before anything starts."""
        for port in self._ports:
            port.claim()
        self._orders = {role: self._order(role) for role in self.roles}

    def _release(self) -> None:
        """Close the ports here, once all have been started; processes that have them keep them.

        An end of a pipe that stays open here would hide that its role has ended.
        """
        for port in self._ports:
            port.release()

    def _wait(self, handle: Callable[..., object], wait_s: float) -> None:
        try:
            event = self._events.get(wait_s)
            while True:  # all that has arrived, before the caller judges what is due
                handle(*event)
                event = self._events.get(0.0)
        except Empty:
            return

    def start(self, role: RoleName, beat_s: float | None = None) -> MonitoredProcess:
        """Start the process of a role; it reports every `beat_s` that its node works, if that is given.

        Raises:
            ConfigError: an object cannot be sent to it, if it is started again.
        """

        def on_end(status: int, error: Exception | None) -> None:
            if error is not None:
                self._events.put(("failed", role, f"{type(error).__name__}: {error}", ""))
            self._events.put(("over", role, status))

        def on_message(kind: str, *values: Any) -> None:
            if kind == "unsendable":
                kind, values = "failed", (str(values[0]), "")
                process.kill()
            self._events.put((kind, role, *values))

        order = self._orders.pop(role) if role in self._orders else self._order(role)
        order["beat_s"] = beat_s
        process = MonitoredProcess(
            f"role '{role}'",
            TARGET,
            order,
            on_message,
            on_end,
            order["packed"]["descriptors"],
            out=lambda line: forward_line(sys.stdout, f"[{role}] {line}"),
            err=lambda line: forward_line(sys.stderr, f"[{role}] {line}"),
        )
        process.start()
        self.running[role] = process
        return process

    def ended(self, role: RoleName, status: int) -> tuple[MonitoredProcess, str]:
        """Forget a process that has ended; return it, and a message on how it ended."""
        process = self.running.pop(role)
        process.listener.join()
        return process, process.exit_message(status, "", _PRINTED_NOTHING)

    def _order(self, role: RoleName) -> dict[str, Any]:
        factories = self._config.get(role)
        for factory in factories:  # one by one, to name the one that cannot be sent
            pickle_factory(factory, type(factory).__name__, f"Role '{role}'")
        packed = pickle_factory((factories, self._run), "what it runs", f"Role '{role}'")
        config = self._config
        return {"role": role, "packed": packed, "mode": config.mode.value, "bounds": config.bounds, "seed": self._seed}


@contextmanager
def signals_as(events: TimedQueue[ProcessEvent]) -> Iterator[None]:
    """Turn Ctrl-C and SIGTERM into events while active; outside of the main thread, do nothing."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def on_signal(number: int, _frame: FrameType | None) -> None:
        events.put(("signal", signal.Signals(number).name))  # atomic, so an interrupt cannot leave a lock held

    before = {number: signal.signal(number, on_signal) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
