"""A process that owns outputs and puts them at neutral, however the robot's program ends: its orders, and its loop.

    robot's program  --leases over a pipe-->  supervisor  --> outputs
                     <--status--------------

What outputs do while a lease is valid, and after it, is up to a subclass: of pulses (pwm/pwm_supervisor.py), of motors
(motors/motor_guard.py). It is in `devices` because for the program it is one more device; `supervision` is about roles.
"""

from __future__ import annotations

import importlib
import signal
import sys
import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Any, Generic, TypeVar

from snr_sim.core.process import spawned
from snr_sim.core.standard_streams import print_line
from snr_sim.devices.wire import lease_messages as wire
from snr_sim.prelude.device import Device
from snr_sim.prelude.errors import DeviceError, SnrError

IDLE_S = 1.0

OutputsT = TypeVar("OutputsT", bound=Device)


class OutputSupervisor(ABC, Generic[OutputsT]):
    """Executes orders. Owns no pipe, so a test needs none.

    Args:
        now_s: the clock of the stamps of leases.
    """

    def __init__(self, now_s: Callable[[], float]) -> None:
        self.now_s: Callable[[], float] = now_s
        self.out: OutputsT | None = None
        self.until_s: float = 0.0  # end of the newest lease
        self.has_closed: bool = False
        self._seq = 0
        self._applied: list[Any] = []
        self._reasons: list[str] = []

    def execute(self, order: wire.Message) -> wire.LeaseStatus:
        """Execute an order; the answer contains the error if it fails."""
        self.poll()
        try:
            self._execute(order)
        except SnrError as error:
            return self._status(error.message, error.fix)
        finally:
            self.on_change()
        return self._status()

    def poll(self) -> float:
        """Do what is due; return the time until the next call."""
        return IDLE_S if self.out is None else self.step(self.out)

    def end(self, hold: Callable[[float], None]) -> None:
        """Go to neutral, hold it for a while, and release the outputs."""
        if self.out is not None:
            self.out.deactivate("the robot's program has ended")
            self.on_change()
            self.on_end(self.out, hold)
            self.out.close()

    def _execute(self, order: wire.Message) -> None:
        if isinstance(order, wire.OpenOutputs):
            if self.out is None:
                module, _, function = order.opener.partition(":")
                self.out = self.adopt(getattr(importlib.import_module(module), function)(*order.args))
            self.out.configure()
            self.on_open(self.out)
        elif isinstance(order, wire.CloseOutputs):
            self.has_closed = True
        elif self.out is None:
            raise DeviceError("These outputs are not open.", fix="call configure() first.")
        elif isinstance(order, wire.ArmOutputs):
            self.out.activate()
            self.until_s = self.now_s() + IDLE_S  # until the first lease
        elif isinstance(order, wire.DisarmOutputs):
            self.out.deactivate(order.reason)
        elif isinstance(order, wire.Lease):
            self._applied, self._reasons = self.follow(self.out, order)
            self._seq = order.seq
            self.until_s = self.end_of(order)
        elif isinstance(order, wire.ReadOutputs):
            self._seq = order.seq

    def end_of(self, lease: wire.Lease) -> float:
        """Return when a lease ends: that of the newest command, not the latest."""
        return min(lease.stamp_s, self.now_s()) + lease.lease_s

    def _status(self, message: str = "", fix: str = "") -> wire.LeaseStatus:
        if self.out is None:
            return wire.LeaseStatus(self._seq, "error", message, [], [], {}, fix)
        health = self.out.health()
        state = "error" if message else health.state
        return wire.LeaseStatus(
            self._seq,
            state,
            message or health.reason,
            self._applied,
            self._reasons,
            health.counts,
            fix,
            self.readings(),
        )

    @abstractmethod
    def follow(self, out: OutputsT, lease: wire.Lease) -> tuple[list[Any], list[str]]:
        """Do what a lease says; return what is applied, and why it differs."""

    @abstractmethod
    def step(self, out: OutputsT) -> float:
        """Continue the newest lease, or neutral after its end; return the time until the next call."""

    @abstractmethod
    def on_end(self, out: OutputsT, hold: Callable[[float], None]) -> None:
        """Hold neutral until outputs may be released."""

    def adopt(self, opened: Any) -> OutputsT:
        """Return the outputs in what the opener returned."""
        out: OutputsT = opened
        return out

    def on_open(self, out: OutputsT) -> None:
        """Begin what continues as long as outputs are open."""

    def on_change(self) -> None:
        """Note that the state of the outputs may have changed."""

    def readings(self) -> list[wire.SupervisedReading]:
        """Return the newest readings of what is behind the outputs' ports."""
        return []


def serve(line: Connection, supervisor: OutputSupervisor[Any]) -> int:
    """Run the process: execute orders until its line closes."""
    signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(0))  # goes to neutral during exit
    spawned.unblock_signals()
    reason = "the robot's program has gone without closing them"
    try:
        while not supervisor.has_closed:
            if line.poll(supervisor.poll()):
                line.send_bytes(wire.CODEC.encode(supervisor.execute(wire.CODEC.receive(line))))
    except DeviceError as error:
        reason = error.message
    except (EOFError, OSError):
        pass  # the other end has closed
    finally:
        supervisor.end(time.sleep)  # before the answer is sent: the other process may be gone
    if not supervisor.has_closed:
        print_line(sys.stderr, f"Outputs have gone to neutral: {reason}.")
    return 0
