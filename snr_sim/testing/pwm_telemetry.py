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


class Told(NamedTuple):
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
    has_why: bool = False


def check_told(out: PwmOut, applied: AppliedPulses, told: Told) -> None:
    """Check the telemetry of settled outputs.

    Raises:
        AssertionError: with a message that names the broken rule.
    """
    health = out.health()
    found = Told(told.after, health.state, frozenset(applied.why), bool(health.why))
    promise(found == told, f"after {told.after} all outputs tell {told[1:]}, these {found[1:]} ({health})")


def check_answer(out: PwmOut, applied: AppliedPulses, stamp_s: float) -> None:
    """Check the rules for every answer of `write_us`, and for the health after it.

    Args:
        out: the outputs that answered.
        applied: the answer.
        stamp_s: of the command.

    Raises:
        AssertionError: with a message that names the broken rule.
    """
    promise(type(applied) is AppliedPulses, f"write_us() returns AppliedPulses, not {applied!r}")
    pulses_us, step_us = applied.pulses_us, out.resolution_us
    low_us, high_us = out.limits_us
    promise(len(pulses_us) == out.channels, f"it answers {pulses_us} for {out.channels} channels")
    for pulse_us in pulses_us:
        is_pulse = isinstance(pulse_us, float) and low_us - 1e-9 <= pulse_us <= high_us + 1e-9
        promise(is_pulse, f"it answers {pulse_us!r} us, its limits are {low_us:g} to {high_us:g}")
        off_us = abs(pulse_us - round(pulse_us / step_us) * step_us) if step_us else 0.0
        promise(off_us <= _OF_A_STEP * step_us, f"it answers {pulse_us!r} us, which is no multiple of {step_us} us")
    promise(applied.stamp_s == stamp_s, f"a command of {stamp_s} s is answered as one of {applied.stamp_s} s")
    is_known = set(applied.why) <= set(REASONS) and len(set(applied.why)) == len(applied.why)
    promise(is_known, f"reasons are some of {REASONS}, each once, not {applied.why}")
    check_health(out)


def check_health(out: PwmOut) -> None:
    """Check the rules for the health of outputs at any time.

    Raises:
        AssertionError: with a message that names the broken rule.
    """
    health = out.health()
    promise(type(health) is Health and health.state in STATES, f"health() says one of {STATES}, not {health}")
    promise(health.state != "active" or not health.why, f"of active outputs nothing is wrong, but: {health.why!r}")
    promise(health.state not in ("activating", "error") or bool(health.why), f"'{health.state}' says why")
    counted = all(type(count) is int and count >= 0 for count in health.counts.values())
    promise(counted, f"counts are whole numbers from 0 on, not {health.counts}")


def check_stamp(out: PwmOut, applied: AppliedPulses, now_s: float) -> None:
    """Check the answer to a command without a time stamp: it has one all the same, as a page needs one.

    Raises:
        AssertionError: with a message that names the broken rule.
    """
    stamp_s = applied.stamp_s
    is_time = isinstance(stamp_s, float) and math.isfinite(stamp_s) and stamp_s <= now_s
    promise(is_time, f"{type(out).__name__} answers at {now_s} s with the stamp {stamp_s!r}")


def promise(kept: bool, message: str) -> None:
    """Raise an AssertionError if a rule is broken."""
    if not kept:  # not an assert statement: those go with -O
        raise AssertionError(f"Promise broken: {message}.")
