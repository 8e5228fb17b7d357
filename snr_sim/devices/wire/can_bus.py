"""CAN buses: the only module that imports python-can. Sends and receives frames; explains why a bus fails.

    can:socketcan:can0      a bus of the kernel, Linux: `ip link set can0 up type can bitrate 500000`
    can:slcan:/dev/ttyACM0  an adapter at a serial port, at 500 kbit/s. It is read byte by byte, which takes ten times
                            as long: `slcand -o -s6 /dev/ttyACM0 can0` makes it a bus of the kernel
    can:virtual:NAME        all that open this name in one process

Nothing here has a thread, and only `wait` blocks, so virtual buses also run in simulated time.
"""

from __future__ import annotations

import errno
import importlib
from contextlib import suppress
from typing import Any

from snr_sim.devices.wire.can_messages import CanFrame
from snr_sim.prelude.errors import DeviceError, MissingExtraError, UnknownNameError, suggest

PREFIX = "can:"
MAX_WAITING = 64  # frames that are not out yet
_KINDS = ("socketcan", "slcan", "virtual")
_BITS_PER_S = 500_000  # what VESC controllers are delivered with
_MAX_RECEIVED = 200  # in one call: a bus that is full must not hold its reader
_BUS_OFF = 0x40  # bit of an error frame's id: linux/can/error.h


class SendQueue:
    """Frames that wait until a bus takes them. One that waits is replaced by a newer one of its slot.

    Attributes:
        replaced: frames that were not sent for this reason.
        dropped: frames that were not sent because the queue was full; the one of the highest id goes first.
    """

    def __init__(self, max_frames: int = MAX_WAITING) -> None:
        self.replaced: int = 0
        self.dropped: int = 0
        self._max_frames = max_frames
        self._waiting: dict[tuple[int, bool], CanFrame] = {}

    def put(self, frame: CanFrame) -> None:
        """Add a frame."""
        self.replaced += self._waiting.pop(frame.slot, None) is not None
        self._waiting[frame.slot] = frame
        if len(self._waiting) > self._max_frames:
            self.dropped += 1
            self.take(max(self._waiting.values(), key=lambda one: one.priority))

    def first(self) -> CanFrame | None:
        """Return the next frame to send, that of the lowest id; None if none waits."""
        return min(self._waiting.values(), key=lambda one: one.priority, default=None)

    def take(self, frame: CanFrame) -> None:
        """Remove a frame."""
        del self._waiting[frame.slot]


class CanBus:
    """A bus, as one user has it. Its methods raise a DeviceError if it is gone, or off.

    Args:
        text: `can:KIND:CHANNEL`, as above.

    Raises:
        UnknownNameError: it is not such a text.
        MissingExtraError: python-can is not installed.
        DeviceError: there is no such bus, or no CAN in this kernel.
    """

    def __init__(self, text: str) -> None:
        self.name: str = text
        kind, _, channel = text.removeprefix(PREFIX).partition(":")
        if kind not in _KINDS or not channel or not text.startswith(PREFIX):
            raise UnknownNameError(f"'{text}' is not a CAN bus.", fix=f"can:KIND:CHANNEL; {suggest(kind, _KINDS)}")
        self._can = _python_can()
        self._is_text = kind == "slcan"
        options = {"bitrate": _BITS_PER_S} if self._is_text else {}
        try:
            self._bus: Any = self._can.Bus(interface=kind, channel=channel, ignore_config=True, **options)
        except (OSError, ValueError, self._can.CanError) as error:
            raise _open_error(text, error) from error
        self._queue = SendQueue()
        self._early: list[Any] = []  # received by `wait`
        self._errors = self._bus_offs = 0

    def send(self, frame: CanFrame) -> None:
        """Send a frame, without waiting until it is out: after those that wait and have a lower id."""
        self._queue.put(frame)
        self._send_waiting()

    def receive(self) -> list[CanFrame]:
        """Return the received frames, which may be none, without waiting; send those that wait."""
        messages, self._early = self._early, []
        while len(messages) < _MAX_RECEIVED and (message := self._receive(0.0)) is not None:
            messages.append(message)
        frames = []
        for message in messages:
            if message.is_error_frame:
                self._note_error(message.arbitration_id)
            elif not (message.is_remote_frame or message.is_fd):
                frames.append(CanFrame(message.arbitration_id, bytes(message.data), message.is_extended_id))
        self._send_waiting()
        return frames

    def wait(self, seconds: float) -> bool:
        """Return whether frames have arrived, as soon as they have; False after the timeout."""
        message = None if self._early else self._receive(seconds)
        if message is not None:
            self._early.append(message)
        return bool(self._early)

    def counts(self) -> dict[str, int]:
        """Return the counters: frames of 'errors' and 'bus_off', and those 'replaced' and 'dropped' in the queue."""
        counts = {"errors": self._errors, "bus_off": self._bus_offs}
        return counts | {"replaced": self._queue.replaced, "dropped": self._queue.dropped}

    def close(self) -> None:
        """Close the bus; frames that wait are not sent. Never raises; safe to call twice."""
        with suppress(OSError, self._can.CanError):  # raised for an adapter that was unplugged
            self._bus.shutdown()

    def _send_waiting(self) -> None:
        while (frame := self._queue.first()) is not None:
            message = self._can.Message(arbitration_id=frame.id, data=frame.data, is_extended_id=frame.is_extended)
            try:
                self._bus.send(message, timeout=0.0)
            except (OSError, self._can.CanError) as error:
                if _is_full(error):
                    return
                raise self._lost_error(error) from error
            self._queue.take(frame)

    def _receive(self, seconds: float) -> Any:
        try:
            return self._bus.recv(seconds)
        except (OSError, ValueError, IndexError, self._can.CanError) as error:
            is_damaged = isinstance(error, (ValueError, IndexError)) or isinstance(error.__cause__, UnicodeError)
            if not (self._is_text and is_damaged):
                raise self._lost_error(error) from error
            self._errors += 1
            self._bus.flush()
            return None

    def _note_error(self, bits: int) -> None:
        self._errors += 1
        if bits & _BUS_OFF:
            self._bus_offs += 1
            raise DeviceError(
                f"{self.name} is off: its adapter has counted too many errors, and sends no more.",
                fix="one bit rate at all devices, 120 ohm at both ends, no short circuit; then set the bus up again.",
            )

    def _lost_error(self, error: Exception) -> DeviceError:
        return DeviceError(f"{self.name} is gone: {error}.", fix="is the adapter in, and the bus up?")


def _is_full(error: Exception) -> bool:
    number = getattr(error, "error_code", None) or getattr(error, "errno", None)
    return number in (errno.ENOBUFS, errno.EAGAIN) or "buffer full" in str(error)


def _open_error(text: str, error: Exception) -> DeviceError:
    number = getattr(error, "errno", None)
    if number == errno.EAFNOSUPPORT:
        return DeviceError(
            f"There is no CAN in this kernel (AF_CAN: errno {number}).",
            fix="can:virtual:NAME here, or a computer with SocketCAN.",
        )
    return DeviceError(f"{text} cannot be opened: {error}.", fix="`ip -details link` lists the buses of the kernel.")


def _python_can() -> Any:
    try:
        return importlib.import_module("can")
    except ImportError:
        raise MissingExtraError("python-can", "can") from None
