"""An emulated motor controller on a CAN bus: frames in, frames out, at times that the caller states.

Its motor does what that of an `EmulatedVesc` does: without commands it brakes by the controller's own timeout.
"""

from __future__ import annotations

from collections.abc import Iterable

from snr_sim.devices.emulated.emulated_vesc import EmulatedVesc
from snr_sim.devices.motors.can_line import STATUS_S
from snr_sim.devices.wire import vesc_messages as vesc
from snr_sim.devices.wire.can_messages import CanFrame, CanStatus, CanVescCodec


class EmulatedCanNode:
    """The controller. Of the faults of an `EmulatedVesc`, "mute", "brown_out" and "motor" exist on a bus.

    Args:
        controller: what drives the motor.
        number: of the controller on the bus.
        erpm_per_rpm: see `VescCodec`.

    Attributes:
        ignored: frames that it does not act on, which are most of those on a bus.
    """

    def __init__(self, controller: EmulatedVesc, number: int, erpm_per_rpm: float) -> None:
        self.ignored: int = 0
        self._controller, self._codec = controller, CanVescCodec(number, erpm_per_rpm)
        self._next_s = 0.0

    def feed(self, frames: Iterable[CanFrame], now_s: float) -> list[CanFrame]:
        """Receive frames, which may be none; return those that it sends by now."""
        for frame in frames:
            message = self._codec.decode(frame)
            if message is None or isinstance(message, CanStatus):
                self.ignored += 1
            elif self._controller.fault("brown_out", now_s) is None:
                self._controller.follow(message, now_s)
        return self.tick(now_s)

    def tick(self, now_s: float) -> list[CanFrame]:
        """Let time pass: brake after the timeout. Return the frames that it sends by now."""
        self._controller.tick(now_s)
        if now_s < self._next_s:
            return []
        self._next_s = now_s + STATUS_S - 1e-9  # not a step later, by rounding
        values = self._controller.follow(vesc.GetValues(), now_s)
        is_silent = any(self._controller.fault(kind, now_s) is not None for kind in ("mute", "brown_out"))
        return [] if is_silent or not isinstance(values, vesc.MotorValues) else self._codec.encode_status(values)
