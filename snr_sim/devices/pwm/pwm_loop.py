"""The loop between pages of pulses and outputs of servo pulses, the same for simulated, emulated and real ones.

It writes once in each tick, with the moment at which the command was made: so outputs that watch for themselves hear
whether anybody still thinks. Who arms them:

    the robot's command says `is_armed`, and said before that it was not: neutral is shown until they are armed
    it never said otherwise: the robot itself must command neutral first
    they were lost, let go by themselves, or the robot fell silent: the robot must say that it is disarmed and then
    armed; or, if it never says so, command neutral for half a second

No neutral that this loop writes of itself, because there is no fresh command, ever arms anything.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import msgspec

from snr_sim.devices.command_input import CommandInput
from snr_sim.devices.commands import check_finite, command_of
from snr_sim.devices.loops import ActuatorLoopFactory, CommandLoop, configured
from snr_sim.devices.pwm.pwm_backend import STOP_US
from snr_sim.prelude.device import LEASE_S, Health, PwmOut
from snr_sim.prelude.errors import CommandError, DeviceError
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.page import Page
from snr_sim.prelude.signals import CLAMPED, AppliedPulses, PwmCommand

TIMEOUT_S = 0.75 * LEASE_S  # neutral of now is sent before a lease runs out behind a robot that hesitates
SILENT_S = 1.0  # a robot that hesitates for so long has stopped thinking: outputs are disarmed
REARM_AFTER_S = 0.5  # of commands that are all neutral
RETRY_EVERY_S = 1.0
ARMED = ("active", "activating")
TOLD_EVERY_S = 0.5
HOW_TO_ARM = f"Neutral until the robot disarms and arms, or has commanded neutral for {REARM_AFTER_S:g} s."


class PwmLoopFactory(ActuatorLoopFactory):
    """Writes the newest page of pulses to outputs, and neutral when there is none or it is too old.

    Args:
        key: of the command page (`PwmCommand`). What becomes of it is told in the page `<key>_applied`, with the fields
            of `AppliedPulses`, `state` of the outputs, and `fault`, what is wrong with them in words.
        open_device: opens the outputs.
        rate_hz: how often they are written.
        timeout_s: age from which a command no longer counts.
        lease_s: how long outputs that watch for themselves follow a command.
    """

    arms_by_itself = False  # for a robot that nobody arms

    def __init__(
        self,
        key: str,
        open_device: Callable[[], PwmOut],
        rate_hz: float,
        timeout_s: float = TIMEOUT_S,
        lease_s: float = LEASE_S,
    ) -> None:
        super().__init__(key, open_device, rate_hz, timeout_s)
        self.lease_s = lease_s

    def get(self, parent: NodeApi) -> PwmLoop:
        """Return the loop `<key>_actuator`."""
        return PwmLoop(self, parent, f"{self.key}_actuator", self.rate_hz)

    def read_command(self, data: Any, out: PwmOut, commands: CommandInput) -> PwmCommand:
        """Return the pulses that a page's data asks for.

        Args:
            data: of the page.
            out: the outputs.
            commands: notes what was clamped.

        Raises:
            CommandError: it asks for none.
        """
        command: PwmCommand = command_of(data, PwmCommand, {"pulses_us": out.limits_us})
        for i, pulse in enumerate(command.pulses_us):
            check_finite(f"pulses_us[{i}]", pulse, out.limits_us)
        if command.pulses_us and len(command.pulses_us) != out.channels:
            raise CommandError(
                f"it has {len(command.pulses_us)} pulses for {out.channels} channels.", fix="one for each channel."
            )
        return command


class PwmLoop(CommandLoop):
    """Writes pulses. A page that holds none is neutral; in lock step it stops the run, with the line that stored it."""

    factory: PwmLoopFactory

    def setup(self) -> None:
        """Open the outputs: neutral, and not armed."""
        self.device = self.out = configured(self.factory.open_device(), f"the outputs '{self.factory.key}'")
        self._state = ""
        self._why: list[str] = []
        self._refused = ""
        self._told_s = self._tried_s = -math.inf
        self._neutral_since_s: float | None = None
        self._was_armed: bool | None = None  # by the robot's own word; None: it has not said anything yet
        self._is_arming = self.factory.arms_by_itself  # neutral is shown until outputs are armed
        self._was_lost = self._is_stopped = self._is_told = False

    def loop(self) -> None:
        """Write the newest command, with its age; neutral if it is too old."""
        now_s = self.get_time_s()
        page, age = self.commands.newest()
        command = None if page is None else self._command_of(page)
        still_us = [STOP_US] * self.out.channels
        pulses_us, stamp_s = still_us, now_s
        if command is not None and age <= self.factory.timeout_s:
            if command.is_on and command.is_armed and not command.is_stop:
                pulses_us, stamp_s = command.pulses_us or still_us, now_s - age
            self._hear(now_s, command, pulses_us)
        else:
            self._neutral_since_s = None
            if page is not None and age > SILENT_S and self.out.health().state in ARMED:
                self.out.deactivate(f"the robot has commanded nothing for {SILENT_S:g} s")
        self._arm(now_s)
        if self._is_arming:
            pulses_us = still_us
        applied = self.out.write_us(pulses_us, stamp_s, self.factory.lease_s)
        if CLAMPED in applied.why:
            low, high = self.out.limits_us
            clamped = [min(high, max(low, pulse)) for pulse in pulses_us]  # the answer may still be on its way there
            self.commands.note_clamped(PwmCommand(list(pulses_us)), PwmCommand(clamped), {"pulses_us": (low, high)})
        self._tell(now_s, applied)

    def _hear(self, now_s: float, command: PwmCommand, pulses_us: list[float]) -> None:
        """Take in what a fresh command says of stopping and arming."""
        if command.is_stop != self._is_stopped:
            self._is_stopped = command.is_stop
            if command.is_stop:
                self.out.stop()
            else:
                self.out.clear_stop()
        says = command.is_armed and not command.is_stop
        if says and self._was_armed is False:
            self._is_arming, self._was_lost = True, False
        elif not says:
            self._is_arming = self._was_lost = False
            if self.out.health().state in ARMED:
                self.out.deactivate("disarmed by the robot")
        self._was_armed = says
        if not says or any(pulse != STOP_US for pulse in pulses_us):
            self._neutral_since_s = None
        elif self._neutral_since_s is None:
            self._neutral_since_s = now_s

    def _arm(self, now_s: float) -> None:
        """Open outputs that were lost, once a second; arm them if they may be."""
        state = self.out.health().state
        if state in ARMED:
            self._was_lost = True  # if they are not armed the next time, unless the robot has disarmed them
            if state == "active":
                self._is_arming = False
            return
        needed_s = REARM_AFTER_S if self._was_lost else 0.0
        is_neutral = self._neutral_since_s is not None and now_s >= self._neutral_since_s + needed_s
        may_arm = (self._is_arming or is_neutral) and not self._is_stopped
        if state == "error":
            if now_s < self._tried_s + RETRY_EVERY_S:
                return
            self._tried_s = now_s
        elif not may_arm:
            return
        try:
            self.out.configure()
            if may_arm:
                self.out.activate()
        except DeviceError as error:
            self.log.debug("%s", error)  # told as the fault already, and tried again

    def _command_of(self, page: Page) -> PwmCommand | None:
        """Return what a page commands. One that commands nothing is a mistake of who stored it: they hear of it.

        In lock step that ends the run. On the wall clock, where a vehicle may be in the water, all are neutral instead.
        """
        try:
            return self.factory.read_command(page.data, self.out, self.commands)
        except CommandError as error:
            blamed = self.commands.blamed(page, error)
            if self.parent.is_in_lock_step:
                self.out.deactivate(error.message)
                raise blamed from error
            if self._refused != error.message:
                self._refused = error.message
                self.parent.note(f"{blamed}\n  All outputs are neutral meanwhile.")
            return None

    def _tell(self, now_s: float, applied: AppliedPulses) -> None:
        """Say what becomes of the commands: now and then, and at once when it changes."""
        health = self.out.health()
        if health.state != self._state:
            if self._state:
                self._note_change(now_s, health)
            self._state = health.state
        elif applied.why == self._why and now_s < self._told_s + TOLD_EVERY_S - 1e-9:
            return
        self._told_s, self._why = now_s, applied.why
        data = {**msgspec.to_builtins(applied), "state": health.state, "fault": health.why}
        self.store_data(f"{self.factory.key}_applied", data, process=False)

    def _note_change(self, now_s: float, health: Health) -> None:
        """Note that outputs were lost or let go by themselves, with what arms them again; and that they are back."""
        state, before = health.state, self._state
        is_lost = state not in ARMED and (state == "error" or (before in ARMED and self._was_armed is not False))
        is_back = self._is_told and (state == "active" or before == "error")
        if not (is_lost or is_back):
            return
        self._is_told = state != "active"
        what = f"{state}.{f' {health.why}' if health.why else ''}"
        if state == "inactive":
            what = f"{'found again, and ' if is_back else ''}{what}\n  {HOW_TO_ARM}"
        self.parent.note(f"Outputs of '{self.factory.key}', t = {now_s:.2f} s: {what}")
