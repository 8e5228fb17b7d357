"""What outputs of servo pulses tell of themselves: the same of the same calls, whatever is behind them."""

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
_OF_A_STEP = 1e-3  # pulses are whole steps, but for what floats round


class Told(NamedTuple):
    """What is told of outputs once they have settled.

    Args:
        after: what was done last.
        state: of them.
        reasons: why they are not as asked.
        has_why: whether the health says why it is as it is.
    """

    after: str
    state: str
    reasons: frozenset[str] = frozenset()
    has_why: bool = False


def check_told(out: PwmOut, applied: AppliedPulses, told: Told) -> None:
    """Check what is told of settled outputs.

    Raises:
        AssertionError: with the broken promise in words.
    """
    health = out.health()
    found = Told(told.after, health.state, frozenset(applied.why), bool(health.why))
    promise(found == told, f"after {told.after} all outputs tell {told[1:]}, these {found[1:]} ({health})")


def check_answer(out: PwmOut, applied: AppliedPulses, stamp_s: float) -> None:
    """Check what holds of any answer of `write_us`, and of the health with it.

    Args:
        out: who answered.
        applied: the answer.
        stamp_s: of the command.

    Raises:
        AssertionError: with the broken promise in words.
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
    """Check what holds of outputs' health at any time.

    Raises:
        AssertionError: with the broken promise in words.
    """
    health = out.health()
    promise(type(health) is Health and health.state in STATES, f"health() says one of {STATES}, not {health}")
    promise(health.state != "active" or not health.why, f"of active outputs nothing is wrong, but: {health.why!r}")
    promise(health.state not in ("activating", "error") or bool(health.why), f"'{health.state}' says why")
    counted = all(type(count) is int and count >= 0 for count in health.counts.values())
    promise(counted, f"counts are whole numbers from 0 on, not {health.counts}")


def check_stamp(out: PwmOut, applied: AppliedPulses, now_s: float) -> None:
    """Check the answer to a command of no time at all: it has a stamp all the same, as a page needs one.

    Raises:
        AssertionError: with the broken promise in words.
    """
    stamp_s = applied.stamp_s
    is_time = isinstance(stamp_s, float) and math.isfinite(stamp_s) and stamp_s <= now_s
    promise(is_time, f"{type(out).__name__} answers at {now_s} s with the stamp {stamp_s!r}")


def promise(kept: bool, message: str) -> None:
    """Raise an AssertionError with a broken promise."""
    if not kept:  # not an assert statement: those go with -O
        raise AssertionError(f"Promise broken: {message}.")
