"""The loop between pages of pulses and outputs of servo pulses, the same for simulated, emulated and real ones.

It writes once in each tick, with the moment at which the command was made: so outputs that watch for themselves hear
whether anybody still thinks. Outputs that were lost, or that let go by themselves, are armed again only after the
robot has commanded neutral for a while.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import msgspec

from snr_sim.core.ages import age_s
from snr_sim.core.node import Node
from snr_sim.devices.commands import command_of
from snr_sim.devices.loops import ActuatorLoop, ActuatorLoopFactory, started
from snr_sim.devices.pwm_backend import STOP_US
from snr_sim.prelude.device import LEASE_S, PwmOut
from snr_sim.prelude.errors import CommandError, DeviceError
from snr_sim.prelude.page import Page
from snr_sim.prelude.signals import CLAMPED, AppliedPulses, PwmCommand

REARM_AFTER_S = 0.5  # of commands that are all neutral
RETRY_EVERY_S = 1.0
TOLD_EVERY_S = 0.5


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

    def __init__(
        self,
        key: str,
        open_device: Callable[[], PwmOut],
        rate_hz: float,
        timeout_s: float = 0.5,
        lease_s: float = LEASE_S,
    ) -> None:
        super().__init__(key, open_device, rate_hz, timeout_s)
        self.lease_s = lease_s

    def get(self, parent: Node) -> PwmLoop:
        """Returns the loop `<key>_actuator`."""
        return PwmLoop(self, parent, f"{self.key}_actuator", self.rate_hz)


class PwmLoop(ActuatorLoop):
    """Writes pulses; a page that holds none leaves the outputs at neutral and stops the run."""

    factory: PwmLoopFactory

    def setup(self) -> None:
        """Opens the outputs and arms them: neutral, until a command comes."""
        self.out: PwmOut = started(self.factory.open_device(), f"the outputs '{self.factory.key}'")
        self._clamped: set[str] = set()
        self._state = ""
        self._why: list[str] = []
        self._told_s = self._tried_s = -math.inf
        self._neutral_since_s: float | None = None

    def loop(self) -> None:
        """Writes the newest command, with its age; neutral if it is too old."""
        now_s = self.get_time_s()
        page = self.parent.get_page(self.factory.key)  # asks aloud: a command nobody ever stores is reported
        pulses_us, stamp_s = [STOP_US] * self.out.channels, now_s
        if page is not None:
            age = age_s(self.parent, page)
            command = self._command_of(page)
            if age <= self.factory.timeout_s and command.is_on:
                pulses_us, stamp_s = command.pulses_us or pulses_us, now_s - age
        self._mend(now_s, all(pulse == STOP_US for pulse in pulses_us))
        applied = self.out.write_us(pulses_us, stamp_s, self.factory.lease_s)
        if page is not None and CLAMPED in applied.why:
            low, high = self.out.limits_us
            clamped = [min(high, max(low, pulse)) for pulse in pulses_us]  # the answer may still be on its way there
            self._say_clamped(PwmCommand(list(pulses_us)), PwmCommand(clamped), {"pulses_us": (low, high)})
        self._tell(now_s, applied)

    def _command_of(self, page: Page) -> PwmCommand:
        """Returns what a page commands. One that commands nothing is a mistake of who stored it: they hear of it."""
        try:
            return self.read_command(page)
        except CommandError as error:
            self.out.deactivate(error.message)
            raise self._blamed(page, error) from error

    def read_command(self, page: Page) -> PwmCommand:
        """Returns the pulses that a page asks for.

        Raises:
            CommandError: it asks for none.
        """
        limits = {"pulses_us": self.out.limits_us}
        command: PwmCommand = command_of(page.data, PwmCommand, limits)
        self._check(command)
        return command

    def _check(self, command: PwmCommand) -> None:
        low, high = self.out.limits_us
        for i, pulse in enumerate(command.pulses_us):
            if not math.isfinite(pulse):
                raise CommandError(
                    f"pulses_us[{i}] = {pulse!r} is no finite number.",
                    fix=f"a number from {low:g} to {high:g}; look for a division by zero or an overflow before it.",
                )
        if command.pulses_us and len(command.pulses_us) != self.out.channels:
            raise CommandError(
                f"it has {len(command.pulses_us)} pulses for {self.out.channels} channels.", fix="one for each channel."
            )

    def _mend(self, now_s: float, is_neutral: bool) -> None:
        """Opens lost outputs again, and arms them once nothing has been commanded for a while."""
        if not is_neutral:
            self._neutral_since_s = None
        elif self._neutral_since_s is None:
            self._neutral_since_s = now_s
        state = self.out.health().state
        if state in ("active", "activating") or now_s < self._tried_s + RETRY_EVERY_S:
            return
        self._tried_s = now_s
        try:
            self.out.configure()
            if self._neutral_since_s is not None and now_s >= self._neutral_since_s + REARM_AFTER_S:
                self.out.activate()
        except DeviceError as error:
            self.log.debug("%s", error)  # told as the fault already, and tried again

    def _tell(self, now_s: float, applied: AppliedPulses) -> None:
        """Says what becomes of the commands: now and then, and at once when it changes."""
        health = self.out.health()
        if health.state != self._state:
            if self._state:
                again = "" if health.state in ("active", "activating") else "; armed again only after neutral"
                why = f" {health.why}" if health.why else ""
                self.parent.note(f"Outputs of '{self.factory.key}', t = {now_s:.2f} s: {health.state}{again}.{why}")
            self._state = health.state
        elif applied.why == self._why and now_s < self._told_s + TOLD_EVERY_S - 1e-9:
            return
        self._told_s, self._why = now_s, applied.why
        data = {**msgspec.to_builtins(applied), "state": health.state, "fault": health.why}
        self.store_data(f"{self.factory.key}_applied", data, process=False)

    def halt(self) -> None:
        """Goes to neutral."""
        if "out" in self.__dict__:
            self.out.deactivate("the robot's program ends")

    def terminate(self) -> None:
        """Closes the outputs."""
        if "out" in self.__dict__:
            self.out.close()
