"""Pulses at the pins: how wide, how often, how fast they may change."""

from itertools import pairwise

import pytest

from snr_sim.devices.wire.mcu_messages import McuFault, McuState, SetWidths

from .conftest import NEUTRAL, SESSION, Bench

EXACT_US = 0.5  # of a pulse at the pin; measured: 0.3 on the ATmega328P, 0.25 on the ATmega2560
SET_US = (1500.0, 1100.0, 1900.0, 1234.0, 1501.0, 1500.5, 1700.0, 1299.5)
SLEW_US_PER_MS = 4.0
DWELL_MS = 50.0
DEAD_US = (1475.0, 1525.0)


def all_at(width_us: float) -> tuple[float, ...]:
    return (width_us,) * 8


def test_each_pin_has_commanded_width(bench: Bench) -> None:
    bench.armed()
    bench.drive(SET_US, 200)
    bench.send(bench.command(SET_US))
    for found, expected in zip(bench.widths(), SET_US, strict=True):
        assert found
        assert all(width == pytest.approx(expected, abs=EXACT_US) for width in found)
    assert bench.telemetry.widths_us == SET_US
    assert bench.telemetry.state is McuState.ARMED
    assert bench.telemetry.faults == McuFault(0)


def test_busy_line_keeps_exact_widths(bench: Bench) -> None:
    bench.armed()
    bench.drive(SET_US, 200)
    bench.pulses.clear()
    for _ in range(100):
        bench.send(*[bench.command(SET_US) for _ in range(3)])  # 93 bytes; the line takes 115
        bench.run(10)
    for pulse in bench.pulses:
        assert pulse.width_us == pytest.approx(SET_US[pulse.channel], abs=EXACT_US)


@pytest.mark.parametrize("period_ms", [8, 20])
def test_pulse_rate_equals_setting(make_bench, mcu: str, period_ms: int) -> None:
    bench: Bench = make_bench(mcu, PERIOD_MS=period_ms)
    bench.run(100)
    for channel in range(8):
        rises_us = [pulse.rise_us for pulse in bench.pulses if pulse.channel == channel]
        assert len(rises_us) >= 4
        assert all(b - a == pytest.approx(period_ms * 1000, abs=EXACT_US) for a, b in pairwise(rises_us))
        assert rises_us[0] < period_ms * 1000 + 2000


def test_h4_all_pulses_before_arming_are_neutral(bench: Bench) -> None:
    bench.ready()
    bench.drive(SET_US, 300)
    assert {pulse.channel for pulse in bench.pulses} == set(range(8))
    assert all(pulse.width_us == pytest.approx(1500.0, abs=EXACT_US) for pulse in bench.pulses)
    assert bench.telemetry.widths_us == NEUTRAL
    assert bench.telemetry.faults == McuFault(0)


@pytest.mark.parametrize(
    ("asked_us", "made_us"), [(2500.0, 1900.0), (0.0, 1100.0), (32767.5, 1900.0), (1099.5, 1100.0)]
)
def test_h6_widths_beyond_limits_are_clamped(bench: Bench, asked_us: float, made_us: float) -> None:
    bench.armed()
    bench.drive(all_at(asked_us), 200)
    assert all(1100.0 - EXACT_US <= pulse.width_us <= 1900.0 + EXACT_US for pulse in bench.pulses)
    assert bench.telemetry.widths_us == all_at(made_us)
    assert McuFault.CLAMPED in bench.telemetry.faults


@pytest.mark.parametrize("channels", [0, 7, 9, 16])
def test_h6_command_of_wrong_length_sets_neutral_and_is_reported(bench: Bench, channels: int) -> None:
    bench.armed()
    bench.drive(all_at(1800.0), 150)
    wrong = SetWidths(SESSION, bench.seq + 1, int(bench.now_ms), 0, 200, (1800.0,) * channels)
    bench.send(wrong)
    bench.run(10)
    assert all(width == pytest.approx(1500.0, abs=1.0) for found in bench.widths(17) for width in found)
    bench.drive(all_at(1800.0), 50)
    assert bench.telemetry.state is McuState.DISARMED
    assert bench.telemetry.widths_us == NEUTRAL
    assert McuFault.BAD_LENGTH in bench.telemetry.faults


