"""Servo outputs and a power monitor on a microcontroller, over a serial port or an emulated one.

The applied pulses are those that the microcontroller reports at its pins, not the requested ones. It has a watchdog of
its own: without recently *computed* commands its outputs are neutral (docs/formats.md, section 8).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass

from snr_sim.devices.mcu.mcu_board import SILENT_S, McuBoard
from snr_sim.devices.mcu.mcu_handshake import FLASH, check_identity
from snr_sim.devices.pwm.pwm_backend import STOP_US, PwmBackend
from snr_sim.devices.wire import mcu_messages as wire
from snr_sim.prelude.device import LEASE_S, Stale
from snr_sim.prelude.errors import DeviceError, ParameterError, SensorLostError
from snr_sim.prelude.life_cycle import LifeCycle
from snr_sim.prelude.signals import NOT_ACTIVE, RESET, SLEWING, STOPPED, TOO_OLD, AppliedPulses, PowerReading

RESOLUTION_US = 0.5
_ARM_REQUEST_PERIOD_S = 0.05
_RESETS = {
    wire.ResetCause.WATCHDOG: "its watchdog: the firmware had hung",
    wire.ResetCause.BROWN_OUT: "its supply was too low for a moment",
    wire.ResetCause.EXTERNAL: "its reset pin, for example because a program opened the port",
    wire.ResetCause.POWER_ON: "its power came back",
}


class McuPwm(PwmBackend):
    """Outputs on the microcontroller. Implements `PwmOut`.

    Args:
        board: their board.
        now_s: the clock of command stamps.
        channels: number of outputs in use, from the first on.
    """

    has_independent_failsafe = True
    state: str
    reason: str

    def __init__(self, board: McuBoard, now_s: Callable[[], float], channels: int) -> None:
        super().__init__(now_s, channels, resolution_us=RESOLUTION_US)
        self.board: McuBoard = board
        self.title: str = "The microcontroller"
        self._seq = 0
        self._widths_us = self.still_us
        self._is_disarming = False
        self._requested_s = 0.0

    def put(self, pulses_us: list[float], stamp_s: float, lease_s: float, reasons: list[str]) -> list[float]:
        """Send pulses and return those of the newest telemetry."""
        self._receive(reasons)
        if self.state not in ("activating", "active"):
            return self.still_us
        if lease_s > 0.0:
            self._command(pulses_us, stamp_s, lease_s)
        if self.state == "activating" and self.is_neutral_requested:
            self._request_arming()
        if self._widths_us != pulses_us:
            reasons.append(SLEWING)
        return list(self._widths_us)

    def write_us(self, pulses_us: Sequence[float], stamp_s: float, lease_s: float = LEASE_S) -> AppliedPulses:
        """Request pulses. While it is not active it only receives, and so detects a pulled wire."""
        if self.state == "inactive":
            self._try(lambda: self._receive([]))
        return super().write_us(pulses_us, stamp_s, lease_s)

    def _command(self, pulses_us: list[float], stamp_s: float, lease_s: float) -> None:
        """Send pulses with their current age: the lease counts from when they were computed."""
        board = self.board
        assert board.ident is not None
        spare = [STOP_US] * (board.ident.channels - self.channels)
        age_ms = min(0xFFFF, max(0, round((self.now_s() - stamp_s) * 1e3)))
        lease_ms = min(0xFFFF, age_ms + int(lease_s * 1e3 + 1e-6))
        self._seq = (self._seq + 1) & 0xFFFF
        stamp_ms = round(stamp_s * 1e3) & 0xFFFFFFFF
        board.send(wire.SetWidths(board.session, self._seq, stamp_ms, age_ms, lease_ms, (*pulses_us, *spare)))

    def _receive(self, reasons: list[str]) -> None:
        """Process the messages that the board has sent since the last call.

        A wire that is gone, a silent board or a lost session raises a DeviceError, and the port is closed.
        """
        board = self.board
        try:
            board.poll()
            for message in board.take_messages():
                if isinstance(message, wire.Telemetry):
                    self._on_telemetry(message, reasons)
                elif isinstance(message, wire.CommandAck):
                    self._on_ack(message, reasons)
            if board.silent_s > SILENT_S:
                raise DeviceError(
                    f"{board.name}: no telemetry for {board.silent_s:.2f} s, though the port is open.",
                    fix="check the board's plug and supply.",
                )
        except DeviceError as error:
            board.mark_lost(str(error))
            raise

    def _on_telemetry(self, telemetry: wire.Telemetry, reasons: list[str]) -> None:
        if telemetry.session != self.board.session:
            self.disarm_reasons: list[str] = [] if telemetry.session else [RESET]
            causes = [words for cause, words in _RESETS.items() if telemetry.reset_cause & cause]
            restarted = f"the microcontroller has restarted ({', '.join(causes) or 'its boot loader'})."
            what = "another program has greeted the microcontroller." if telemetry.session else restarted
            fix = "the connection restarts by itself; command neutral to arm again."
            raise DeviceError(f"{self.board.name}: {what}", fix)
        output_count = len(telemetry.widths_us)
        if output_count < self.channels:
            raise DeviceError(
                f"{self.board.name}: its telemetry reports {output_count} outputs; {self.channels} are used.",
                fix=FLASH,
            )
        self._widths_us = list(telemetry.widths_us[: self.channels])
        if self.state != "active" or telemetry.state == wire.McuState.ARMED:
            return
        if telemetry.state == wire.McuState.STOPPED:
            self._set_inactive("emergency stop", reasons, STOPPED)
        elif telemetry.faults & wire.McuFault.LEASE_EXPIRED:
            self._set_inactive(
                "no new command in time: the microcontroller went to neutral by itself", reasons, TOO_OLD
            )
        else:
            self._set_inactive("the microcontroller has disarmed by itself", reasons)

    def _on_ack(self, ack: wire.CommandAck, reasons: list[str]) -> None:
        if ack.to == wire.TYPE_OF[wire.Disarm]:
            self._is_disarming = False
        elif ack.to == wire.TYPE_OF[wire.EmergencyStop] or ack.result == wire.AckResult.STOPPED:
            self._set_inactive("emergency stop", reasons, STOPPED)
        elif (ack.to, ack.result) == (wire.TYPE_OF[wire.Arm], wire.AckResult.DONE):
            self._on_armed()

    def _on_armed(self) -> None:
        if self.state == "activating" and not self._is_disarming:  # else it answers an earlier request
            self.state, self.reason = "active", ""

    def _set_inactive(self, what: str, reasons: list[str], *words: str) -> None:
        if self.state in ("activating", "active"):
            self.state, self.reason = "inactive", what
            self.disarm_reasons = [word for word in words if word == STOPPED]
            reasons += [word for word in (NOT_ACTIVE, *words) if word not in reasons]

    def on_configure(self) -> None:
        """Open the board; check its identity, and that no emergency stop is set."""
        ident = self.board.open(self)
        self.board.poll()
        self.title = f"The microcontroller at {self.board.name}"
        check_identity(self.board.name, ident, self.channels)
        self.limits_us: tuple[float, float] = (ident.lowest_us, ident.highest_us)
        self.resolution_us: float = ident.resolution_ns / 1000.0
        self._widths_us, self._is_disarming = self.still_us, False
        self._check_not_stopped()

    def on_activate(self) -> None:
        """Request arming: send neutral commands until the speed controllers have started; not in an emergency stop."""
        self._check_not_stopped()
        self.state, self.reason = "activating", "the speed controllers are shown neutral"
        self.disarm_reasons = []
        self._requested_s = -math.inf

    def _check_not_stopped(self) -> None:
        telemetry = self.board.telemetry
        if telemetry is not None and telemetry.state == wire.McuState.STOPPED:
            raise DeviceError(
                f"{self.board.name}: its emergency stop is set.",
                fix="make it safe; then clear the stop, or switch it off and on.",
            )

    def on_deactivate(self, reason: str) -> None:
        """Disarm."""
        if self.board.is_open:
            self._is_disarming = True
            self._requested_s = self.now_s()
            self.board.send(wire.Disarm(self.board.session))

    def on_close(self) -> None:
        """Release the board."""
        self.board.release(self)

    def counts(self) -> dict[str, int]:
        """Return the board's counters."""
        return self.board.counts()

    def on_stop(self) -> None:
        """Store the stop in the microcontroller: it outlives this program, until it is cleared or power is cut."""
        self.board.open(self)
        self.board.send(wire.EmergencyStop(self.board.session))

    def on_clear_stop(self) -> None:
        """Clear it in the microcontroller."""
        self.board.open(self)
        self.board.send(wire.ClearStop(self.board.session))

    def _request_arming(self) -> None:
        now_s = self.now_s()
        if now_s >= self._requested_s + _ARM_REQUEST_PERIOD_S:
            self._requested_s = now_s
            session = self.board.session
            # Not before it has reported that it is disarmed: telemetry still in transit is older.
            self.board.send(wire.Disarm(session) if self._is_disarming else wire.Arm(session))


