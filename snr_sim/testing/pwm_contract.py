"""The contract of outputs of servo pulses: what every backend does alike, checked on one, and at its pins if they show.

A backend of your own is checked by a bench for it, a class with the members of `PwmBench`, and one test:

    def test_it_keeps_thepromise() -> None:
        check_pwm_out(MyBench())
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any, Protocol

from snr_sim.prelude.device import LEASE_S, PwmOut
from snr_sim.prelude.errors import DeviceError
from snr_sim.prelude.promises import keeps
from snr_sim.prelude.signals import CLAMPED, LOST, NO_PULSE, NOT_ACTIVE, STOPPED, TOO_OLD, WRONG_COUNT, AppliedPulses
from snr_sim.testing.pwm_telemetry import Told, check_answer, check_health, check_stamp, check_told, promise

STOP_US = 1500.0
TICK_S = 0.02
PATIENCE_S = 10.0  # for arming, and for slow slews
AT_ONCE_S = 0.05  # a line, and two frames of pulses; well inside the lease


class PwmBench(Protocol):
    """A bench with outputs on it. Time is simulated, or it is the computer's.

    Attributes:
        can_unplug: whether `unplug` and `plug_in` do something.
    """

    can_unplug: bool

    def open(self) -> PwmOut:
        """Opens the outputs, as a robot would."""
        ...

    def now_s(self) -> float:
        """Returns the time that the outputs go by."""
        ...

    def advance(self, seconds: float) -> None:
        """Lets time go on."""
        ...

    def pins_us(self) -> Sequence[float] | None:
        """Returns the newest whole pulse at each pin; None where they cannot be seen from outside."""
        ...

    def unplug(self) -> None:
        """Pulls the wire."""
        ...

    def plug_in(self) -> None:
        """Puts the wire back."""
        ...


def check_pwm_out(bench: PwmBench) -> None:
    """Checks outputs on a bench: life cycle, clamping, what is no pulse, lease, arming again, unplugging, what is told.

    Raises:
        AssertionError: with the broken promise in words.
    """
    for check in (_life, _telemetry, _pulses, _nonsense, _lease, _rearm, _unplug, _unplug_early):
        out = bench.open()
        try:
            check(bench, out)
        finally:
            out.close()
            out.close()
        check_health(out)
        promise(out.health().state == "closed", f"after close() the state is '{out.health().state}'")
        out.deactivate("checked")  # safe at any time


class _Pilot:
    """Writes again and again, as a loop does."""

    def __init__(self, bench: PwmBench, out: PwmOut) -> None:
        self.bench, self.out = bench, out

    def hold(self, pulses_us: Sequence[Any], seconds: float) -> AppliedPulses:
        """Writes the same for some time; returns the last answer."""
        applied = self._write(pulses_us)
        for _ in range(round(seconds / TICK_S)):
            self.bench.advance(TICK_S)
            applied = self._write(pulses_us)
        return applied

    def _write(self, pulses_us: Sequence[Any]) -> AppliedPulses:
        stamp_s = self.bench.now_s()
        applied = self.out.write_us(pulses_us, stamp_s)
        check_answer(self.out, applied, stamp_s)
        return applied

    def until(self, pulses_us: Sequence[Any], is_so: Callable[[AppliedPulses], bool], what: str) -> AppliedPulses:
        """Writes the same until something is so."""
        applied = self.hold(pulses_us, 0.0)
        for _ in range(round(PATIENCE_S / TICK_S)):
            if is_so(applied):
                return applied
            applied = self.hold(pulses_us, TICK_S)
        raise AssertionError(f"Promise broken: {what}; after {PATIENCE_S} s it answers {applied}, {self.out.health()}.")

    def ready(self) -> None:
        """Configures, activates and waits until commands are followed."""
        self.out.configure()
        self.out.activate()
        still = [STOP_US] * self.out.channels
        self.until(still, lambda applied: self.out.health().state == "active" and not applied.why, "it becomes active")

    def check_pins(self, wanted_us: Sequence[float], when: str) -> None:
        pins = self.bench.pins_us()
        if pins is None:
            return
        worst = max(abs(pin - wanted) for pin, wanted in zip(pins, wanted_us, strict=True))
        bound = max(1.0, self.out.resolution_us)
        promise(worst <= bound, f"{when} the pins show {list(pins)}, not {list(wanted_us)} us")


def _life(bench: PwmBench, out: PwmOut) -> None:
    low, high = out.limits_us
    promise(keeps(out, PwmOut), f"{out!r} lacks a member of PwmOut")
    promise(out.channels >= 1 and low < STOP_US < high and 0.0 <= out.resolution_us < 20.0, "channels, limits, steps")
    promise(out.health().state == "unconfigured", f"before configure() it is '{out.health().state}'")
    try:
        out.activate()
    except DeviceError:
        pass
    else:
        raise AssertionError("Promise broken: activate() before configure() is refused with a DeviceError.")
    _is_still(out, out.write_us([high] * out.channels, bench.now_s()), "before configure()")
    out.configure()
    out.configure()
    promise(out.health().state == "inactive", f"after configure() it is '{out.health().state}'")
    applied = out.write_us([high] * out.channels, bench.now_s())
    _is_still(out, applied, "before activate()")
    promise(NOT_ACTIVE in applied.why, f"before activate() the answer says why: {applied.why}")
    pilot = _Pilot(bench, out)
    pilot.ready()
    pilot.check_pins([STOP_US] * out.channels, "armed, before any command,")
    out.activate()
    out.deactivate("checked")
    out.deactivate("checked")
    promise(out.health().state == "inactive", f"after deactivate() it is '{out.health().state}'")
    bench.advance(0.1)
    pilot.check_pins([STOP_US] * out.channels, "after deactivate()")
    _is_still(out, out.write_us([high] * out.channels, bench.now_s()), "after deactivate()")


def _telemetry(bench: PwmBench, out: PwmOut) -> None:
    """Brings outputs into each state, and holds what they tell there against what all tell."""
    pilot = _Pilot(bench, out)
    n, high_us = out.channels, out.limits_us[1]
    still, fast = [STOP_US] * n, [STOP_US + 200.0] * n
    not_active, stopped = frozenset([NOT_ACTIVE]), frozenset([NOT_ACTIVE, STOPPED])

    def check(pulses_us: Sequence[Any], told: Told) -> None:
        pilot.hold(pulses_us, 0.2)
        check_told(out, pilot.hold(pulses_us, TICK_S), told)

    check(fast, Told("nothing", "unconfigured", not_active))
    out.configure()
    check(fast, Told("configure()", "inactive", not_active))
    out.activate()
    check(fast, Told("activate(), told to push", "activating", not_active, has_why=True))
    pilot.ready()
    check(still, Told("neutral", "active"))
    check(fast, Told("200 us ahead", "active"))
    check([high_us + 500.0] * n, Told("more than full ahead", "active", frozenset([CLAMPED])))
    check([math.nan] * n, Told("NaN", "active", frozenset([NO_PULSE])))
    check([*fast, STOP_US], Told("a pulse too many", "active", frozenset([WRONG_COUNT])))
    out.deactivate("checked")
    check(fast, Told("deactivate()", "inactive", not_active, has_why=True))
    out.stop()
    check(fast, Told("stop()", "inactive", stopped, has_why=True))
    out.clear_stop()
    check(fast, Told("clear_stop()", "inactive", not_active, has_why=True))
    out.close()
    check(fast, Told("close()", "closed", not_active, has_why=True))


def _pulses(bench: PwmBench, out: PwmOut) -> None:
    pilot = _Pilot(bench, out)
    pilot.ready()
    low, high = out.limits_us
    step = max(out.resolution_us, 1e-9)
    each = [low + (high - low) * (i + 0.37) / out.channels for i in range(out.channels)]
    for wanted in (each, each[::-1], [low] * out.channels, [high] * out.channels):
        applied = pilot.until(wanted, lambda applied: not applied.why, f"pulses {wanted} are reached")
        worst = max(abs(got - asked) for got, asked in zip(applied.pulses_us, wanted, strict=True))
        promise(worst <= step, f"{wanted} were asked for, {applied.pulses_us} made: resolution_us is {step}")
        pilot.hold(wanted, 0.1)
        pilot.check_pins(applied.pulses_us, f"told {wanted}")
    for beyond, limit in ((high + 500.0, high), (0.0, low), (-1e300, low), (1e300, high)):
        asked = [beyond] * out.channels
        applied = pilot.until(
            asked, lambda applied: applied.why == [CLAMPED], f"{beyond} us is clamped, and that is said"
        )
        promise(all(abs(one - limit) <= step for one in applied.pulses_us), f"{beyond} us became {applied.pulses_us}")
        pilot.hold(asked, 0.1)
        pilot.check_pins(applied.pulses_us, f"told {beyond} us")


def _nonsense(bench: PwmBench, out: PwmOut) -> None:
    pilot = _Pilot(bench, out)
    pilot.ready()
    n = out.channels
    fast = [STOP_US + 200.0] * n
    bad_pulses: list[Any] = [math.nan, math.inf, -math.inf, None, "1500", [], True]
    cases: list[tuple[Any, str]] = [
        *(([one, *fast[1:]], NO_PULSE) for one in bad_pulses),
        (fast[1:], WRONG_COUNT),
        ([*fast, STOP_US], WRONG_COUNT),
        ([], WRONG_COUNT),
    ]
    for bad, why in cases:
        pilot.until(fast, lambda applied: not applied.why, "it takes commands again after one that is none")
        applied = pilot.until(bad, lambda applied: _rests(out, applied), f"{bad} makes all neutral")
        promise(why in applied.why, f"{bad} is answered with {applied.why}, not '{why}'")


def _lease(bench: PwmBench, out: PwmOut) -> None:
    pilot = _Pilot(bench, out)
    pilot.ready()
    fast = [STOP_US + 200.0] * out.channels
    pilot.until(fast, lambda applied: not applied.why, "it follows commands")
    for stamp_s in (
        bench.now_s() - 2.0 * LEASE_S,
        bench.now_s() + 0.5,
        math.nan,
        -math.inf,
        math.inf,
        1e300,
        None,
        "now",
    ):
        applied = out.write_us(fast, stamp_s)  # type: ignore[arg-type]
        promise(TOO_OLD in applied.why, f"a command of {stamp_s} at {bench.now_s()} s is too old, but: {applied.why}")
        check_stamp(out, applied, bench.now_s())
    still = [STOP_US] * out.channels
    pilot.until(still, lambda applied: out.health().state != "active" or not applied.why, "neutral is taken")
    pilot.ready()
    pilot.until(fast, lambda applied: not applied.why, "it follows commands again")
    if not out.fails_safe_alone:
        return
    bench.advance(LEASE_S + 0.05)
    pilot.check_pins(still, f"{LEASE_S + 0.05:g} s after the last command")


def _rearm(bench: PwmBench, out: PwmOut) -> None:
    pilot = _Pilot(bench, out)
    pilot.ready()
    fast = [STOP_US + 200.0] * out.channels
    pilot.until(fast, lambda applied: not applied.why, "it follows commands")
    out.deactivate("checked")
    bench.advance(AT_ONCE_S)
    pilot.check_pins([STOP_US] * out.channels, "soon after deactivate()")
    applied = pilot.hold(fast, 0.5)
    _is_still(out, applied, "0.5 s after deactivate(), told to push,")
    pilot.check_pins([STOP_US] * out.channels, "0.5 s after deactivate(), told to push,")
    out.activate()
    applied = pilot.hold(fast, 0.5)
    _is_still(out, applied, "activated while told to push, and never told neutral,")
    pilot.check_pins([STOP_US] * out.channels, "activated while told to push, and never told neutral,")
    pilot.ready()
    pilot.until(fast, lambda applied: not applied.why, "it follows commands")
    out.stop()
    bench.advance(AT_ONCE_S)
    pilot.check_pins([STOP_US] * out.channels, "soon after stop()")
    applied = pilot.hold(fast, 0.5)
    _is_still(out, applied, "0.5 s after an emergency stop, told to push,")
    pilot.check_pins([STOP_US] * out.channels, "0.5 s after an emergency stop, told to push,")
    promise(STOPPED in applied.why, f"after an emergency stop the answer says why: {applied.why}")
    try:
        out.activate()
    except DeviceError:
        pass
    else:
        raise AssertionError("Promise broken: activate() during an emergency stop is refused with a DeviceError.")
    out.clear_stop()
    applied = pilot.hold(fast, 0.5)
    _is_still(out, applied, "after clear_stop(), told to push,")
    pilot.ready()
    pilot.until(fast, lambda applied: not applied.why, "it follows commands after activate()")


def _unplug(bench: PwmBench, out: PwmOut) -> None:
    if not bench.can_unplug:
        return
    pilot = _Pilot(bench, out)
    pilot.ready()
    fast = [STOP_US + 200.0] * out.channels
    pilot.until(fast, lambda applied: not applied.why, "it follows commands")
    bench.unplug()
    pilot.until(fast, lambda applied: LOST in applied.why, "a wire that was pulled is told")
    health = out.health()
    promise(health.state == "error" and bool(health.why), f"unplugged, the health is {health}")
    bench.advance(LEASE_S + 0.05)
    if out.fails_safe_alone:
        pilot.check_pins([STOP_US] * out.channels, "unplugged")
    bench.plug_in()
    out.configure()
    promise(out.health().state == "inactive", "configure() opens it again, inactive")
    pilot.ready()
    pilot.until(fast, lambda applied: not applied.why, "it follows commands again")


def _unplug_early(bench: PwmBench, out: PwmOut) -> None:
    """Pulls the wire at each step of the life; whatever is called then, only `configure` and `activate` may raise."""
    if not bench.can_unplug:
        return
    steps = {"inactive": out.configure, "activating": out.activate}
    fast = [STOP_US + 200.0] * out.channels
    for wanted in ("unconfigured", *steps):
        for state, step in steps.items():
            if wanted != "unconfigured" and out.health().state != wanted:
                step()
                promise(out.health().state == state, f"on the way to '{wanted}' it is {out.health()}")
        bench.unplug()
        for _ in range(round(1.0 / TICK_S)):
            _is_still(out, out.write_us(fast, bench.now_s()), f"unplugged while {wanted}, told to push,")
            bench.advance(TICK_S)
        for call in (out.stop, out.clear_stop, lambda: out.deactivate("checked")):
            call()
            check_health(out)
        for step in steps.values():
            with suppress(DeviceError):
                step()
        _is_still(out, out.write_us(fast, bench.now_s()), f"unplugged while {wanted}, and tried again,")
        bench.plug_in()
        out.configure()
        promise(out.health().state == "inactive", f"plugged in again it is {out.health()}")
        out.deactivate("checked")


def _rests(out: PwmOut, applied: AppliedPulses) -> bool:
    return all(abs(pulse - STOP_US) <= out.resolution_us / 2 + 1e-9 for pulse in applied.pulses_us)


def _is_still(out: PwmOut, applied: AppliedPulses, when: str) -> None:
    promise(
        len(applied.pulses_us) == out.channels, f"{when} it answers {applied.pulses_us} for {out.channels} channels"
    )
    promise(_rests(out, applied), f"{when} all are neutral, not {applied.pulses_us}")
