"""One motor controller as the computer sees it: the owner of its port, shared by those who drive and read it.

VescMotors --.
VescSensor --> ControllerLine --> port --> controller
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Generic, TypeVar

from snr_sim.devices.wire import vesc_messages as vesc
from snr_sim.prelude.errors import DeviceError

PortT = TypeVar("PortT", bound=Any)


class ControllerLine(Generic[PortT]):
    """Opens the port for the first device that needs it, and closes it after the last one. Thread-safe.

    Args:
        name: of the motor.
        open_port: opens the port; raises a DeviceError where that is not possible.
        now_s: the clock that stamps values.

    Attributes:
        values: the newest.
        measured_s: when they were asked for, by `now_s`: they are not older. None before the first.
        junk_bytes: received since then that are not its answer.
        fault: as text, why the port is not open.
        chip: what identifies the controller, as text; empty before it was open.
    """

    def __init__(self, name: str, open_port: Callable[[], PortT], now_s: Callable[[], float]) -> None:
        self.name: str = name
        self.title: str = f"The controller of {name}"
        self.values: vesc.MotorValues | None = None
        self.measured_s: float | None = None
        self.junk_bytes: int = 0
        self.chip: str = ""
        self.fault: str = f"{self.title} has not been opened."
        self.now_s: Callable[[], float] = now_s
        self._open_port = open_port
        self._port: PortT | None = None
        self._users: set[int] = set()
        self._lock = threading.RLock()

    @property
    def is_open(self) -> bool:
        """Whether its port is open."""
        return self._port is not None

    def open(self, user: object) -> None:
        """Open the port and find the controller, if not done yet, for a device that needs it.

        Raises:
            DeviceError: the port cannot be opened, no controller answers, or it is unknown.
        """
        with self._lock:
            self._users.add(id(user))
            if self._port is None:
                self._port = self._open_port()
                with self._open_wire() as port:
                    self.on_open(port)

    def release(self, user: object) -> None:
        """Release the port for one device. Safe to call twice."""
        with self._lock:
            self._users.discard(id(user))
            if not self._users:
                self._close(f"{self.title} was closed.")

    def drop(self, fault: str) -> None:
        """Close the port, with the reason as text, until `open` is called again."""
        with self._lock:
            self._close(fault)

    def wait(self, seconds: float) -> bool:
        """Return whether something has arrived, as soon as it has; errors as in `send`."""
        with self._open_wire() as port:
            is_there: bool = port.wait(seconds)
            return is_there

    def on_open(self, port: PortT) -> None:
        """Find the controller at the port; raise a DeviceError if there is none."""
        raise NotImplementedError(f"{type(self).__name__} needs a method on_open(self, port)")

    def send(self, message: vesc.VescMessage) -> None:
        """Send a message; raise a DeviceError if the port is not open, or is gone, which closes it."""
        raise NotImplementedError(f"{type(self).__name__} needs a method send(self, message)")

    def update(self) -> None:
        """Take the values that have arrived, and ask for the next; errors as in `send`."""
        raise NotImplementedError(f"{type(self).__name__} needs a method update(self)")

    def counts(self) -> dict[str, int]:
        """Return the counters."""
        raise NotImplementedError(f"{type(self).__name__} needs a method counts(self)")

    def _close(self, fault: str) -> None:
        port, self._port, self.fault = self._port, None, fault
        if port is not None:
            port.close()

    @contextmanager
    def _open_wire(self) -> Iterator[PortT]:
        with self._lock:
            if self._port is None:
                raise DeviceError(self.fault)
            try:
                yield self._port
            except DeviceError as error:
                self._close(error.message)
                raise
