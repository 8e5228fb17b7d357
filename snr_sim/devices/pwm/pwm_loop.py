"""Loop between pages of pulses and servo outputs; the same for simulated, emulated and real ones.

It writes once per tick, with the time at which the command was computed, so that outputs with their own lease can
detect a program that stopped computing. Arming:

    the robot's command has `is_armed`, and it was false before: neutral is sent until the outputs are armed
    `is_armed` was never false: the robot itself must command neutral first
    they were lost, disarmed themselves, or the robot stopped sending: the robot must set `is_armed` to false and
    then to true; or, if it never sets it, command neutral for half a second

Neutral that this loop writes because there is no fresh command never arms the outputs.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import msgspec

from snr_sim.devices.commands import ActuatorLoopFactory, CommandInput, CommandLoop, check_finite, command_of
from snr_sim.devices.device_loop import configure_device
from snr_sim.devices.pwm.pwm_backend import STOP_US
from snr_sim.prelude.device import LEASE_S, Health, PwmOut
from snr_sim.prelude.errors import CommandError, DeviceError
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.signals import CLAMPED, AppliedPulses, PwmCommand
from snr_sim.prelude.task import Page

TIMEOUT_S = 0.75 * LEASE_S  # neutral is sent before a lease expires if the robot is late
SILENT_S = 1.0  # a robot that is late for so long has failed: outputs are disarmed
REARM_AFTER_S = 0.5  # of commands that are all neutral
RETRY_PERIOD_S = 1.0
ARMED = ("active", "activating")
REPORT_PERIOD_S = 0.5
HOW_TO_ARM = f"Neutral until the robot disarms and arms, or has commanded neutral for {REARM_AFTER_S:g} s."


class PwmLoopFactory(ActuatorLoopFactory):
    """Writes the newest page of pulses to outputs; neutral when there is none or it is too old.

    Args:
        key: of the command page (`PwmCommand`). The page `<key>_applied` reports its effect, with the fields of
            `AppliedPulses`, `state` of the outputs, and `fault`, their error as text.
        open_device: opens the outputs.
        rate_hz: how often they are written.
        timeout_s: age from which a command is ignored.
        lease_s: how long outputs with their own lease follow a command.
    """

    arms_automatically: bool = False  # for a robot without an operator

    def __init__(
        self,
        key: str,
        open_device: Callable[[], PwmOut],
        rate_hz: float,
        timeout_s: float = TIMEOUT_S,
        lease_s: float = LEASE_S,
    ) -> None:
        super().__init__(key, open_device, rate_hz, timeout_s)
        self.lease_s: float = lease_s

    def get(self, parent: NodeApi) -> PwmLoop:
        """Return the loop `<key>_actuator`."""
        return PwmLoop(self, parent, f"{self.key}_actuator", self.rate_hz)

    def read_command(self, data: Any, out: PwmOut, commands: CommandInput) -> PwmCommand:
        """Return the pulses that a page's data request; errors as `command_of`. `commands` notes clamped values."""
        command: PwmCommand = command_of(data, PwmCommand, {"pulses_us": out.limits_us})
        for i, pulse in enumerate(command.pulses_us):
            check_finite(f"pulses_us[{i}]", pulse, out.limits_us)
        if command.pulses_us and len(command.pulses_us) != out.channels:
            raise CommandError(
                f"it has {len(command.pulses_us)} pulses for {out.channels} channels.", fix="one for each channel."
            )
        return command


