"""Messages between a program and the supervisor of its outputs, and the port that carries them.

Each message is JSON, never a pickle; neither end accepts more than `MAX_BYTES`. Times are of the computer's clock
that all its processes share (CLOCK_MONOTONIC), so the age of a lease includes its time in the pipe.
"""

from __future__ import annotations

import select
import subprocess
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import Any, TypeAlias

import msgspec

from snr_sim.core.process.spawn import describe_exit, start_process
from snr_sim.prelude.errors import DeviceError
from snr_sim.prelude.values import JSON_ERRORS

MAX_BYTES = 8192  # far less than the pipe's buffer
END_S = 5.0


class OpenOutputs(msgspec.Struct, frozen=True, tag=True):
    """Opens the outputs and leaves them at neutral."""

    opener: str  # "module:function", which returns a PwmOut
    args: list[Any]  # its arguments


class ArmOutputs(msgspec.Struct, frozen=True, tag=True):
    """Starts arming."""


class DisarmOutputs(msgspec.Struct, frozen=True, tag=True):
    """Goes to neutral."""

    reason: str


class Lease(msgspec.Struct, frozen=True, tag=True):
    """Requests pulses for a limited time."""

    seq: int  # counts up
    pulses_us: list[float]  # one for each channel
    stamp_s: float  # when the command was computed
    lease_s: float  # how long it is valid from then on


class CloseOutputs(msgspec.Struct, frozen=True, tag=True):
    """Goes to neutral and ends."""


class LeaseStatus(msgspec.Struct, frozen=True, tag=True):
    """Reply to one order. State, reason and counts are those of Health."""

    seq: int  # of the newest lease
    state: str
    reason: str
    pulses_us: list[float]  # the applied ones
    reasons: list[str]  # why they differ from the command
    counts: dict[str, int]
    fix: str = ""  # if the order failed, what to try


Message: TypeAlias = OpenOutputs | ArmOutputs | DisarmOutputs | Lease | CloseOutputs | LeaseStatus

_encoder = msgspec.json.Encoder()
_decoder: msgspec.json.Decoder[Message] = msgspec.json.Decoder(Message)


def encode(message: Message) -> bytes:
    """Return a message as bytes.

    >>> encode(ArmOutputs())
    b'{"type":"ArmOutputs"}'
    """
    body = _encoder.encode(message)
    if len(body) > MAX_BYTES:
        raise DeviceError(f"A message of {len(body)} bytes to the supervisor of outputs; at most {MAX_BYTES}.")
    return body


def decode(body: bytes) -> Message:
    """Return the message that `encode` wrote; other bytes raise a DeviceError.

    >>> decode(b'{"type":"ArmOutputs"}')
    ArmOutputs()
    """
    try:
        return _decoder.decode(body)
    except JSON_ERRORS as error:
        raise DeviceError(f"{body[:60]!r} is not a supervisor message: {error}.") from error


def receive(line: Connection) -> Message:
    """Return the next message, as `decode` does.

    EOFError and OSError mean that the other process has ended, or sent more than `MAX_BYTES`.
    """
    return decode(line.recv_bytes(MAX_BYTES))


class SupervisorPort:
    """The supervisor, a new Python process, as its program sees it. Only `wait` and `close` block.

    It has its own process group, so that Ctrl-C at a terminal does not reach it. When this program ends in any way, its
    line closes.
    """

    def __init__(self) -> None:
        self._process, self._line = start_process("snr_sim.devices.pwm.pwm_supervisor:run")
        self.pid: int = self._process.pid

    def write(self, order: Message) -> None:
        """Send an order; raise a DeviceError if the process has ended or does not read."""
        if not select.select([], [self._line], [], 0)[1]:
            raise DeviceError(f"The process {self.pid} does not read its input: it hangs.", fix=f"kill -9 {self.pid}")
        try:
            self._line.send_bytes(encode(order))
        except OSError as error:
            raise self._ended() from error

    def read(self) -> list[Message]:
        """Return the messages that have arrived; raise a DeviceError if the process has ended."""
        messages: list[Message] = []
        try:
            while self._line.poll():
                messages.append(receive(self._line))
        except (EOFError, OSError) as error:
            if not messages:
                raise self._ended() from error
        return messages

    def wait(self, seconds: float) -> bool:
        """Return whether a message, or the end of the process, has arrived."""
        return self._line.poll(seconds)

    def close(self) -> None:
        """Close its line, which ends the process."""
        self._line.close()
        try:
            self._process.wait(END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _ended(self) -> DeviceError:
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(END_S)
        status = self._process.returncode
        how = "ended its line" if status is None else describe_exit(status)
        return DeviceError(
            f"The process {self.pid} {how}.", fix="read its output above; `dmesg | tail` shows whether memory ran out."
        )
