"""The contract check accepts outputs that meet the contract, and names the rule that others break."""

import math
from collections.abc import Sequence
from typing import Any

import msgspec
import pytest

from snr_sim.devices.pwm.pwm_backend import ImmediateArming
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


class Good(ImmediateArming):
    """Meets the whole contract. Its subclasses break one rule each."""

    has_independent_failsafe = True

    def __init__(self, bench: Bench) -> None:
        super().__init__(bench.now_s, 2)
        self.bench = bench

    def put(self, pulses_us: list[float], stamp_s: float, lease_s: float, reasons: list[str]) -> list[float]:
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


def test_valid_outputs_pass() -> None:
    check_pwm_out(Bench(Good))


class Answers(Good):
    """Changes its answers."""

    def write_us(self, pulses_us: Sequence[float], stamp_s: float, lease_s: float = LEASE_S) -> AppliedPulses:
        return self.changed(super().write_us(pulses_us, stamp_s, lease_s))

    def changed(self, applied: AppliedPulses) -> AppliedPulses:
        return applied


def omitting(word: str) -> type[Good]:
    """Return a class whose answers lack a reason."""

    class Omits(Answers):
        def changed(self, applied: AppliedPulses) -> AppliedPulses:
            return msgspec.structs.replace(applied, reason=[one for one in applied.reason if one != word])

    return Omits


class ReportsUnknownReason(Answers):
    def changed(self, applied: AppliedPulses) -> AppliedPulses:
        return msgspec.structs.replace(applied, reason=[*applied.reason, "tired"])


class RepeatsReasons(Answers):
    def changed(self, applied: AppliedPulses) -> AppliedPulses:
        return msgspec.structs.replace(applied, reason=applied.reason * 2)


class ReturnsWrongStamp(Answers):
    def changed(self, applied: AppliedPulses) -> AppliedPulses:
        return msgspec.structs.replace(applied, stamp_s=applied.stamp_s - 1.0)


class KeepsInvalidStamp(Answers):
    def write_us(self, pulses_us: Sequence[float], stamp_s: float, lease_s: float = LEASE_S) -> AppliedPulses:
        return msgspec.structs.replace(super().write_us(pulses_us, stamp_s, lease_s), stamp_s=stamp_s)


class AnswersForOneChannel(Answers):
    def changed(self, applied: AppliedPulses) -> AppliedPulses:
        return msgspec.structs.replace(applied, pulses_us=applied.pulses_us[:1])


class EchoesRequest(Good):
    def write_us(self, pulses_us: Sequence[float], stamp_s: float, lease_s: float = LEASE_S) -> AppliedPulses:
        super().write_us(pulses_us, stamp_s, lease_s)
        return AppliedPulses(list(pulses_us), stamp_s)


class IsCoarserThanResolution(Good):
    def __init__(self, bench: Bench) -> None:
        super().__init__(bench)
        self.resolution_us = 12.0

    def _pulses_of(self, pulses_us: Sequence[float], reason: list[str]) -> list[float]:
        self.resolution_us = 0.0
        pulses = super()._pulses_of(pulses_us, reason)
        self.resolution_us = 12.0
        return pulses


class MakesMoreAtThePins(Good):
    def at_pins(self, pulses_us: list[float], until_s: float) -> None:
        super().at_pins([1.002 * (pulse - 1500.0) * 1.01 + 1500.0 for pulse in pulses_us], until_s)


class IgnoresLease(Good):
    def at_pins(self, pulses_us: list[float], until_s: float) -> None:
        super().at_pins(pulses_us, math.inf)


class IgnoresDeactivate(Good):
    def on_deactivate(self, reason: str) -> None: ...


class IgnoresStop(Good):
    def stop(self) -> None:
        self.is_stopped, self.state, self.reason = True, "inactive", "emergency stop"


class IsArmedByActivate(Good):
    def on_activate(self) -> None:
        self.state = "active"


