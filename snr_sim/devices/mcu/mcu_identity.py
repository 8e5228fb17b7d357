"""Check whether a microcontroller may drive thrusters: compares its identity with the requirements.

The computer clamps and counts leases, too; but when the computer fails, only the firmware's limits remain.
"""

from __future__ import annotations

from snr_sim.devices.mcu.mcu_handshake import FLASH
from snr_sim.devices.pwm.pwm_backend import LIMITS_US, STOP_US
from snr_sim.devices.wire.mcu_messages import Ident
from snr_sim.prelude.errors import DeviceError

NAME, CHANNELS = "snr_sim esc", 8  # of our firmware, robots/urov/firmware
MAX_LEASE_MS = 250  # thrusters stop within this time after a computer has failed (docs/hardware.md, H1)
MAX_SLEW_US_PER_100MS = 400  # H7 there
MIN_ESC_START_MS = 1000  # a Basic ESC needs neutral for about so long (Blue Robotics), H4


def check_identity(port: str, ident: Ident, channels: int) -> None:
    """Check that a board meets the requirements.

    Args:
        port: its name in messages.
        ident: the identity it has sent.
        channels: how many are needed.

    Raises:
        DeviceError: it does not; lists all differences.
    """
    wrong = incompatibilities(ident, channels)
    if wrong:
        raise DeviceError(
            f"{port}: the board there must not drive thrusters. It reports: {'; '.join(wrong)}.",
            fix=FLASH if channels <= CHANNELS else f"our firmware has {CHANNELS} channels: add a second board.",
        )


def incompatibilities(ident: Ident, channels: int) -> list[str]:
    """Return each field of a board's identity that does not fit, with the required value; empty if all fit."""
    low_us, high_us = LIMITS_US
    limits_fit = low_us <= ident.lowest_us < STOP_US < ident.highest_us <= high_us
    requirements = (
        (ident.name == NAME, f"its name is '{ident.name}'", f"'{NAME}', our firmware's"),
        (ident.channels >= channels, f"{ident.channels} channels", f"{channels} at least"),
        (ident.neutral_us == STOP_US, f"neutral {ident.neutral_us:g} us", f"{STOP_US:g}"),
        (
            limits_fit,
            f"limits {ident.lowest_us:g} to {ident.highest_us:g} us",
            f"around {STOP_US:g} and within {low_us:g} to {high_us:g}",
        ),
        (
            1 <= ident.max_lease_ms <= MAX_LEASE_MS,
            f"a lease of {ident.max_lease_ms} ms at most",
            f"1 to {MAX_LEASE_MS}",
        ),
        (
            1 <= ident.slew_us_per_100ms <= MAX_SLEW_US_PER_100MS,
            f"slew {ident.slew_us_per_100ms} us in 100 ms",
            f"1 to {MAX_SLEW_US_PER_100MS}",
        ),
        (ident.dwell_ms >= 1, f"a rest of {ident.dwell_ms} ms between ahead and astern", "more than 0"),
        (
            ident.esc_start_ms >= MIN_ESC_START_MS,
            f"neutral shown for {ident.esc_start_ms} ms before arming",
            f"{MIN_ESC_START_MS} at least",
        ),
    )
    return [f"{actual} (required: {required})" for fits, actual, required in requirements if not fits]