class PwmLoop(CommandLoop):
    """Writes pulses. An invalid page means neutral; in lock step it stops the run, with the line that stored it."""

    factory: PwmLoopFactory

    def setup(self) -> None:
        """Open the outputs: neutral and disarmed."""
        self.device: Any = configure_device(self.factory.open_device(), f"the outputs '{self.factory.key}'")
        self.out: PwmOut = self.device
        self._state = ""
        self._reasons: list[str] = []
        self._rejected = ""
        self._reported_s = self._tried_s = -math.inf
        self._neutral_since_s: float | None = None
        self._was_armed: bool | None = None  # as in the robot's commands; None: not sent yet
        self._is_arming = self.factory.arms_automatically  # neutral is sent until outputs are armed
        self._was_lost = self._is_stopped = self._is_fault_reported = False

    def loop(self) -> None:
        """Write the newest command with its age; neutral if it is too old."""
        now_s = self.get_time_s()
        page, age = self.commands.newest()
        command = None if page is None else self._command_of(page)
        still_us = [STOP_US] * self.out.channels
        pulses_us, stamp_s = still_us, now_s
        if command is not None and age <= self.factory.timeout_s:
            if command.is_on and command.is_armed and not command.is_stop:
                pulses_us, stamp_s = command.pulses_us or still_us, now_s - age
            self._apply_arming(now_s, command, pulses_us)
        else:
            self._neutral_since_s = None
            if page is not None and age > SILENT_S and self.out.health().state in ARMED:
                self.out.deactivate(f"the robot has commanded nothing for {SILENT_S:g} s")
        self._arm(now_s)
        if self._is_arming:
            pulses_us = still_us
        applied = self.out.write_us(pulses_us, stamp_s, self.factory.lease_s)
        if CLAMPED in applied.reason:
            low, high = self.out.limits_us
            clamped = [min(high, max(low, pulse)) for pulse in pulses_us]  # applied pulses may arrive later
            self.commands.note_clamped(PwmCommand(list(pulses_us)), PwmCommand(clamped), {"pulses_us": (low, high)})
        self._report(now_s, applied)

    def _apply_arming(self, now_s: float, command: PwmCommand, pulses_us: list[float]) -> None:
        """Process the stop and arming fields of a fresh command."""
        if command.is_stop != self._is_stopped:
            self._is_stopped = command.is_stop
            if command.is_stop:
                self.out.stop()
            else:
                self.out.clear_stop()
        is_armed = command.is_armed and not command.is_stop
        if is_armed and self._was_armed is False:
            self._is_arming, self._was_lost = True, False
        elif not is_armed:
            self._is_arming = self._was_lost = False
            if self.out.health().state in ARMED:
                self.out.deactivate("disarmed by the robot")
        self._was_armed = is_armed
        if not is_armed or any(pulse != STOP_US for pulse in pulses_us):
            self._neutral_since_s = None
        elif self._neutral_since_s is None:
            self._neutral_since_s = now_s

    def _arm(self, now_s: float) -> None:
        """Reopen outputs that were lost, once a second; arm them if allowed."""
        state = self.out.health().state
        if state in ARMED:
            self._was_lost = True  # if arming fails the next time, unless the robot has disarmed them
            if state == "active":
                self._is_arming = False
            return
        needed_s = REARM_AFTER_S if self._was_lost else 0.0
        is_neutral = self._neutral_since_s is not None and now_s >= self._neutral_since_s + needed_s
        may_arm = (self._is_arming or is_neutral) and not self._is_stopped
        if state == "error":
            if now_s < self._tried_s + RETRY_PERIOD_S:
                return
            self._tried_s = now_s
        elif not may_arm:
            return
        try:
            self.out.configure()
            if may_arm:
                self.out.activate()
        except DeviceError as error:
            self.log.debug("%s", error)  # already reported as the fault; will be tried again

    def _command_of(self, page: Page) -> PwmCommand | None:
        """Return the command in a page. The error for an invalid one names the component that stored it.

        In lock step that ends the run. On the wall clock, a vehicle may be in the water: outputs go to neutral.
        """
        try:
            return self.factory.read_command(page.data, self.out, self.commands)
        except CommandError as error:
            error_with_source = self.commands.error_with_source(page, error)
            if self.parent.is_in_lock_step:
                self.out.deactivate(error.message)
                raise error_with_source from error
            if self._rejected != error.message:
                self._rejected = error.message
                self.parent.add_note(f"{error_with_source}\n  All outputs are neutral meanwhile.")
            return None

    def _report(self, now_s: float, applied: AppliedPulses) -> None:
        """Report the effect of the commands: periodically, and at once when it changes."""
        health = self.out.health()
        if health.state != self._state:
            if self._state:
                self._note_change(now_s, health)
            self._state = health.state
        elif applied.reason == self._reasons and now_s < self._reported_s + REPORT_PERIOD_S - 1e-9:
            return
        self._reported_s, self._reasons = now_s, applied.reason
        data = {**msgspec.to_builtins(applied), "state": health.state, "fault": health.reason}
        self.store_data(f"{self.factory.key}_applied", data, process=False)

    def _note_change(self, now_s: float, health: Health) -> None:
        """Log that outputs were lost or disarmed themselves, and what arms them again; and that they are back."""
        state, before = health.state, self._state
        is_lost = state not in ARMED and (state == "error" or (before in ARMED and self._was_armed is not False))
        is_back = self._is_fault_reported and (state == "active" or before == "error")
        if not (is_lost or is_back):
            return
        self._is_fault_reported = state != "active"
        what = f"{state}.{f' {health.reason}' if health.reason else ''}"
        if state == "inactive":
            what = f"{'found again, and ' if is_back else ''}{what}\n  {HOW_TO_ARM}"
        self.parent.add_note(f"Outputs of '{self.factory.key}', t = {now_s:.2f} s: {what}")
