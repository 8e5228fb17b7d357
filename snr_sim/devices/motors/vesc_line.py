"""A VESC motor controller at a serial port.

Commands are sent and not repeated, so a controller that receives nothing brakes by its own timeout.
"""

from __future__ import annotations

from collections.abc import Callable

from snr_sim.devices.motors.controller_line import ControllerLine
from snr_sim.devices.wire import vesc_messages as vesc
from snr_sim.devices.wire.serial_port import BytePort
from snr_sim.devices.wire.vesc_frames import VescFrames, encode
from snr_sim.prelude.errors import DeviceError

ANSWER_S = 0.25  # after this time without an answer, a request or its answer was lost
_TRIES = 4  # of the first request
_READS = 64  # of pieces of its answer: a device that talks without end is another one


class VescLine(ControllerLine[BytePort]):
    """Its line. `chip` is the number of its processor, as hexadecimal text.

    Args:
        name: of the motor.
        open_port: see `MotorPorts.open_port`.
        now_s: the clock that stamps values.
        erpm_per_rpm: see `VescCodec`.
        dialect: see `vesc_messages.py`.
    """

    def __init__(
        self,
        name: str,
        open_port: Callable[[], BytePort],
        now_s: Callable[[], float],
        erpm_per_rpm: float,
        dialect: vesc.Dialect = "stock",
    ) -> None:
        super().__init__(name, open_port, now_s)
        self._codec, self._frames = vesc.VescCodec(dialect, erpm_per_rpm), VescFrames()
        self._asked_s: float | None = None  # None: nothing is waited for

    def on_open(self, port: BytePort) -> None:
        """Ask for the firmware; raise a DeviceError if nothing answers, or it is unknown."""
        self._frames, self._asked_s = VescFrames(), None
        firmware = self._ask_firmware(port)
        self.chip = firmware.chip.hex()
        self._codec.set_firmware(firmware, self.title)

    def send(self, message: vesc.VescMessage) -> None:
        """Send a message; raise a DeviceError if the port is not open, or is gone, which closes it."""
        with self._open_wire() as port:
            port.write(encode(self._codec.encode(message)))

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
