"""Outputs of servo pulses in a simulated vehicle, and outputs of which the vehicle's water is simulated."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from snr_sim.devices.pwm_backend import LIMITS_US, PwmBackend
from snr_sim.prelude.device import LEASE_S, Health, PwmOut
from snr_sim.prelude.plant import Plant
from snr_sim.prelude.signals import AppliedPulses, PwmCommand


class SimPwm(PwmBackend):
    """Drives an input of a plant, which takes `PwmCommand`s. Its pulses are exact.

    Args:
        plant: what is driven.
        now_s: the clock that commands are stamped by; the plant's time is the same.
        channels: how many thrusters the plant has.
        input_name: name of the plant's input.
    """

    fails_safe_alone = True

    def __init__(
        self,
        plant: Plant,
        now_s: Callable[[], float],
        channels: int,
        input_name: str = "pwm",
        limits_us: tuple[float, float] = LIMITS_US,
    ) -> None:
        super().__init__(now_s, channels, limits_us)
        self.title = f"The simulated output '{input_name}'"
        self._plant, self._input = plant, input_name

    def put(self, pulses_us: list[float], stamp_s: float, lease_s: float, why: list[str]) -> list[float]:
        """Has the plant make them, for as long as the lease lasts."""
        self._plant.write(self._input, PwmCommand(pulses_us, until_s=self._plant.time_s + lease_s))
        return pulses_us

    def on_deactivate(self, reason: str) -> None:
        """Stops."""
        self._plant.write(self._input, PwmCommand())


class BenchPwm:
    """Real outputs on a bench, with the vehicle around them simulated: it is driven by the pulses that are made.

    Args:
        out: the real ones.
        plant: the vehicle.
        input_name: name of the plant's input.
    """

    def __init__(self, out: PwmOut, plant: Plant, input_name: str = "pwm") -> None:
        self._out, self._plant, self._input = out, plant, input_name
        self.channels = out.channels
        self.limits_us = out.limits_us
        self.resolution_us = out.resolution_us
        self.fails_safe_alone = out.fails_safe_alone

    def write_us(self, pulses_us: Sequence[float], stamp_s: float, lease_s: float = LEASE_S) -> AppliedPulses:
        """Asks for pulses; the plant is driven by the answer."""
        applied = self._out.write_us(pulses_us, stamp_s, lease_s)
        self._plant.write(self._input, PwmCommand(applied.pulses_us))
        return applied

    def configure(self) -> None:
        """Opens the outputs."""
        self._out.configure()

    def activate(self) -> None:
        """Arms the outputs."""
        self._out.activate()

    def deactivate(self, reason: str) -> None:
        """Stops both."""
        self._out.deactivate(reason)
        self._plant.write(self._input, PwmCommand())

    def health(self) -> Health:
        """Returns how the outputs are."""
        return self._out.health()

    def close(self) -> None:
        """Lets go of the outputs."""
        self.deactivate("closed")
        self._out.close()
