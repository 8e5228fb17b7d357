"""Messages between a program and the supervisor of its outputs, and the port that carries them.

Times are of the computer's clock that all its processes share (CLOCK_MONOTONIC), so the age of a lease includes its
time in the pipe.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import msgspec

from snr_sim.devices.wire.process_port import MessageCodec, ProcessPort
from snr_sim.prelude.ground_signals import MotorReading


class OpenOutputs(msgspec.Struct, frozen=True, tag=True):
    """Opens the outputs and leaves them at neutral."""

    opener: str  # "module:function", which returns them
    args: list[Any]  # its arguments


class ArmOutputs(msgspec.Struct, frozen=True, tag=True):
    """Starts arming."""


class DisarmOutputs(msgspec.Struct, frozen=True, tag=True):
    """Goes to neutral."""

    reason: str


class Lease(msgspec.Struct, frozen=True, tag=True):
    """Requests something for a limited time."""

    seq: int  # counts up
    command: list[Any]  # pulses [us], one for each channel; or the mode of motors, and the list of their values
    stamp_s: float  # when the command was computed
    lease_s: float  # how long it is valid from then on


class ReadOutputs(msgspec.Struct, frozen=True, tag=True):
    """Asks for the status."""

    seq: int  # counts up, with those of leases


class CloseOutputs(msgspec.Struct, frozen=True, tag=True):
    """Goes to neutral and ends."""


class SupervisedReading(msgspec.Struct, frozen=True):
    """State of a motor, by the clock of leases; without one, why there is none, and since when."""

    reading: MotorReading | None
    reason: str = ""
    since_s: float | None = None


class LeaseStatus(msgspec.Struct, frozen=True, tag=True):
    """Reply to one order. State, reason and counts are those of Health."""

    seq: int  # of the newest lease, or question
    state: str
    reason: str
    applied: list[Any]  # the newest command as it is done
    reasons: list[str]  # why they differ from the command
    counts: dict[str, int]
    fix: str = ""  # if the order failed, what to try
    readings: list[SupervisedReading] = []


Message: TypeAlias = OpenOutputs | ArmOutputs | DisarmOutputs | Lease | ReadOutputs | CloseOutputs | LeaseStatus

CODEC: MessageCodec[Message] = MessageCodec(Message, "supervisor")


class SupervisorPort(ProcessPort[Message]):
    """The supervisor, as its program sees it: of pulses, unless another function runs it."""

    def __init__(self, target: str = "snr_sim.devices.pwm.pwm_supervisor:run") -> None:
        super().__init__(target, CODEC)