def test_h7_outputs_keep_slew_limit(bench: Bench) -> None:
    bench.armed()
    bench.pulses.clear()
    for width_us in (1900.0, 1100.0, 1501.0, 1899.5, 1500.0):
        bench.drive(all_at(width_us), 300)
    for channel in range(8):
        mine = [pulse for pulse in bench.pulses if pulse.channel == channel]
        for a, b in pairwise(mine):
            steps = round((b.rise_us - a.rise_us) / 1000) + 1
            assert abs(b.width_us - a.width_us) <= steps * SLEW_US_PER_MS + 2 * EXACT_US
        assert {1900.0, 1100.0, 1500.0} <= {round(pulse.width_us) for pulse in mine}


def test_h7_full_ahead_is_reached_in_100_ms(bench: Bench) -> None:
    bench.armed()
    bench.drive(all_at(1900.0), 90)
    assert max(bench.telemetry.widths_us) < 1900.0
    assert McuFault.LIMITED in bench.telemetry.faults
    bench.drive(all_at(1900.0), 30)
    assert bench.telemetry.widths_us == all_at(1900.0)
    assert McuFault.LIMITED not in bench.telemetry.faults


@pytest.mark.parametrize(("first_us", "then_us"), [(1700.0, 1300.0), (1300.0, 1700.0)])
def test_h7_reversal_pauses_in_dead_band(bench: Bench, first_us: float, then_us: float) -> None:
    bench.armed()
    bench.drive(all_at(first_us), 150)
    bench.pulses.clear()
    bench.drive(all_at(then_us), 300)
    for channel in range(8):
        mine = [pulse for pulse in bench.pulses if pulse.channel == channel]
        is_driven = [not DEAD_US[0] <= pulse.width_us <= DEAD_US[1] for pulse in mine]
        begin, end = is_driven.index(False), len(is_driven) - is_driven[::-1].index(False)
        assert not any(is_driven[begin:end])
        assert mine[end].rise_us - mine[begin - 1].rise_us >= DWELL_MS * 1000
        assert pytest.approx(mine[end - 1].width_us, abs=30.0) == 1500.0
        assert mine[-1].width_us == pytest.approx(then_us, abs=EXACT_US)


def test_h7_repeated_reversals_pause_equally_long(bench: Bench) -> None:
    bench.armed()
    bench.drive(all_at(1700.0), 150)
    rests_ms = []
    for width_us in (1300.0, 1700.0, 1300.0):
        bench.pulses.clear()
        bench.drive(all_at(width_us), 300)
        mine = [pulse for pulse in bench.pulses if pulse.channel == 0]
        inside = [pulse.rise_us for pulse in mine if DEAD_US[0] <= pulse.width_us <= DEAD_US[1]]
        rests_ms.append((inside[-1] - inside[0]) / 1000)
        assert mine[-1].width_us == pytest.approx(width_us, abs=EXACT_US)
    assert max(rests_ms) - min(rests_ms) <= 8.0


def test_stop_between_reversals_keeps_pause(bench: Bench) -> None:
    bench.armed()
    bench.drive(all_at(1900.0), 150)
    bench.drive(NEUTRAL, 120)  # there after a tenth of a second: 20 ms of rest
    bench.pulses.clear()
    bench.drive(all_at(1300.0), 20)
    assert all(pulse.width_us == pytest.approx(1500.0, abs=EXACT_US) for pulse in bench.pulses)
    bench.drive(all_at(1300.0), 100)
    assert bench.telemetry.widths_us == all_at(1300.0)
