"""Messages between a program and the supervisor of its outputs over a `multiprocessing` connection.

Each message is JSON, never a pickle; neither end accepts more than `MAX_BYTES`. Times are of the computer's clock
that all its processes share (CLOCK_MONOTONIC), so the age of a lease includes its time in the pipe.
"""

from __future__ import annotations

from multiprocessing.connection import Connection
from typing import Any, TypeAlias

import msgspec

from snr_sim.prelude.errors import DeviceError
from snr_sim.prelude.values import JSON_ERRORS

MAX_BYTES = 8192


class OpenOutputs(msgspec.Struct, frozen=True, tag=True):
    """Opens the outputs and leaves them at neutral.

    Args:
        opener: "module:function"; called with `args` it returns a PwmOut.
        args: its arguments.
    """

    opener: str
    args: list[Any]


class ArmOutputs(msgspec.Struct, frozen=True, tag=True):
    """Starts arming."""


class DisarmOutputs(msgspec.Struct, frozen=True, tag=True):
    """Goes to neutral."""

    reason: str


class Lease(msgspec.Struct, frozen=True, tag=True):
    """Requests pulses for a limited time.

    Args:
        seq: counts up.
        pulses_us: one for each channel.
        stamp_s: when the command was computed.
        lease_s: how long it is valid from then on.
    """

    seq: int
    pulses_us: list[float]
    stamp_s: float
    lease_s: float


class CloseOutputs(msgspec.Struct, frozen=True, tag=True):
    """Goes to neutral and ends."""


class LeaseStatus(msgspec.Struct, frozen=True, tag=True):
    """Reply to one order.

    Args:
        seq: of the newest lease.
        state: of the outputs, as in Health.
        reason: as in Health.
        pulses_us: the applied pulses.
        reasons: why they differ from the command.
        counts: as in Health.
        fix: if the order failed, what to try.
    """

    seq: int
    state: str
    reason: str
    pulses_us: list[float]
    reasons: list[str]
    counts: dict[str, int]
    fix: str = ""


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
    """Return the message that `encode` wrote.

    Raises:
        DeviceError: the bytes are not a message.

    >>> decode(b'{"type":"ArmOutputs"}')
    ArmOutputs()
    """
    try:
        return _decoder.decode(body)
    except JSON_ERRORS as error:
        raise DeviceError(f"{body[:60]!r} is not a supervisor message: {error}.") from error


def receive(connection: Connection) -> Message:
    """Return the next message from a connection.

    Raises:
        EOFError, OSError: the other process has ended, or sent more than `MAX_BYTES`.
        DeviceError: the bytes are not a message.
    """
    return decode(connection.recv_bytes(MAX_BYTES))
