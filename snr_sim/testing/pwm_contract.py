"""Contract of servo pulse outputs: behaviour common to all backends, checked on one, and at its pins if readable.

A backend of your own needs a bench for it, a class with the members of `PwmBench`, and one test:

    def test_it_keeps_the_contract() -> None:
        check_pwm_out(MyBench())
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any, Protocol

from snr_sim.prelude.device import LEASE_S, Health, PwmOut
from snr_sim.prelude.errors import DeviceError
from snr_sim.prelude.interfaces import implements
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
from snr_sim.testing.contracts import require

_STOP_US = 1500.0
_TICK_S = 0.02
_TIMEOUT_S = 10.0  # for arming, and for slow slews
_AT_ONCE_S = 0.05  # a line, and two frames of pulses; well inside the lease
_STATES = ("unconfigured", "inactive", "activating", "active", "error", "closed")
_REASONS = (CLAMPED, SLEWING, NO_PULSE, WRONG_COUNT, TOO_OLD, NOT_ACTIVE, STOPPED, LOST)
_OF_A_STEP = 1e-3  # pulses are whole steps, except for rounding


class PwmBench(Protocol):
    """A bench with outputs on it. Time is simulated, or it is the computer's.

    Attributes:
        can_unplug: whether `unplug` and `plug_in` do something.
    """

    can_unplug: bool

    def open(self) -> PwmOut:
        """Open the outputs, as a robot would."""
        ...

    def now_s(self) -> float:
        """Return the time of the outputs' clock in seconds."""
        ...

    def advance(self, seconds: float) -> None:
        """Advance the time."""
        ...

    def pins_us(self) -> Sequence[float] | None:
        """Return the newest whole pulse at each pin; None where they cannot be seen from outside."""
        ...

    def unplug(self) -> None:
        """Pull the wire."""
        ...

    def plug_in(self) -> None:
        """Put the wire back."""
        ...


def check_pwm_out(bench: PwmBench) -> None:
    """Check outputs on a bench: life cycle, clamping, invalid pulses, lease, arming again, unplugging, telemetry.

    Raises:
        AssertionError: with a message that names the broken rule.
    """
    for check in (_life, _telemetry, _pulses, _nonsense, _lease, _rearm, _unplug, _unplug_early):
        out = bench.open()
        try:
            check(_Pilot(bench, out))
        finally:
            out.close()
            out.close()
        _check_health(out)
        require(out.health().state == "closed", f"after close() the state is '{out.health().state}'")
        out.deactivate("checked")  # safe at any time