@dataclass(frozen=True)
class PowerScale:
    """Conversion of the voltages at pins A0 and A1 to volts and amperes.

    Args:
        volts_per_volt: of the battery, at A0.
        amps_per_volt: at A1, over `offset_v`.
        offset_v: at A1 when no current flows.

    Source of the numbers: Blue Robotics, Power Sense Module R2, technical details.
    """

    volts_per_volt: float = 11.0
    amps_per_volt: float = 37.8788
    offset_v: float = 0.330

    def __post_init__(self) -> None:
        if not (self.volts_per_volt > 0.0 and self.amps_per_volt > 0.0):
            raise ParameterError(
                f"The scales of a power module must be positive: {self}.", fix="use those of its data sheet."
            )

    def reading(self, battery_pin_mv: float, current_pin_mv: float, stamp_s: float) -> PowerReading:
        """Return the reading for the pin voltages.

        >>> PowerScale().reading(1400, 990, 0.0)
        PowerReading(voltage_v=15.4, current_a=25.0, stamp_s=0.0)
        """
        amps = (current_pin_mv / 1000.0 - self.offset_v) * self.amps_per_volt
        return PowerReading(round(battery_pin_mv / 1000.0 * self.volts_per_volt, 3), round(amps, 3), stamp_s)

    def pins_mv(self, voltage_v: float, current_a: float) -> tuple[float, float]:
        """Return the voltages that the module puts on the pins, 0 to 5000 each."""
        pins_v = voltage_v / self.volts_per_volt, current_a / self.amps_per_volt + self.offset_v
        volts, amps = (min(5000.0, max(0.0, pin_v * 1000.0)) for pin_v in pins_v)
        return volts, amps


