"""Servo outputs without hardware: of a simulated vehicle, or none; real ones on a bench that drive a simulated one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from snr_sim.devices.pwm.pwm_backend import LIMITS_US, ImmediateArming, PwmBackend
from snr_sim.prelude.plant import Plant
from snr_sim.prelude.signals import PwmCommand


class SimPwm(ImmediateArming):
    """Drives an input of a plant that accepts `PwmCommand`s. Its pulses are exact.

    `now_s`, the clock of command stamps, must equal the plant's time.
    """

    has_independent_failsafe = True

    def __init__(
        self,
        plant: Plant,
        now_s: Callable[[], float],
        channels: int,
        input_name: str = "pwm",
        limits_us: tuple[float, float] = LIMITS_US,
    ) -> None:
        super().__init__(now_s, channels, limits_us)
        self.title: str = f"The simulated output '{input_name}'"
        self._plant, self._input = plant, input_name

    def put(self, pulses_us: list[float], stamp_s: float, lease_s: float, reasons: list[str]) -> list[float]:
        """Write the pulses to the plant, valid until the lease expires."""
        self._plant.write(self._input, PwmCommand(pulses_us, until_s=self._plant.time_s + lease_s))
        return pulses_us

    def on_configure(self) -> None:
        """Send neutral, so that speed controllers start."""
        self._plant.write(self._input, PwmCommand())

    def on_deactivate(self, reason: str) -> None:
        """Send neutral."""
        self._plant.write(self._input, PwmCommand())


def drive_plant(
    out: PwmBackend, plant: Plant, input_name: str = "pwm", command_of: Callable[[list[float]], Any] = PwmCommand
) -> PwmBackend:
    """Drive a simulated vehicle with the applied pulses of real outputs on a bench; return the outputs.

    `command_of` makes the command of the plant's input from the pulses [us].
    """
    out.follower = lambda pulses_us: plant.write(input_name, command_of(pulses_us))
    return out


class LoopbackPwm(ImmediateArming):
    """Applies exactly the requested pulses; only its return value shows them."""

    has_independent_failsafe = True
    title = "The loopback outputs"

    def put(self, pulses_us: list[float], stamp_s: float, lease_s: float, reasons: list[str]) -> list[float]:
        """Return the pulses unchanged."""
        return pulses_us