class _Pilot:
    """Writes repeatedly, as a loop does, and checks answers and pins."""

    def __init__(self, bench: PwmBench, out: PwmOut) -> None:
        self.bench, self.out = bench, out
        self.still, self.fast = [_STOP_US] * out.channels, [_STOP_US + 200.0] * out.channels

    def write(self, pulses_us: Sequence[Any]) -> AppliedPulses:
        """Write once."""
        stamp_s = self.bench.now_s()
        applied = self.out.write_us(pulses_us, stamp_s)
        _check_answer(self.out, applied, stamp_s)
        return applied

    def hold(self, pulses_us: Sequence[Any], seconds: float) -> AppliedPulses:
        """Write the same for some time; return the last answer."""
        applied = self.write(pulses_us)
        for _ in range(round(seconds / _TICK_S)):
            self.bench.advance(_TICK_S)
            applied = self.write(pulses_us)
        return applied

    def until(self, pulses_us: Sequence[Any], is_so: Callable[[AppliedPulses], bool], what: str) -> AppliedPulses:
        """Write the same until something is so."""
        applied = self.write(pulses_us)
        for _ in range(round(_TIMEOUT_S / _TICK_S)):
            if is_so(applied):
                return applied
            applied = self.hold(pulses_us, _TICK_S)
        raise AssertionError(
            f"Contract violated: {what}; after {_TIMEOUT_S} s it answers {applied}, {self.out.health()}."
        )

    def follow(self, pulses_us: Sequence[Any], what: str = "it follows commands") -> AppliedPulses:
        """Write the same until it is made."""
        return self.until(pulses_us, lambda applied: not applied.reason, what)

    def ready(self) -> None:
        """Configure, activate and wait until commands are followed."""
        self.out.configure()
        self.out.activate()
        self.until(self.still, lambda one: self.out.health().state == "active" and not one.reason, "it becomes active")

    def push(self) -> None:
        """Be ready, and go ahead."""
        self.ready()
        self.follow(self.fast)

    def rests(self, applied: AppliedPulses) -> bool:
        """Return whether all are neutral, to a step."""
        return all(abs(pulse - _STOP_US) <= self.out.resolution_us / 2 + 1e-9 for pulse in applied.pulses_us)

    def check_still(self, when: str, applied: AppliedPulses | None = None) -> AppliedPulses:
        """Check that an answer is neutral on each channel: to a command with thrust, if none is given."""
        if applied is None:
            applied = self.out.write_us([self.out.limits_us[1]] * self.out.channels, self.bench.now_s())
        count = len(applied.pulses_us)
        require(count == self.out.channels, f"{when} it answers {applied.pulses_us} for {self.out.channels} channels")
        require(self.rests(applied), f"{when} all are neutral, not {applied.pulses_us}")
        return applied

    def check_holds_still(self, when: str) -> AppliedPulses:
        """Check answers and pins while thrust is commanded for half a second."""
        applied = self.check_still(f"{when} thrust commanded,", self.hold(self.fast, 0.5))
        self.check_pins(self.still, f"{when} thrust commanded,")
        return applied

    def check_pins(self, expected_us: Sequence[float], when: str) -> None:
        """Check the pins, where they can be seen."""
        pins = self.bench.pins_us()
        if pins is None:
            return
        worst = max(abs(pin - requested) for pin, requested in zip(pins, expected_us, strict=True))
        bound = max(1.0, self.out.resolution_us)
        require(worst <= bound, f"{when} the pins show {list(pins)}, not {list(expected_us)} us")

    def check_state(self, state: str, when: str) -> None:
        """Check the state."""
        require(self.out.health().state == state, f"{when} it is '{self.out.health().state}'")

    def check_refused(self, when: str) -> None:
        """Check that it cannot be activated."""
        try:
            self.out.activate()
        except DeviceError:
            return
        raise AssertionError(f"Contract violated: activate() {when} is refused with a DeviceError.")


def _life(pilot: _Pilot) -> None:
    bench, out = pilot.bench, pilot.out
    low, high = out.limits_us
    require(implements(out, PwmOut), f"{out!r} lacks a member of PwmOut")
    require(out.channels >= 1 and low < _STOP_US < high and 0.0 <= out.resolution_us < 20.0, "channels, limits, steps")
    pilot.check_state("unconfigured", "before configure()")
    pilot.check_refused("before configure()")
    pilot.check_still("before configure()")
    out.configure()
    out.configure()
    pilot.check_state("inactive", "after configure()")
    applied = pilot.check_still("before activate()")
    require(NOT_ACTIVE in applied.reason, f"before activate() the answer has the reason: {applied.reason}")
    pilot.ready()
    pilot.check_pins(pilot.still, "armed, before any command,")
    out.activate()
    out.deactivate("checked")
    out.deactivate("checked")
    pilot.check_state("inactive", "after deactivate()")
    bench.advance(0.1)
    pilot.check_pins(pilot.still, "after deactivate()")
    pilot.check_still("after deactivate()")


