"""One VESC motor controller as the computer sees it: the owner of its port, shared by those who drive and read it.

VescMotors --.
VescSensor --> VescLine --> port --> controller

Commands are sent and not repeated, so a controller that receives nothing brakes by its own timeout.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from snr_sim.devices.wire import vesc_messages as vesc
from snr_sim.devices.wire.serial_port import BytePort
from snr_sim.devices.wire.vesc_frames import VescFrames, encode
from snr_sim.prelude.errors import DeviceError

ANSWER_S = 0.25  # after this time without an answer, a request or its answer was lost
_TRIES = 4  # of the first request
_READS = 64  # of pieces of its answer: a device that talks without end is another one


class VescLine:
    """Opens the port for the first device that needs it, and closes it after the last one. Thread-safe.

    Args:
        name: of the motor.
        open_port: opens the port; raises a DeviceError where that is not possible. See `MotorPorts.open_port`.
        now_s: the clock that stamps values.
        erpm_per_rpm: see `VescCodec`.
        dialect: see `vesc_messages.py`.

    Attributes:
        values: the newest.
        measured_s: when they were asked for, by `now_s`: they are not older. None before the first.
        junk_bytes: received since then that are not its answer.
        fault: as text, why the port is not open.
        chip: number of the controller's processor, as hexadecimal text; empty before it was open.
    """

    def __init__(
        self,
        name: str,
        open_port: Callable[[], BytePort],
        now_s: Callable[[], float],
        erpm_per_rpm: float,
        dialect: vesc.Dialect = "stock",
    ) -> None:
        self.name: str = name
        self.title: str = f"The controller of {name}"
        self.values: vesc.MotorValues | None = None
        self.measured_s: float | None = None
        self.junk_bytes: int = 0
        self.chip: str = ""
        self.fault: str = f"{self.title} has not been opened."
        self.now_s: Callable[[], float] = now_s
        self._open_port = open_port
        self._codec, self._frames = vesc.VescCodec(dialect, erpm_per_rpm), VescFrames()
        self._port: BytePort | None = None
        self._asked_s: float | None = None  # None: nothing is waited for
        self._users: set[int] = set()
        self._lock = threading.RLock()

    @property
    def is_open(self) -> bool:
        """Whether its port is open."""
        return self._port is not None

    def open(self, user: object) -> None:
        """Open the port and ask for the firmware, if not done yet, for a device that needs it.

        Raises:
            DeviceError: the port cannot be opened, no controller answers, or its firmware is unknown.
        """
        with self._lock:
            self._users.add(id(user))
            if self._port is None:
                self._port, self._frames, self._asked_s = self._open_port(), VescFrames(), None
                with self._open_wire() as port:
                    firmware = self._ask_firmware(port)
                    self.chip = firmware.chip.hex()
                    self._codec.set_firmware(firmware, self.title)

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

    def send(self, message: vesc.VescMessage) -> None:
        """Send a message; raise a DeviceError if the port is not open, or is gone, which closes it."""
        with self._open_wire() as port:
            port.write(encode(self._codec.encode(message)))

    def wait(self, seconds: float) -> bool:
        """Return whether bytes have arrived, as soon as they have; errors as in `send`."""
        with self._open_wire() as port:
            return port.wait(seconds)

    def update(self) -> None:
        """Take the answer that has arrived, and ask for the next values; errors as in `send`.

        One request is on its way at a time; an answer after `ANSWER_S` counts as that of the next one.
        """
        with self._open_wire() as port:
            self._take(port)
            now_s = self.now_s()
            if self._asked_s is None or now_s - self._asked_s > ANSWER_S:
                self._asked_s = now_s
                self.send(vesc.GetValues())
                self._take(port)  # a controller in memory has answered

    def counts(self) -> dict[str, int]:
        """Return the counters: 'frames', 'damaged', and 'skipped' bytes since it was opened, and 'unknown' payloads."""
        frames = self._frames
        return {
            "frames": frames.frames,
            "damaged": frames.damaged,
            "skipped": frames.skipped,
            "unknown": self._codec.unknown,
        }

    def _take(self, port: BytePort) -> None:
        data = port.read()
        self.junk_bytes += len(data)
        for payload in self._frames.feed(data, self.now_s()):
            message = self._codec.decode(payload)
            if isinstance(message, vesc.MotorValues) and self._asked_s is not None:
                self.values, self.measured_s = message, self._asked_s
                self._asked_s, self.junk_bytes = None, 0

    def _ask_firmware(self, port: BytePort) -> vesc.Firmware:
        received = 0
        for _ in range(_TRIES):
            port.write(encode(self._codec.encode(vesc.GetFirmware())))
            for _ in range(_READS):
                if not port.wait(ANSWER_S):
                    break
                data = port.read()
                received += len(data)
                for payload in self._frames.feed(data, self.now_s()):
                    message = self._codec.decode(payload)
                    if isinstance(message, vesc.Firmware):
                        return message
        found = f"{received} bytes, but not its firmware's version" if received else "nothing"
        raise DeviceError(
            f"{self.title} at {port.name} was asked {_TRIES} times who it is, and sent {found}.",
            fix="check its power, its cable, and that its serial port is switched on, with 115200 baud.",
        )

    def _close(self, fault: str) -> None:
        port, self._port, self.fault = self._port, None, fault
        if port is not None:
            port.close()

    @contextmanager
    def _open_wire(self) -> Iterator[BytePort]:
        with self._lock:
            if self._port is None:
                raise DeviceError(self.fault)
            try:
                yield self._port
            except DeviceError as error:
                self._close(error.message)
                raise
