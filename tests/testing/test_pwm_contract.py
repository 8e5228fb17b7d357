"""The contract check accepts outputs that meet the contract, and names the rule that others break."""

import math
from collections.abc import Sequence
from typing import Any

import msgspec
import pytest

from snr_sim.devices.pwm.pwm_backend import PlainlyArmed
from snr_sim.prelude.device import LEASE_S, Health
from snr_sim.prelude.errors import DeviceError
from snr_sim.prelude.signals import CLAMPED, NO_PULSE, NOT_ACTIVE, STOPPED, TOO_OLD, AppliedPulses
from snr_sim.testing.pwm_contract import check_pwm_out


class Bench:
    """Outputs of one class, in simulated time, with a wire and pins."""

    can_unplug = True

    def __init__(self, kind: type["Good"]) -> None:
        self.kind, self.time_s, self.is_plugged = kind, 10.0, True
        self.pulses_us, self.until_s = [1500.0, 1500.0], math.inf

    def open(self) -> Any:
        return self.kind(self)

    def now_s(self) -> float:
        return self.time_s

    def advance(self, seconds: float) -> None:
        self.time_s += seconds

    def pins_us(self) -> list[float]:
        return self.pulses_us if self.time_s < self.until_s else [1500.0, 1500.0]

    def unplug(self) -> None:
        self.is_plugged = False
        self.until_s = min(self.until_s, self.time_s + LEASE_S)

    def plug_in(self) -> None:
        self.is_plugged = True


class Good(PlainlyArmed):
    """Meets the whole contract. Its subclasses break one rule each."""

    fails_safe_alone = True

    def __init__(self, bench: Bench) -> None:
        super().__init__(bench.now_s, 2)
        self.bench = bench

    def put(self, pulses_us: list[float], stamp_s: float, lease_s: float, why: list[str]) -> list[float]:
        if not self.bench.is_plugged:
            raise DeviceError("The wire is out.")
        self.at_pins(pulses_us, stamp_s + lease_s)
        return pulses_us

    def at_pins(self, pulses_us: list[float], until_s: float) -> None:
        self.bench.pulses_us, self.bench.until_s = pulses_us, until_s

    def on_configure(self) -> None:
        if not self.bench.is_plugged:
            raise DeviceError("The wire is out.")

    def on_deactivate(self, reason: str) -> None:
        if self.bench.is_plugged:
            self.at_pins(self.still_us, math.inf)


def test_outputs_that_keep_their_promises_pass() -> None:
    check_pwm_out(Bench(Good))


class Answers(Good):
    """Changes its answers."""

    def write_us(self, pulses_us: Sequence[float], stamp_s: float, lease_s: float = LEASE_S) -> AppliedPulses:
        return self.changed(super().write_us(pulses_us, stamp_s, lease_s))

    def changed(self, applied: AppliedPulses) -> AppliedPulses:
        return applied

    def without(self, word: str, applied: AppliedPulses) -> AppliedPulses:
        return msgspec.structs.replace(applied, why=[one for one in applied.why if one != word])


class SaysNotThatItClamps(Answers):
    def changed(self, applied: AppliedPulses) -> AppliedPulses:
        return self.without(CLAMPED, applied)


class SaysNotThatItIsNoPulse(Answers):
    def changed(self, applied: AppliedPulses) -> AppliedPulses:
        return self.without(NO_PULSE, applied)


class SaysNotThatItIsTooOld(Answers):
    def changed(self, applied: AppliedPulses) -> AppliedPulses:
        return self.without(TOO_OLD, applied)


class SaysNotThatItIsStopped(Answers):
    def changed(self, applied: AppliedPulses) -> AppliedPulses:
        return self.without(STOPPED, applied)


class SaysNotThatItIsNotActive(Answers):
    def changed(self, applied: AppliedPulses) -> AppliedPulses:
        return self.without(NOT_ACTIVE, applied)


class HasWordsOfItsOwn(Answers):
    def changed(self, applied: AppliedPulses) -> AppliedPulses:
        return msgspec.structs.replace(applied, why=[*applied.why, "tired"])


class SaysItTwice(Answers):
    def changed(self, applied: AppliedPulses) -> AppliedPulses:
        return msgspec.structs.replace(applied, why=applied.why * 2)


class TellsAnotherTime(Answers):
    def changed(self, applied: AppliedPulses) -> AppliedPulses:
        return msgspec.structs.replace(applied, stamp_s=applied.stamp_s - 1.0)


class KeepsAStampOfNoTime(Answers):
    def write_us(self, pulses_us: Sequence[float], stamp_s: float, lease_s: float = LEASE_S) -> AppliedPulses:
        return msgspec.structs.replace(super().write_us(pulses_us, stamp_s, lease_s), stamp_s=stamp_s)


class AnswersForOneChannel(Answers):
    def changed(self, applied: AppliedPulses) -> AppliedPulses:
        return msgspec.structs.replace(applied, pulses_us=applied.pulses_us[:1])


class EchoesWhatWasAskedFor(Good):
    def write_us(self, pulses_us: Sequence[float], stamp_s: float, lease_s: float = LEASE_S) -> AppliedPulses:
        super().write_us(pulses_us, stamp_s, lease_s)
        return AppliedPulses(list(pulses_us), stamp_s)


