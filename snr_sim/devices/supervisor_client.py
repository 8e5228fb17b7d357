"""A supervisor of outputs, as the devices of the robot's program use it: see `output_supervisor.py`. Thread-safe."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from snr_sim.devices.wire import lease_messages as wire
from snr_sim.prelude.device import LEASE_S
from snr_sim.prelude.errors import DeviceError

OPEN_S = 20.0  # until a new Python on a small computer has opened them
ANSWER_S = 1.0


class SupervisorClient:
    """Starts a supervisor, orders, and keeps its newest answer.

    Args:
        title: of what it owns, in messages.
        open_line: starts a supervisor.
        monotonic_s: the clock that all processes of this computer share.

    Attributes:
        line: to the supervisor; None without one.
        status: its newest answer.
        received_s: when that arrived.
        requested: the command that it answers.
    """

    def __init__(
        self, title: str, open_line: Callable[[], wire.SupervisorPort], monotonic_s: Callable[[], float]
    ) -> None:
        self.line: wire.SupervisorPort | None = None
        self.status: wire.LeaseStatus = wire.LeaseStatus(0, "unconfigured", "", [], [], {})
        self.received_s: float = 0.0
        self.requested: list[Any] = []
        self.monotonic_s: Callable[[], float] = monotonic_s
        self.title: str = title
        self._open_line = open_line
        self._seq = 0
        self._requested_by_seq: dict[int, list[Any]] = {}
        self._lock = threading.RLock()

    def open(self, opener: str, args: list[Any]) -> None:
        """Order the supervisor to open the outputs; start one if there is none. Its error is raised here."""
        with self._lock:
            if self.line is None:
                self.line = self._open_line()
                self._requested_by_seq.clear()
            self.order(wire.OpenOutputs(opener, args), OPEN_S)

    def order(self, order: wire.Message, timeout_s: float = ANSWER_S) -> None:
        """Send an order, and wait for its answer; raise a DeviceError if it fails."""
        with self._lock:
            line = self._require_open()
            self.receive()
            answers = len(self._requested_by_seq) + 1
            line.write(order)
            until_s = time.monotonic() + timeout_s
            while answers > 0 and line.wait(max(0.0, until_s - time.monotonic())):
                answers -= self.receive()
            if answers > 0:
                raise self._silent(timeout_s)
            if self.status.state == "error":
                raise DeviceError(self.status.reason, fix=self.status.fix)

    def lease(self, command: list[Any], age_s: float, lease_s: float) -> wire.LeaseStatus:
        """Send a command; return the newest answer, which may belong to the one before.

        Args:
            command: see `wire.Lease`.
            age_s: since it was computed.
            lease_s: how long it is valid from then on.

        Raises:
            DeviceError: the supervisor has ended, hangs, or reports an error.
        """
        with self._lock:
            self.check()
            now_s = self.monotonic_s()
            self._seq += 1
            # An old command has expired to neutral, and no newer state is possible.
            age_s, left_s = (age_s, age_s + lease_s) if lease_s > 0.0 else (0.0, LEASE_S)
            self._require_open().write(wire.Lease(self._seq, command, now_s - age_s, left_s))
            self._requested_by_seq[self._seq] = command
            self.receive()
            if self.status.state == "error":
                raise DeviceError(self.status.reason, fix=self.status.fix)
            return self.status

    def check(self) -> None:
        """Raise a DeviceError if there is no supervisor, or it has ended, or hangs."""
        with self._lock:
            self.receive()
            if self._requested_by_seq and self.monotonic_s() > self.received_s + ANSWER_S:
                raise self._silent(ANSWER_S)

    def ask(self, period_s: float) -> wire.LeaseStatus:
        """Ask for the status if none has arrived for a while; return the newest. Errors as in `receive`."""
        with self._lock:
            self.receive()
            if not self._requested_by_seq and self.monotonic_s() >= self.received_s + period_s:
                self._seq += 1
                self._require_open().write(wire.ReadOutputs(self._seq))
                self._requested_by_seq[self._seq] = self.requested
                self.receive()
            return self.status

    def receive(self) -> int:
        """Read the answers that have arrived; return their number. Raise a DeviceError if the supervisor has ended."""
        with self._lock:
            count = 0
            for message in self._require_open().read():
                if isinstance(message, wire.LeaseStatus):
                    count += 1
                    self.status = message
                    self.received_s = self.monotonic_s()
                    self.requested = self._requested_by_seq.get(message.seq, self.requested)
                    for seq in [seq for seq in self._requested_by_seq if seq <= message.seq]:
                        del self._requested_by_seq[seq]
            return count

    def end(self) -> None:
        """Order the supervisor to release the outputs and end. Safe to call twice."""
        with self._lock:
            line, self.line = self.line, None
            if line is None:
                return
            with suppress(DeviceError):  # a supervisor that has died
                line.write(wire.CloseOutputs())
            line.close()

    def _require_open(self) -> wire.SupervisorPort:
        if self.line is None:
            raise DeviceError(f"{self.title} is not open.", fix="call configure() first.")
        return self.line

    def _silent(self, timeout_s: float) -> DeviceError:
        return DeviceError(
            f"{self.title} has not answered for {timeout_s:g} s.",
            fix="check with `top` whether the computer is overloaded.",
        )
