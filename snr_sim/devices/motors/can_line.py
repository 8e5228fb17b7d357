"""VESC motor controllers on one CAN bus, each with a line of its own.

VescMotors --> CanLine --.
VescSensor --> CanLine --> SharedCan --> CanBus --> all controllers

A controller sends its state without being asked, 50 times a second; one that is silent is lost.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable

from snr_sim.devices.motors.controller_line import ControllerLine
from snr_sim.devices.wire import vesc_messages as vesc
from snr_sim.devices.wire.can_bus import CanBus
from snr_sim.devices.wire.can_messages import CanFrame, CanStatus, CanVescCodec, status_controller
from snr_sim.prelude.errors import DeviceError

STATUS_S = 0.02  # between two frames of one kind
SILENT_S = 5.0 * STATUS_S  # a controller that sends nothing for this time is lost
_FIRST_S, _WAIT_S, _WAITS = 0.5, 0.02, 256  # for its first frame, among those of others


class SharedCan:
    """A bus that is open while a line needs it. Thread-safe.

    Args:
        open_bus: opens it; raises a DeviceError where that is not possible.

    Attributes:
        counts: the newest counters of the bus.
    """

    def __init__(self, open_bus: Callable[[], CanBus]) -> None:
        self.counts: dict[str, int] = {}
        self._open_bus = open_bus
        self._bus: CanBus | None = None
        self._fault = ""
        self._ports: dict[int, ControllerPort] = {}  # by the controller's number
        self._lock = threading.RLock()

    def open(self, controller: int) -> ControllerPort:
        """Return one controller's part of the bus; an older one of it is lost."""
        with self._lock:
            if self._bus is None:
                self._bus = self._open_bus()
            self._ports[controller] = port = ControllerPort(self, controller)
            return port

    def close(self, port: ControllerPort) -> None:
        """Close a part, and the bus after the last one. Safe to call twice."""
        with self._lock:
            self._ports = {number: one for number, one in self._ports.items() if one is not port}
            if not self._ports and self._bus is not None:
                self._end("The CAN bus was closed.")

    def exchange(self, port: ControllerPort, frame: CanFrame | None = None, wait_s: float = 0.0) -> None:
        """Send a frame; or wait until one arrives, and sort what has arrived.

        Raises:
            DeviceError: the part is closed, or the bus is gone, which closes it for all.
        """
        with self._lock:
            if self._bus is None or self._ports.get(port.controller) is not port:
                raise DeviceError(self._fault, fix="open it again.")
            try:
                if frame is not None:
                    self._bus.send(frame)
                    return
                if wait_s:
                    self._bus.wait(wait_s)
                for received in self._bus.receive():
                    controller = status_controller(received)
                    if controller in self._ports:
                        self._ports[controller].newest[received.id] = received
            except DeviceError as error:
                self._end(error.message)
                raise
            self.counts = self._bus.counts()

    def take(self, port: ControllerPort, wait_s: float) -> list[CanFrame]:
        """Return the newest frame of each kind, as `exchange` sorts them, after waiting for one; errors as there."""
        with self._lock:
            if not port.newest:  # else another line has found some; a look at an adapter takes 1 ms
                self.exchange(port, wait_s=wait_s)
            newest, port.newest = port.newest, {}
            return list(newest.values())

    def _end(self, fault: str) -> None:
        bus, self._bus, self._fault, self._ports = self._bus, None, fault, {}
        if bus is not None:
            self.counts = bus.counts()
            bus.close()


class ControllerPort:
    """One controller's part of a bus.

    Attributes:
        controller: its number.
        newest: frames of its state that were not taken yet, by id.
    """

    def __init__(self, shared: SharedCan, controller: int) -> None:
        self.controller: int = controller
        self.newest: dict[int, CanFrame] = {}
        self._shared = shared

    def wait(self, seconds: float) -> bool:
        """Return whether one of its frames is there; one of another controller ends the waiting, too."""
        if not self.newest:
            self._shared.exchange(self, wait_s=seconds)
        return bool(self.newest)

    def close(self) -> None:
        """Close it."""
        self._shared.close(self)


class CanLine(ControllerLine[ControllerPort]):
    """A controller's line. `chip` is its number as text; `measured_s` is the time of the look before its frames.

    Args:
        name: of the motor.
        shared: the bus.
        controller: its number.
        now_s: the clock that stamps values.
        erpm_per_rpm: see `VescCodec`.
    """

    def __init__(
        self, name: str, shared: SharedCan, controller: int, now_s: Callable[[], float], erpm_per_rpm: float
    ) -> None:
        super().__init__(name, lambda: shared.open(controller), now_s)
        self.chip = str(controller)
        self._shared, self._codec = shared, CanVescCodec(controller, erpm_per_rpm)
        self._parts: dict[str, float] = {}
        self._looked_s = self._received_s = -math.inf
        self._frames = 0

    def on_open(self, port: ControllerPort) -> None:
        """Wait for its first frame; raise a DeviceError if none arrives."""
        self._parts, self._looked_s, known = {}, self.now_s(), self._frames
        until_s = self._looked_s + _FIRST_S
        for _ in range(_WAITS):
            self._take(port, _WAIT_S)
            if self._frames > known:
                return
            if self.now_s() >= until_s:
                break
        raise DeviceError(
            f"{self.title}, number {self.chip} on the CAN bus, sends no status.",
            fix="check its power and its wires; VESC Tool, App Settings, General: its VESC ID, CAN Baud Rate 500K, and "
            "CAN Status Messages 1, 4 and 5 at 50 Hz.",
        )

    def send(self, message: vesc.VescMessage) -> None:
        """Send a command; raise a DeviceError if the bus is not open, or is gone, or the controller is silent."""
        with self._open_wire() as port:
            self._take(port)
            if self.now_s() - self._received_s > SILENT_S:
                raise DeviceError(
                    f"{self.title} has sent no status for {SILENT_S:g} s.", fix="check its power and its wires."
                )
            self._shared.exchange(port, self._codec.encode(message))

    def update(self) -> None:
        """Take the values that have arrived; errors as in `ControllerLine.send`."""
        with self._open_wire() as port:
            self._take(port)

    def counts(self) -> dict[str, int]:
        """Return the counters: 'frames' of it, 'unknown' ones, and those of the bus."""
        return {"frames": self._frames, "unknown": self._codec.unknown, **self._shared.counts}

    def _take(self, port: ControllerPort, wait_s: float = 0.0) -> None:
        frames, now_s = self._shared.take(port, wait_s), self.now_s()
        for frame in frames:
            status = self._codec.decode(frame)
            if isinstance(status, CanStatus):
                self._frames, self._received_s = self._frames + 1, now_s
                self._parts |= status.values
        if len(self._parts) == len(vesc.MotorValues.__struct_fields__) - 1:  # all but the fault
            self.values, self.measured_s = vesc.MotorValues(fault=vesc.FAULTS[0], **self._parts), self._looked_s
            self._parts = {}
        self._looked_s = now_s