class IsCoarserThanItSays(Good):
    def __init__(self, bench: Bench) -> None:
        super().__init__(bench)
        self.resolution_us = 12.0

    def _pulses_of(self, pulses_us: Sequence[float], why: list[str]) -> list[float]:
        self.resolution_us = 0.0
        pulses = super()._pulses_of(pulses_us, why)
        self.resolution_us = 12.0
        return pulses


class MakesMoreAtThePins(Good):
    def at_pins(self, pulses_us: list[float], until_s: float) -> None:
        super().at_pins([1.002 * (pulse - 1500.0) * 1.01 + 1500.0 for pulse in pulses_us], until_s)


class GoesOnWhenItsLeaseIsOver(Good):
    def at_pins(self, pulses_us: list[float], until_s: float) -> None:
        super().at_pins(pulses_us, math.inf)


class GoesOnWhenDeactivated(Good):
    def on_deactivate(self, reason: str) -> None: ...


class GoesOnWhenStopped(Good):
    def stop(self) -> None:
        self.is_stopped, self.state, self.why = True, "inactive", "emergency stop"


class IsArmedByActivate(Good):
    def on_activate(self) -> None:
        self.state = "active"


class ArmsWithoutAskingForConfigure(Good):
    def activate(self) -> None:
        if self.state == "unconfigured":
            self.configure()
        super().activate()


class TakesCommandsOfTimesToCome(Good):
    def _left_of(self, stamp_s: float, lease_s: float) -> float:
        is_soon = isinstance(stamp_s, float) and 0.0 < stamp_s - self.now_s() < 10.0
        return lease_s if is_soon else super()._left_of(stamp_s, lease_s)


class CanBeArmedWhenStopped(Good):
    def activate(self) -> None:
        self.is_stopped = False
        super().activate()


class StaysStopped(Good):
    def clear_stop(self) -> None: ...


class DoesNotFeelThatItsWireIsOut(Good):
    def put(self, pulses_us: list[float], stamp_s: float, lease_s: float, why: list[str]) -> list[float]:
        return super().put(pulses_us, stamp_s, lease_s, why) if self.bench.is_plugged else pulses_us


class IsNeverConfiguredAgain(Good):
    def on_configure(self) -> None:
        if not self.bench.is_plugged or self.why:
            raise DeviceError("The wire was out once.")


class SaysNotWhyItWaits(Good):
    def on_activate(self) -> None:
        self.state, self.why = "activating", ""


class ComplainsWhileAllIsWell(Good):
    def health(self) -> Health:
        return msgspec.structs.replace(super().health(), why="hm")


class CountsDown(Good):
    def counts(self) -> dict[str, int]:
        return {"errors": -1}


class ForgetsThatItIsClosed(Good):
    def close(self) -> None:
        super().close()
        self.state = "inactive"


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        (SaysNotThatItClamps, "after more than full ahead all outputs tell .*clamped"),
        (SaysNotThatItIsNoPulse, "after NaN all outputs tell .*no pulse"),
        (SaysNotThatItIsTooOld, "is too old, but"),
        (SaysNotThatItIsStopped, r"after stop\(\) all outputs tell .*stopped"),
        (SaysNotThatItIsNotActive, r"before activate\(\) the answer says why"),
        (HasWordsOfItsOwn, "reasons are some of .*tired"),
        (SaysItTwice, "each once, not"),
        (TellsAnotherTime, r"a command of 10.\d* s is answered as one of 9"),
        (KeepsAStampOfNoTime, r"answers at [\d.]+ s with the stamp"),
        (AnswersForOneChannel, r"for 2 channels"),
        (EchoesWhatWasAskedFor, r"before configure\(\) all are neutral, not"),
        (IsCoarserThanItSays, "which is no multiple of 12.0 us"),
        (MakesMoreAtThePins, "the pins show"),
        (GoesOnWhenItsLeaseIsOver, "0.25 s after the last command the pins show"),
        (GoesOnWhenDeactivated, r"soon after deactivate\(\) the pins show"),
        (GoesOnWhenStopped, r"soon after stop\(\) the pins show"),
        (IsArmedByActivate, "activate\\(\\), told to push all outputs tell \\('activating'"),
        (ArmsWithoutAskingForConfigure, r"activate\(\) before configure\(\) is refused"),
        (TakesCommandsOfTimesToCome, "a command of .* is too old, but"),
        (CanBeArmedWhenStopped, r"activate\(\) during an emergency stop is refused"),
        (StaysStopped, r"after clear_stop\(\) all outputs tell"),
        (DoesNotFeelThatItsWireIsOut, "a wire that was pulled is told"),
        (SaysNotWhyItWaits, "'activating' says why"),
        (ComplainsWhileAllIsWell, "of active outputs nothing is wrong, but: 'hm'"),
        (CountsDown, "counts are whole numbers"),
        (ForgetsThatItIsClosed, r"after close\(\) .*'inactive'"),
    ],
)
def test_outputs_that_break_a_promise_are_told_which(kind: type[Good], words: str) -> None:
    with pytest.raises(AssertionError, match=f"Promise broken: .*{words}"):
        check_pwm_out(Bench(kind))


def test_outputs_that_cannot_be_opened_again_fail_with_their_own_error() -> None:
    with pytest.raises(DeviceError, match="The wire was out once"):
        check_pwm_out(Bench(IsNeverConfiguredAgain))
