"""What drives the vehicle: its thrusters, by pulses, or a wrench that is asked for."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from snr_sim.plants.parameter_limits import format_value
from snr_sim.plants.urov.hydrodynamics import AT_REST
from snr_sim.plants.urov.motion import Motion
from snr_sim.plants.urov.propulsion import PULSE_RANGE_US, Propulsion
from snr_sim.plants.urov.surface import Surface
from snr_sim.plants.urov.t200 import STOP_US
from snr_sim.plants.urov.urov_state import WrenchCommand
from snr_sim.plants.urov.vehicle import Six, Vehicle
from snr_sim.prelude.errors import CommandError, UnknownNameError, suggest
from snr_sim.prelude.signals import PwmCommand
from snr_sim.prelude.sums import ordered_sum


class Drive:
    """The plant's one input: pulses, or a wrench where no thrusters turn pulses into forces."""

    def __init__(self, vehicle: Vehicle, thrusters: Propulsion | None, surface: Surface, motion: Motion) -> None:
        self.inputs: tuple[str, ...] = ("wrench",) if thrusters is None else ("pwm",)
        self.wrench: Six = AT_REST  # that is asked for, body frame
        self.pulses: list[float | None] = []  # of each thruster [us], None where none comes; replaced, never changed
        self.until_s: float = math.inf  # when the pulses end unless there are others
        self._vehicle, self._thrusters, self._surface, self._motion = vehicle, thrusters, surface, motion
        self._matrix = vehicle.thruster_matrix()

    def write(self, name: str, command: Any) -> None:
        """Set pulses or wrench, which hold until they are set again."""
        if name not in self.inputs:
            raise UnknownNameError(f"This plant has no input '{name}'.", fix=suggest(name, self.inputs))
        time_s = self._motion.time_s
        try:
            if name == "pwm":
                pulses, until_s = self._checked_pulses(command), command.until_s
                if math.isnan(until_s):
                    raise CommandError(
                        f"At {time_s:g} s the vehicle was sent pulses until nan s.",
                        fix="until_s is a time of the plant's; leave it out, and they hold until there are others.",
                    )
                self.pulses, self.until_s = pulses, until_s
            else:
                self.wrench = self._checked_wrench(command)
        except (AttributeError, TypeError) as error:  # of another kind, or made of something else than numbers
            kind = "PwmCommand" if name == "pwm" else "WrenchCommand"
            raise CommandError(
                f"At {time_s:g} s the vehicle got an invalid command: {format_value(command)}.",
                fix=f"send a {kind} of numbers.",
            ) from error

    def _checked_wrench(self, command: WrenchCommand) -> Six:
        values = [*command.force_n, *command.moment_nm]
        if len(command.force_n) != 3 or len(command.moment_nm) != 3 or not math.isfinite(ordered_sum(values)):
            raise CommandError(
                f"At {self._motion.time_s:g} s the vehicle got an invalid command: {command}.",
                fix="send six finite numbers: x, y and z of force_n, and x, y and z of moment_nm.",
            )
        x, y, z, k, m, n = values
        return x, y, z, k, m, n

    def _checked_pulses(self, command: PwmCommand) -> list[float | None]:
        count, time_s = len(self._vehicle.thrusters), self._motion.time_s
        if not command.is_on:
            return [None] * count
        pulses = command.pulses_us or [STOP_US] * count
        if len(pulses) != count or not math.isfinite(ordered_sum(pulses)):
            raise CommandError(
                f"At {time_s:g} s {count} thrusters were sent the pulses {command.pulses_us}.",
                fix=f"send {count} finite numbers, 1500 to stop; or is_on=False for no pulses.",
            )
        min_us, max_us = PULSE_RANGE_US
        for thruster, pulse in zip(self._vehicle.thrusters, pulses, strict=True):
            if not min_us <= pulse <= max_us:
                raise CommandError(
                    f"At {time_s:g} s thruster '{thruster.name}' was sent a pulse of {pulse!r} us.",
                    fix="1100 to 1900 us, 1500 to stop; or is_on=False for no pulses.",
                )
        return list(pulses)

    def advance(self, now_s: float) -> Sequence[float]:
        """Move the thrusters on by a step; return their wrench, less what draws air, or the one that was asked for."""
        thrusters, motion = self._thrusters, self._motion
        if thrusters is None:
            return self.wrench
        if now_s >= self.until_s:  # the pulses were not renewed in time
            self.pulses, self.until_s = [STOP_US] * len(self.pulses), math.inf
        thrusters.step(motion.step_s, self.pulses)
        z = motion.position[2]
        if z <= -self._surface.reach_m:
            return thrusters.mix_forces(self._matrix)
        forces = np.array(thrusters.mean_forces_n) * self._surface.propeller_immersion(z, motion.rotation[6:])
        wrench: list[float] = np.add.reduce(self._matrix * forces, axis=1).tolist()
        return wrench
