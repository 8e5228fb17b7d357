"""Outputs without anything behind them: what is asked for is what is made. For tutorials, and for looking on."""

from __future__ import annotations

from snr_sim.devices.pwm.pwm_backend import PlainlyArmed


class MirrorPwm(PlainlyArmed):
    """Makes just the pulses that it is told; its answer is all that shows them."""

    fails_safe_alone = True
    title = "The mirror"

    def put(self, pulses_us: list[float], stamp_s: float, lease_s: float, why: list[str]) -> list[float]:
        """Return them."""
        return pulses_us
