"""Motors of all wheels: their base checks commands, clamps them, and gives each a lease. Below it those of a plant.

As with all actuators, `activate` arms them: what was commanded before is not done after it. Each command is a lease: a
wheel without a newer one goes to neutral, which takes two steps and is described at `MotorBackend.neutral`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import msgspec

from snr_sim.devices.commands import check_finite
from snr_sim.devices.motors.handshake import SAME_S
from snr_sim.prelude.device import LEASE_S
from snr_sim.prelude.errors import CommandError, DeviceError, suggest
from snr_sim.prelude.ground_signals import DriveCommand, DriveMode
from snr_sim.prelude.life_cycle import LifeCycle
from snr_sim.prelude.plant import Plant

OFF: DriveMode = "off"
RELEASE_S = 0.1  # without current, until a driven wheel brakes: the reversal of torque spares its gears [O]
TIMEOUT_S = LEASE_S + 0.05  # controllers brake by themselves after it, if they have received nothing newer


class MotorBackend(LifeCycle):
    """Motors. Implements `Actuator`; a backend implements `put`, `brake` and its steps of the life cycle.

    Args:
        now_s: the clock of leases.
        count: how many motors.
        limits: largest amount of a value, for each mode but "off".
    """

    title = "The motors"
    command_type: type[DriveCommand] = DriveCommand

    def __init__(self, now_s: Callable[[], float], count: int, limits: Mapping[str, float]) -> None:
        self._now_s, self._count, self._limits = now_s, count, dict(limits)
        self._mode = "speed"
        self._is_driven = False
        self._released_s = -math.inf

    @property
    def limits(self) -> dict[str, tuple[float, float]]:
        """Lowest and highest value in the mode of the newest command with values; "speed" before the first."""
        largest = self._limits[self._mode]
        return {"values": (-largest, largest)}

    def write(self, command: DriveCommand) -> DriveCommand:
        """Do what a command says, clamped to the limits, for `LEASE_S` at most.

        Returns:
            The command as it is done. One without values, neutral, while they are not active, or if its time is over.

        Raises:
            CommandError: it is not a command of these motors, or a value is not a finite number. The last one stays.
            DeviceError: they were closed.
        """
        if self.state == "closed":
            raise DeviceError(f"{self.title} were closed.", fix="open them again.")
        self._check(command)
        now_s = self._now_s()
        is_valid = command.until_s > now_s  # not if it is NaN
        if self.state == "active" and command.values and is_valid:
            if command.mode != OFF:
                self._mode = command.mode
                largest = self._limits[command.mode]
                values = [min(largest, max(-largest, value)) for value in command.values]
                command = msgspec.structs.replace(command, values=values)
            self._is_driven, self._released_s = command.mode not in ("brake", OFF), -math.inf
            if self.put(command, min(command.until_s, now_s + LEASE_S)):
                return command
        self.neutral()
        return msgspec.structs.replace(command, values=[])

    def _check(self, command: Any) -> None:
        if type(command) is not DriveCommand:
            raise CommandError(
                f"Motors take DriveCommand, not {type(command).__name__}.", fix="DriveCommand('speed', [...])."
            )
        modes = {*self._limits, OFF}
        if command.mode not in modes:
            raise CommandError(f"Motors have no mode '{command.mode}'.", fix=suggest(command.mode, modes))
        if command.values and len(command.values) != self._count:
            raise CommandError(
                f"'drive' has {len(command.values)} values, and there are {self._count} motors.",
                fix=f"send {self._count} finite numbers in the order of the wheels, or none for neutral.",
            )
        largest = self._limits.get(command.mode, math.inf)
        for i, value in enumerate(command.values):
            check_finite(f"drive.values[{i}]", value, (-largest, largest))

    def put(self, command: DriveCommand, until_s: float) -> bool:
        """Send a command with values, which are inside all limits; return False if it is not done, and all must stop.

        Args:
            until_s: end of its lease.
        """
        raise NotImplementedError(f"{type(self).__name__} needs a method put(self, command, until_s)")

    def brake(self) -> None:
        """Brake with the current of neutral, also after `close`. Never raises."""
        raise NotImplementedError(f"{type(self).__name__} needs a method brake(self)")

    def neutral(self) -> None:
        """Let wheels that were driven turn freely for `RELEASE_S`, and brake in calls after that, also after `close`.

        It ends in a brake, since a rover that rolls freely drives down a slope. Call it every few hundredths of a
        second: a controller that receives nothing more brakes after a timeout of its own, which is longer.
        """
        now_s = self._now_s()
        if self._is_driven:
            self._is_driven, self._released_s = False, now_s
        until_s = self._released_s + RELEASE_S
        if now_s < until_s - SAME_S:
            self.put(DriveCommand(OFF, [0.0] * self._count), until_s)
        else:
            self.brake()

    def on_deactivate(self, reason: str) -> None:
        """Go to neutral."""
        self.neutral()


class SimMotors(MotorBackend):
    """Motors of a plant, by its input "drive". `now_s` must equal the plant's time."""

    title = "The simulated motors"

    def __init__(self, plant: Plant, now_s: Callable[[], float], count: int, limits: Mapping[str, float]) -> None:
        super().__init__(now_s, count, limits)
        self._plant = plant

    def put(self, command: DriveCommand, until_s: float) -> bool:
        """Write the command to the plant, which brakes when its lease has been over for some time."""
        late_s = 0.0 if command.mode == OFF else TIMEOUT_S - LEASE_S
        self._plant.write("drive", msgspec.structs.replace(command, until_s=until_s + late_s))
        return True

    def brake(self) -> None:
        """Write the neutral command, which is a brake in a plant."""
        self._plant.write("drive", DriveCommand())

    def on_close(self) -> None:
        """Go to neutral, also if they were never active."""
        self.neutral()
