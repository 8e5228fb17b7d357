"""Loop between pages `DriveCommand` and motors; the same for simulated and real ones.

A command is valid for `LEASE_S` from the time of its page. Motors that were lost come back disarmed: this loop looks
for them once a second, and arms them by the next fresh command for neutral, one without values. A robot sends that
while its pilot has disarmed it; a robot that brakes for another reason commands a brake with values.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import msgspec

from snr_sim.core.datastore import page_age_s
from snr_sim.devices.commands import ActuatorLoop, ActuatorLoopFactory
from snr_sim.prelude.device import LEASE_S, Actuator
from snr_sim.prelude.errors import DeviceError
from snr_sim.prelude.ground_signals import DriveCommand
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.task import Page

RETRY_PERIOD_S = 1.0
MAX_NOTES = 20  # a loose plug is not logged indefinitely
HOW_TO_ARM = "They are neutral until the robot commands neutral, as one that is disarmed does."


class MotorLoopFactory(ActuatorLoopFactory):
    """Writes the newest page of a key to motors; neutral when there is none or it is too old.

    Args:
        key: of the command page (`DriveCommand`).
        open_device: opens the motors.
        rate_hz: how often they are written.
    """

    def __init__(self, key: str, open_device: Callable[[], Actuator[DriveCommand]], rate_hz: float) -> None:
        super().__init__(key, open_device, rate_hz, LEASE_S)

    def get(self, parent: NodeApi) -> MotorLoop:
        """Return the loop `<key>_actuator`."""
        return MotorLoop(self, parent, f"{self.key}_actuator", self.rate_hz)


class MotorLoop(ActuatorLoop):
    """Writes commands with their lease, and arms motors again that were lost."""

    def setup(self) -> None:
        """Open the motors: neutral and armed."""
        super().setup()
        self._tried_s = -math.inf
        self._health = self.device.health().state, ""
        self._notes = 0

    def loop(self) -> None:
        """Look for lost motors, write the newest command once; neutral if it is too old."""
        now_s = self.get_time_s()
        if self.device.health().state == "error" and now_s >= self._tried_s + RETRY_PERIOD_S:
            self._tried_s = now_s
            with suppress(DeviceError):  # the reason is in the motors' health
                self.device.configure()
        super().loop()
        self._note_change(now_s)

    def read_command(self, page: Page) -> DriveCommand:
        """Return the command in a page, with its lease; one for neutral arms motors that were found again."""
        command: DriveCommand = super().read_command(page)
        if not command.values and self.device.health().state == "inactive":
            self.device.activate()
        now_s = self.get_time_s()
        until_s = min(command.until_s, now_s - page_age_s(self.parent, page) + LEASE_S)
        return msgspec.structs.replace(command, values=command.values if until_s > now_s else [], until_s=until_s)

    def _note_change(self, now_s: float) -> None:
        """Log that motors were lost, found again, and armed."""
        health: Any = self.device.health()
        state, reason = health.state, health.reason
        if (state, reason) == self._health:
            return
        if self._health[0] != state:
            self._tried_s = now_s
        self._health = state, reason
        self._notes += 1
        if self._notes > MAX_NOTES:
            return
        what = {"error": f"error. {reason}", "inactive": f"found again. {HOW_TO_ARM}"}.get(state, "armed again.")
        last = " (not reported again)" if self._notes == MAX_NOTES else ""
        self.parent.add_note(f"Motors of '{self.factory.key}', t = {now_s:.2f} s: {what}{last}")