class ArmsWithoutAskingForConfigure(Good):
    def activate(self) -> None:
        if self.state == "unconfigured":
            self.configure()
        super().activate()


class AcceptsFutureStamps(Good):
    def _remaining_lease_s(self, stamp_s: float, lease_s: float) -> float:
        is_soon = isinstance(stamp_s, float) and 0.0 < stamp_s - self.now_s() < 10.0
        return lease_s if is_soon else super()._remaining_lease_s(stamp_s, lease_s)


class CanBeArmedWhenStopped(Good):
    def activate(self) -> None:
        self.is_stopped = False
        super().activate()


class StaysStopped(Good):
    def clear_stop(self) -> None: ...


class IgnoresUnplugging(Good):
    def put(self, pulses_us: list[float], stamp_s: float, lease_s: float, reasons: list[str]) -> list[float]:
        return super().put(pulses_us, stamp_s, lease_s, reasons) if self.bench.is_plugged else pulses_us


class IsNeverConfiguredAgain(Good):
    def on_configure(self) -> None:
        if not self.bench.is_plugged or self.reason:
            raise DeviceError("The wire was out once.")


class OmitsReasonOfActivating(Good):
    def on_activate(self) -> None:
        self.state, self.reason = "activating", ""


class ReportsReasonWhileActive(Good):
    def health(self) -> Health:
        return msgspec.structs.replace(super().health(), reason="hm")


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
        (omitting(CLAMPED), "after more than full ahead all outputs tell .*clamped"),
        (omitting(NO_PULSE), "after NaN all outputs tell .*no pulse"),
        (omitting(TOO_OLD), "is too old, but"),
        (omitting(STOPPED), r"after stop\(\) all outputs tell .*stopped"),
        (omitting(NOT_ACTIVE), r"before activate\(\) the answer has the reason"),
        (ReportsUnknownReason, "reasons are some of .*tired"),
        (RepeatsReasons, "each once, not"),
        (ReturnsWrongStamp, r"a command of 10.\d* s is answered as one of 9"),
        (KeepsInvalidStamp, r"answers at [\d.]+ s with the stamp"),
        (AnswersForOneChannel, r"for 2 channels"),
        (EchoesRequest, r"before configure\(\) all are neutral, not"),
        (IsCoarserThanResolution, "which is not a multiple of 12.0 us"),
        (MakesMoreAtThePins, "the pins show"),
        (IgnoresLease, "0.25 s after the last command the pins show"),
        (IgnoresDeactivate, r"soon after deactivate\(\) the pins show"),
        (IgnoresStop, r"soon after stop\(\) the pins show"),
        (IsArmedByActivate, "activate\\(\\), thrust commanded all outputs tell \\('activating'"),
        (ArmsWithoutAskingForConfigure, r"activate\(\) before configure\(\) is refused"),
        (AcceptsFutureStamps, "a command of .* is too old, but"),
        (CanBeArmedWhenStopped, r"activate\(\) during an emergency stop is refused"),
        (StaysStopped, r"after clear_stop\(\) all outputs tell"),
        (IgnoresUnplugging, "a pulled wire is reported"),
        (OmitsReasonOfActivating, "'activating' has a reason"),
        (ReportsReasonWhileActive, "of active outputs nothing is wrong, but: 'hm'"),
        (CountsDown, "counts are whole numbers"),
        (ForgetsThatItIsClosed, r"after close\(\) .*'inactive'"),
    ],
)
def test_broken_outputs_raise_with_rule(kind: type[Good], words: str) -> None:
    with pytest.raises(AssertionError, match=f"Contract violated: .*{words}"):
        check_pwm_out(Bench(kind))


def test_error_of_second_open_is_raised_unchanged() -> None:
    with pytest.raises(DeviceError, match="The wire was out once"):
        check_pwm_out(Bench(IsNeverConfiguredAgain))