def _telemetry(pilot: _Pilot) -> None:
    """Bring outputs into each state, and compare their telemetry with that required of all backends."""
    out, still, fast = pilot.out, pilot.still, pilot.fast

    def check(pulses_us: Sequence[Any], after: str, state: str, *reasons: str, has_health_reason: bool = False) -> None:
        pilot.hold(pulses_us, 0.2)
        applied, health = pilot.hold(pulses_us, _TICK_S), out.health()
        expected = state, frozenset(reasons), has_health_reason
        found = health.state, frozenset(applied.reason), bool(health.reason)
        require(found == expected, f"after {after} all outputs tell {expected}, these {found} ({health})")

    check(fast, "nothing", "unconfigured", NOT_ACTIVE)
    out.configure()
    check(fast, "configure()", "inactive", NOT_ACTIVE)
    out.activate()
    check(fast, "activate(), thrust commanded", "activating", NOT_ACTIVE, has_health_reason=True)
    pilot.ready()
    check(still, "neutral", "active")
    check(fast, "200 us ahead", "active")
    check([out.limits_us[1] + 500.0] * out.channels, "more than full ahead", "active", CLAMPED)
    check([math.nan] * out.channels, "NaN", "active", NO_PULSE)
    check([*fast, _STOP_US], "a pulse too many", "active", WRONG_COUNT)
    out.deactivate("checked")
    check(fast, "deactivate()", "inactive", NOT_ACTIVE, has_health_reason=True)
    out.stop()
    check(fast, "stop()", "inactive", NOT_ACTIVE, STOPPED, has_health_reason=True)
    out.clear_stop()
    check(fast, "clear_stop()", "inactive", NOT_ACTIVE, has_health_reason=True)
    out.close()
    check(fast, "close()", "closed", NOT_ACTIVE, has_health_reason=True)


def _pulses(pilot: _Pilot) -> None:
    out = pilot.out
    pilot.ready()
    low, high = out.limits_us
    step = max(out.resolution_us, 1e-9)
    each = [low + (high - low) * (i + 0.37) / out.channels for i in range(out.channels)]
    for requested in (each, each[::-1], [low] * out.channels, [high] * out.channels):
        applied = pilot.follow(requested, f"pulses {requested} are reached")
        worst = max(abs(got - asked) for got, asked in zip(applied.pulses_us, requested, strict=True))
        require(worst <= step, f"{requested} were asked for, {applied.pulses_us} made: resolution_us is {step}")
        pilot.hold(requested, 0.1)
        pilot.check_pins(applied.pulses_us, f"commanded {requested}")
    for beyond, limit in ((high + 500.0, high), (0.0, low), (-1e300, low), (1e300, high)):
        asked, what = [beyond] * out.channels, f"{beyond} us is clamped, and the reason reports it"
        applied = pilot.until(asked, lambda applied: applied.reason == [CLAMPED], what)
        require(all(abs(one - limit) <= step for one in applied.pulses_us), f"{beyond} us became {applied.pulses_us}")
        pilot.hold(asked, 0.1)
        pilot.check_pins(applied.pulses_us, f"commanded {beyond} us")


def _nonsense(pilot: _Pilot) -> None:
    fast = pilot.fast
    pilot.ready()
    no_pulses: list[Any] = [math.nan, math.inf, -math.inf, None, "1500", [], True]
    cases: list[tuple[Any, str]] = [([one, *fast[1:]], NO_PULSE) for one in no_pulses]
    for bad, reason in [*cases, (fast[1:], WRONG_COUNT), ([*fast, _STOP_US], WRONG_COUNT), ([], WRONG_COUNT)]:
        pilot.follow(fast, "it takes commands again after an invalid one")
        applied = pilot.until(bad, pilot.rests, f"{bad} makes all neutral")
        require(reason in applied.reason, f"{bad} is answered with {applied.reason}, not '{reason}'")


def _lease(pilot: _Pilot) -> None:
    bench, out = pilot.bench, pilot.out
    pilot.push()
    now_s = bench.now_s()
    stamps: list[Any] = [now_s - 2.0 * LEASE_S, now_s + 0.5, math.nan, -math.inf, math.inf, 1e300, None, "now"]
    for asked_s in stamps:
        applied = out.write_us(pilot.fast, asked_s)
        require(
            TOO_OLD in applied.reason, f"a command of {asked_s} at {bench.now_s()} s is too old, but: {applied.reason}"
        )
        stamp_s = applied.stamp_s  # it has one all the same, as a page needs one
        is_time = isinstance(stamp_s, float) and math.isfinite(stamp_s) and stamp_s <= bench.now_s()
        require(is_time, f"{type(out).__name__} answers at {bench.now_s()} s with the stamp {stamp_s!r}")
    pilot.until(pilot.still, lambda one: out.health().state != "active" or not one.reason, "neutral is taken")
    pilot.push()
    if out.has_independent_failsafe:
        bench.advance(LEASE_S + 0.05)
        pilot.check_pins(pilot.still, f"{LEASE_S + 0.05:g} s after the last command")