class McuPower(LifeCycle):
    """A power module of some `scale` at pins A0 and A1 of the microcontroller. Implements `PowerMonitor`."""

    title = "The power module at the microcontroller"

    def __init__(self, board: McuBoard, scale: PowerScale = PowerScale()) -> None:
        self._board, self._scale = board, scale

    def read(self) -> PowerReading | Stale:
        """Return the reading in the newest telemetry; raise a SensorLostError if it was closed."""
        board = self._board
        if self.state == "closed":
            raise SensorLostError(f"{self.title} was closed.", fix="open another.")
        with suppress(DeviceError):  # the board keeps it as its fault
            board.poll()
        telemetry, measured_s = board.telemetry, board.measured_s
        if not board.is_open or telemetry is None or measured_s is None:
            return Stale(board.fault, measured_s)
        if board.silent_s > SILENT_S:
            return Stale(f"{board.name}: no telemetry for {board.silent_s:.2f} s.", measured_s)
        return self._scale.reading(telemetry.battery_pin_mv, telemetry.current_pin_mv, measured_s)

    def on_configure(self) -> None:
        """Open the board."""
        self._board.open(self)

    def on_close(self) -> None:
        """Release the board."""
        self._board.release(self)

    def counts(self) -> dict[str, int]:
        """Return the board's counters."""
        return self._board.counts()
