"""Outputs without a supervisor of their own: how long neutral is sent before they follow, and how they are armed."""

from types import SimpleNamespace
from typing import Any

import pytest

from snr_sim.devices.pwm.passive_pwm import ESC_START_S, PassivePwm, PwmChip
from snr_sim.devices.pwm.pwm_backend import drive_plant
from snr_sim.prelude.errors import DeviceError
from snr_sim.prelude.signals import NOT_ACTIVE, PwmCommand

STILL, AHEAD = [1500.0, 1500.0], [1700.0, 1600.0]


class Pins(PwmChip):
    """Two outputs that record the pulses sent to them."""

    def __init__(self) -> None:
        super().__init__("These pins", 2)
        self.sent: list[list[float]] = []

    def open(self) -> None: ...

    def send(self, pulses_us: list[float]) -> list[float]:
        self.sent.append(pulses_us)
        return pulses_us


class Bench:
    """These pins, and the time."""

    def __init__(self, is_supervised: bool = True) -> None:
        self.time_s = 5.0
        self.chip = Pins()
        self.out = PassivePwm(self.chip, lambda: self.time_s, is_supervised=is_supervised)
        self.out.configure()

    def write(self, pulses_us: list[float], after_s: float) -> tuple[list[float], list[str]]:
        self.time_s = 5.0 + after_s
        applied = self.out.write_us(pulses_us, self.time_s)
        return applied.pulses_us, applied.reason


def test_passive_pwm_sends_neutral_for_esc_start_then_follows_commands() -> None:
    pins = Bench()
    pins.out.activate()
    assert pins.chip.sent == [STILL]
    assert pins.write(STILL, 0.5 * ESC_START_S) == (STILL, [NOT_ACTIVE])
    assert pins.write(STILL, ESC_START_S - 0.01) == (STILL, [NOT_ACTIVE])
    assert pins.out.health().state == "activating"
    assert pins.write(STILL, ESC_START_S) == (STILL, [])
    assert pins.write(AHEAD, ESC_START_S + 0.02) == (AHEAD, [])


def test_passive_pwm_thrust_during_arming_waits_for_neutral() -> None:
    pins = Bench()
    pins.out.activate()
    for after_s in (0.1, ESC_START_S, 2.0 * ESC_START_S):
        assert pins.write(AHEAD, after_s) == (STILL, [NOT_ACTIVE])
    assert AHEAD not in pins.chip.sent
    assert pins.write(STILL, 2.0 * ESC_START_S + 0.02) == (STILL, [])


def test_drive_plant_applies_pulses_of_bench_outputs() -> None:
    pins = Bench()
    driven: list[PwmCommand] = []
    plant: Any = SimpleNamespace(write=lambda name, command: driven.append(command))
    drive_plant(pins.out, plant)
    pins.out.activate()
    for pulses_us, after_s in ((STILL, ESC_START_S), (AHEAD, ESC_START_S + 0.02), ([9000.0] * 2, ESC_START_S + 0.04)):
        pins.write(pulses_us, after_s)
    assert [one.pulses_us for one in driven] == [STILL, AHEAD, [1900.0, 1900.0]]
    pins.out.stop()
    assert driven[-1].pulses_us == STILL
    pins.write(AHEAD, ESC_START_S + 0.06)
    pins.out.close()
    assert [one.pulses_us for one in driven[3:]] == [STILL] * 3


def test_passive_pwm_without_supervisor_raises_device_error() -> None:
    pins = Bench(is_supervised=False)
    with pytest.raises(DeviceError, match="keeps its last pulse if this program is killed") as e:
        pins.out.activate()
    assert "behind the supervisor" in e.value.fix
    assert pins.chip.sent == []
