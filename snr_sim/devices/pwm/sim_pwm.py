"""Outputs of servo pulses in a simulated vehicle, and outputs of which the vehicle's water is simulated."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from snr_sim.devices.pwm.pwm_backend import LIMITS_US, STOP_US, PlainlyArmed
from snr_sim.prelude.device import LEASE_S, Health, PwmOut
from snr_sim.prelude.plant import Plant
from snr_sim.prelude.signals import AppliedPulses, PwmCommand


class SimPwm(PlainlyArmed):
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

    def on_configure(self) -> None:
        """Makes neutral pulses, so that speed controllers start."""
        self._plant.write(self._input, PwmCommand())

    def on_deactivate(self, reason: str) -> None:
        """Stops."""
        self._plant.write(self._input, PwmCommand())


class BenchPwm:
    """Real outputs on a bench, with the vehicle around them simulated: it is driven by the pulses that are made.

    Args:
        out: the real ones.
        plant: the vehicle.
        input_name: name of the plant's input.
        command_of: makes that input's command of the pulses [us].
    """

    def __init__(
        self,
        out: PwmOut,
        plant: Plant,
        input_name: str = "pwm",
        command_of: Callable[[list[float]], Any] = PwmCommand,
    ) -> None:
        self._out, self._plant, self._input, self._command_of = out, plant, input_name, command_of

    @property
    def channels(self) -> int:
        """How many outputs it has."""
        return self._out.channels

    @property
    def limits_us(self) -> tuple[float, float]:
        """Shortest and longest pulse that it makes; some outputs tell only once they are configured."""
        return self._out.limits_us

    @property
    def resolution_us(self) -> float:
        """Pulses are whole multiples of this."""
        return self._out.resolution_us

    @property
    def fails_safe_alone(self) -> bool:
        """Whether the outputs go to neutral when this program is killed."""
        return self._out.fails_safe_alone

    def write_us(self, pulses_us: Sequence[float], stamp_s: float, lease_s: float = LEASE_S) -> AppliedPulses:
        """Asks for pulses; the plant is driven by the answer."""
        applied = self._out.write_us(pulses_us, stamp_s, lease_s)
        self._drive(applied.pulses_us)
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
        self._drive([STOP_US] * self._out.channels)

    def stop(self) -> None:
        """Stops both until `clear_stop`."""
        self._out.stop()
        self._drive([STOP_US] * self._out.channels)

    def clear_stop(self) -> None:
        """Ends an emergency stop of the outputs."""
        self._out.clear_stop()

    def health(self) -> Health:
        """Returns how the outputs are."""
        return self._out.health()

    def close(self) -> None:
        """Lets go of the outputs."""
        self.deactivate("closed")
        self._out.close()

    def _drive(self, pulses_us: list[float]) -> None:
        self._plant.write(self._input, self._command_of(pulses_us))
