"""Engine whose throttle valve, nozzle and jets are servos: converts commands to pulses on three channels and back."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from snr_sim.devices.commands import CommandInput, check_finite, command_of
from snr_sim.devices.pwm.pwm_backend import STOP_US
from snr_sim.devices.pwm.pwm_loop import TIMEOUT_S, PwmLoopFactory
from snr_sim.prelude.device import LEASE_S, PwmOut
from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.signals import EngineCommand, PwmCommand

CHANNELS = 3  # throttle, nozzle, jets
_SPAN_US = 400.0


@dataclass(frozen=True)
class EngineServos:
    """Travel of each servo: at 1500 us shut, straight or off; full travel is 400 us more.

    In steps of half a microsecond, as a microcontroller makes them, that is 1/800 of the throttle, 1/800 of the turn to
    either side and 1/800 of the jets.

    Args:
        gimbal_rad: largest angle of the nozzle.
    """

    gimbal_rad: float

    def __post_init__(self) -> None:
        if not 0.0 < self.gimbal_rad < math.pi:
            raise ParameterError(
                f"gimbal_rad must be from 0 to pi, not {self.gimbal_rad}.", fix="use the largest angle of the nozzle."
            )

    @property
    def limits(self) -> dict[str, tuple[float, float]]:
        """Lowest and highest value of each field of an `EngineCommand`."""
        turn = self.gimbal_rad
        return {"throttle": (0.0, 1.0), "gimbal_rad": (-turn, turn), "attitude": (-1.0, 1.0)}

    def pulses_us(self, command: EngineCommand) -> list[float]:
        """Return the pulses for a command inside the limits.

        >>> EngineServos(0.1).pulses_us(EngineCommand(throttle=0.5, gimbal_rad=-0.1))
        [1700.0, 1100.0, 1500.0]
        """
        fractions = (command.throttle, command.gimbal_rad / self.gimbal_rad, command.attitude)
        return [STOP_US + _SPAN_US * fraction for fraction in fractions]

    def command(self, pulses_us: list[float]) -> EngineCommand:
        """Return the command that pulses mean to the servos."""
        throttle, turn, attitude = ((pulse_us - STOP_US) / _SPAN_US for pulse_us in pulses_us)
        return EngineCommand(max(0.0, throttle), turn * self.gimbal_rad, attitude)


class EnginePwmLoopFactory(PwmLoopFactory):
    """Writes the newest engine command to three servo outputs; neutral when there is none or it is too old.

    A lander has no operator who could arm it: it arms itself at the start. Arguments are those of `PwmLoopFactory`,
    for pages that hold an `EngineCommand`, and `servos`, the conversion between commands and pulses.
    """

    arms_automatically = True

    def __init__(
        self,
        key: str,
        servos: EngineServos,
        open_device: Callable[[], PwmOut],
        rate_hz: float,
        timeout_s: float = TIMEOUT_S,
        lease_s: float = LEASE_S,
    ) -> None:
        super().__init__(key, open_device, rate_hz, timeout_s, lease_s)
        self.servos: EngineServos = servos

    def read_command(self, data: Any, out: PwmOut, commands: CommandInput) -> PwmCommand:
        """Return the pulses for a page's engine command, clamped to the engine's range; errors as `command_of`."""
        limits = self.servos.limits
        command: EngineCommand = command_of(data, EngineCommand, limits)
        clamped = {}
        for field, (low, high) in limits.items():
            value = getattr(command, field)
            check_finite(field, value, (low, high))
            clamped[field] = min(high, max(low, value))
        inside = EngineCommand(**clamped)
        if inside != command:
            commands.note_clamped(command, inside, limits)
        return PwmCommand(self.servos.pulses_us(inside))