def _rearm(pilot: _Pilot) -> None:
    bench, out = pilot.bench, pilot.out
    pilot.push()
    out.deactivate("checked")
    bench.advance(_AT_ONCE_S)
    pilot.check_pins(pilot.still, "soon after deactivate()")
    pilot.check_holds_still("0.5 s after deactivate(),")
    out.activate()
    pilot.check_holds_still("activated, and never commanded neutral,")
    pilot.push()
    out.stop()
    bench.advance(_AT_ONCE_S)
    pilot.check_pins(pilot.still, "soon after stop()")
    applied = pilot.check_holds_still("0.5 s after an emergency stop,")
    require(STOPPED in applied.reason, f"after an emergency stop the answer has the reason: {applied.reason}")
    pilot.check_refused("during an emergency stop")
    out.clear_stop()
    pilot.check_still("after clear_stop(), thrust commanded,", pilot.hold(pilot.fast, 0.5))
    pilot.push()


def _unplug(pilot: _Pilot) -> None:
    bench, out = pilot.bench, pilot.out
    if not bench.can_unplug:
        return
    pilot.push()
    bench.unplug()
    pilot.until(pilot.fast, lambda applied: LOST in applied.reason, "a pulled wire is reported")
    health = out.health()
    require(health.state == "error" and bool(health.reason), f"unplugged, the health is {health}")
    bench.advance(LEASE_S + 0.05)
    if out.has_independent_failsafe:
        pilot.check_pins(pilot.still, "unplugged")
    bench.plug_in()
    out.configure()
    pilot.check_state("inactive", "opened again by configure()")
    pilot.push()


def _unplug_early(pilot: _Pilot) -> None:
    """Pull the wire at each step of the life; whatever is called then, only `configure` and `activate` may raise."""
    bench, out = pilot.bench, pilot.out
    if not bench.can_unplug:
        return
    steps = {"inactive": out.configure, "activating": out.activate}
    for requested in ("unconfigured", *steps):
        for state, step in steps.items():
            if requested != "unconfigured" and out.health().state != requested:
                step()
                pilot.check_state(state, f"on the way to '{requested}'")
        bench.unplug()
        for _ in range(round(1.0 / _TICK_S)):
            pilot.check_still(f"unplugged while {requested}, thrust commanded,")
            bench.advance(_TICK_S)
        for call in (out.stop, out.clear_stop, lambda: out.deactivate("checked")):
            call()
            _check_health(out)
        for step in steps.values():
            with suppress(DeviceError):
                step()
        pilot.check_still(f"unplugged while {requested}, and tried again,")
        bench.plug_in()
        out.configure()
        pilot.check_state("inactive", "plugged in again")
        out.deactivate("checked")


def _check_answer(out: PwmOut, applied: AppliedPulses, stamp_s: float) -> None:
    """Check the rules for every answer of `write_us` to a command of `stamp_s`, and for the health after it."""
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
    is_known = set(applied.reason) <= set(_REASONS) and len(set(applied.reason)) == len(applied.reason)
    require(is_known, f"reasons are some of {_REASONS}, each once, not {applied.reason}")
    _check_health(out)


def _check_health(out: PwmOut) -> None:
    """Check the rules for the health of outputs at any time."""
    health = out.health()
    require(type(health) is Health and health.state in _STATES, f"health().state is one of {_STATES}, not {health}")
    require(
        health.state != "active" or not health.reason, f"of active outputs nothing is wrong, but: {health.reason!r}"
    )
    require(health.state not in ("activating", "error") or bool(health.reason), f"'{health.state}' has a reason")
    counted = all(type(count) is int and count >= 0 for count in health.counts.values())
    require(counted, f"counts are whole numbers from 0 on, not {health.counts}")
