"""Messages between a program and the supervisor of its outputs, and the port that carries them.

Times are of the computer's clock that all its processes share (CLOCK_MONOTONIC), so the age of a lease includes its
time in the pipe.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import msgspec

from snr_sim.devices.wire.process_port import MessageCodec, ProcessPort


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

CODEC: MessageCodec[Message] = MessageCodec(Message, "supervisor")


class SupervisorPort(ProcessPort[Message]):
    """The supervisor, as its program sees it."""

    def __init__(self) -> None:
        super().__init__("snr_sim.devices.pwm.pwm_supervisor:run", CODEC)
