"""Telemetry of servo pulse outputs: the same for the same calls with every backend."""

from __future__ import annotations

import math
from typing import NamedTuple

from snr_sim.prelude.device import Health, PwmOut
from snr_sim.prelude.signals import (
    CLAMPED,
    LOST,
    NO_PULSE,
    NOT_ACTIVE,
    SLEWING,
    STOPPED,
    TOO_OLD,
    WRONG_COUNT,
    AppliedPulses,
)

STATES = ("unconfigured", "inactive", "activating", "active", "error", "closed")
REASONS = (CLAMPED, SLEWING, NO_PULSE, WRONG_COUNT, TOO_OLD, NOT_ACTIVE, STOPPED, LOST)
_OF_A_STEP = 1e-3  # pulses are whole steps, except for rounding


class AppliedSample(NamedTuple):
    """Expected telemetry of settled outputs.

    Args:
        after: the last action.
        state: of the outputs.
        reasons: why the pulses differ from the command.
        has_why: whether the health gives a reason for its state.
    """

    after: str
    state: str
    reasons: frozenset[str] = frozenset()
    has_reason: bool = False


def check_applied(out: PwmOut, applied: AppliedPulses, expected: AppliedSample) -> None:
    """Check the telemetry of settled outputs.

    Raises:
        AssertionError: with a message that names the broken rule.
    """
    health = out.health()
    found = AppliedSample(expected.after, health.state, frozenset(applied.reason), bool(health.reason))
    require(found == expected, f"after {expected.after} all outputs tell {expected[1:]}, these {found[1:]} ({health})")


def check_answer(out: PwmOut, applied: AppliedPulses, stamp_s: float) -> None:
    """Check the rules for every answer of `write_us`, and for the health after it.

    Args:
        out: the outputs that answered.
        applied: the answer.
        stamp_s: of the command.

    Raises:
        AssertionError: with a message that names the broken rule.
    """
    require(type(applied) is AppliedPulses, f"write_us() returns AppliedPulses, not {applied!r}")
    pulses_us, step_us = applied.pulses_us, out.resolution_us
    low_us, high_us = out.limits_us
    require(len(pulses_us) == out.channels, f"it answers {pulses_us} for {out.channels} channels")
    for pulse_us in pulses_us:
        is_pulse = isinstance(pulse_us, float) and low_us - 1e-9 <= pulse_us <= high_us + 1e-9
        require(is_pulse, f"it answers {pulse_us!r} us, its limits are {low_us:g} to {high_us:g}")
        off_us = abs(pulse_us - round(pulse_us / step_us) * step_us) if step_us else 0.0
        require(off_us <= _OF_A_STEP * step_us, f"it answers {pulse_us!r} us, which is not a multiple of {step_us} us")
    require(applied.stamp_s == stamp_s, f"a command of {stamp_s} s is answered as one of {applied.stamp_s} s")
    is_known = set(applied.reason) <= set(REASONS) and len(set(applied.reason)) == len(applied.reason)
    require(is_known, f"reasons are some of {REASONS}, each once, not {applied.reason}")
    check_health(out)


def check_health(out: PwmOut) -> None:
    """Check the rules for the health of outputs at any time.

    Raises:
        AssertionError: with a message that names the broken rule.
    """
    health = out.health()
    require(type(health) is Health and health.state in STATES, f"health().state is one of {STATES}, not {health}")
    require(
        health.state != "active" or not health.reason, f"of active outputs nothing is wrong, but: {health.reason!r}"
    )
    require(health.state not in ("activating", "error") or bool(health.reason), f"'{health.state}' has a reason")
    counted = all(type(count) is int and count >= 0 for count in health.counts.values())
    require(counted, f"counts are whole numbers from 0 on, not {health.counts}")


def check_stamp(out: PwmOut, applied: AppliedPulses, now_s: float) -> None:
    """Check the answer to a command without a time stamp: it has one all the same, as a page needs one.

    Raises:
        AssertionError: with a message that names the broken rule.
    """
    stamp_s = applied.stamp_s
    is_time = isinstance(stamp_s, float) and math.isfinite(stamp_s) and stamp_s <= now_s
    require(is_time, f"{type(out).__name__} answers at {now_s} s with the stamp {stamp_s!r}")


def require(condition: bool, message: str) -> None:
    """Raise an AssertionError if a rule is broken."""
    if not condition:  # not an assert statement: those go with -O
        raise AssertionError(f"Contract violated: {message}.")
