"""Outputs without hardware: the requested pulses are the applied ones. For tutorials and for watching."""

from __future__ import annotations

from snr_sim.devices.pwm.pwm_backend import ImmediateArming


class LoopbackPwm(ImmediateArming):
    """Applies exactly the requested pulses; only its return value shows them."""

    has_independent_failsafe = True
    title = "The loopback outputs"

    def put(self, pulses_us: list[float], stamp_s: float, lease_s: float, reasons: list[str]) -> list[float]:
        """Return the pulses unchanged."""
        return pulses_us
