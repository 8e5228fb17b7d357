"""How long a command holds, and that it counts from when it was computed."""

from collections.abc import Callable
from itertools import pairwise

import pytest

from snr_sim.devices.wire.mcu_frames import encode
from snr_sim.devices.wire.mcu_messages import NO_COMMAND_MS, McuFault, McuState, SetWidths

from .conftest import NEUTRAL, SESSION, Bench

AHEAD, SLOW = (1900.0,) * 8, (1700.0,) * 8
NEUTRAL_WITHIN_MS = 250.0
PERIOD_MS = 8.0


@pytest.fixture
def ahead(bench: Bench) -> Bench:
    """All full ahead; the last command was computed now."""
    bench.armed()
    bench.drive(AHEAD, 150)
    assert bench.telemetry.widths_us == AHEAD
    bench.send(bench.command(AHEAD))
    return bench


def ms_until_neutral(bench: Bench, again: Callable[[], None] = lambda: None) -> float:
    """Until the first pulse at 1500 us of the channel that is last, while `again` is called every 10 ms."""
    begin_us = bench.board.now_us
    bench.pulses.clear()
    for _ in range(50):
        again()
        bench.run(10)
    last_ms = 0.0
    for channel in range(8):
        mine = [pulse for pulse in bench.pulses if pulse.channel == channel and pulse.rise_us >= begin_us]
        firsts = [b.rise_us for a, b in pairwise(mine) if a.width_us > 1501.0 >= b.width_us]
        assert len(firsts) == 1  # once neutral, it stays so
        assert abs(mine[-1].width_us - 1500.0) <= 1.0
        last_ms = max(last_ms, (firsts[0] - begin_us) / 1000)
    return last_ms


def test_h1_missing_commands_set_neutral_within_250_ms(ahead: Bench) -> None:
    assert 200.0 <= ms_until_neutral(ahead) <= 200.0 + 3.0 + PERIOD_MS < NEUTRAL_WITHIN_MS
    assert ahead.telemetry.faults == McuFault.LEASE_EXPIRED
    assert ahead.telemetry.state is McuState.DISARMED


def test_h11_resent_command_of_stuck_planner_times_out(ahead: Bench) -> None:
    stuck_ms = int(ahead.now_ms)

    def send_it_again() -> None:
        age_ms = int(ahead.now_ms) - stuck_ms
        ahead.send(SetWidths(SESSION, ahead.seq, stuck_ms, age_ms, 200, AHEAD))

    assert ms_until_neutral(ahead, send_it_again) <= 200.0 + 3.0 + PERIOD_MS
    assert McuFault.LEASE_EXPIRED in ahead.telemetry.faults


def test_h11_repeated_bytes_do_not_extend_lease(ahead: Bench) -> None:
    frame = encode(ahead.command(AHEAD))
    assert ms_until_neutral(ahead, lambda: ahead.board.uart_in(frame) and None) <= 200.0 + 3.0 + PERIOD_MS
    assert McuFault.REPEATED in ahead.telemetry.faults


@pytest.mark.parametrize(
    ("age_ms", "lease_ms", "holds_ms"), [(150, 200, 50), (0, 60, 60), (0, 5000, 200), (30, 5000, 170)]
)
def test_h11_lease_counts_from_computation_and_is_at_most_200_ms(
    ahead: Bench, age_ms: int, lease_ms: int, holds_ms: int
) -> None:
    ahead.run(10)
    ahead.seq += 1
    ahead.send(SetWidths(SESSION, ahead.seq, int(ahead.now_ms), age_ms, lease_ms, AHEAD))
    assert holds_ms <= ms_until_neutral(ahead) <= holds_ms + 4.0 + PERIOD_MS


@pytest.mark.parametrize(("age_ms", "lease_ms"), [(200, 200), (65535, 200), (0, 0), (300, 65535)])
def test_expired_command_is_ignored(ahead: Bench, age_ms: int, lease_ms: int) -> None:
    ahead.run(10)
    ahead.send(SetWidths(SESSION, 4321, int(ahead.now_ms), age_ms, lease_ms, SLOW))
    ahead.run(10)
    assert ahead.telemetry.seq != 4321
    assert McuFault.STALE in ahead.telemetry.faults
    assert ahead.telemetry.widths_us == AHEAD


def test_command_older_than_last_is_ignored(ahead: Bench) -> None:
    ahead.run(10)
    ahead.send(ahead.command(SLOW, stamp_ms=int(ahead.now_ms) - 100))
    ahead.run(10)
    assert McuFault.REPEATED in ahead.telemetry.faults
    assert ahead.telemetry.widths_us == AHEAD


def are(expected_us: float, widths: list[set[float]]) -> bool:
    return all(abs(width_us - expected_us) <= 1.0 for found in widths for width_us in found)


def test_commands_with_equal_stamp_are_applied_by_number(ahead: Bench) -> None:
    ahead.run(10)
    stamp_ms = int(ahead.now_ms)
    first, second = (ahead.command(widths, stamp_ms=stamp_ms) for widths in (AHEAD, SLOW))
    ahead.send(first, second)
    ahead.run(100)
    assert are(SLOW[0], ahead.widths())
    ahead.send(first)
    assert are(SLOW[0], ahead.widths())
    assert ahead.telemetry.seq == second.seq
    assert McuFault.REPEATED in ahead.telemetry.faults


def test_h11_new_number_with_equal_stamp_keeps_age(ahead: Bench) -> None:
    stuck_ms = int(ahead.now_ms) + 1

    def send_it_as_new() -> None:
        ahead.send(ahead.command(AHEAD, stamp_ms=stuck_ms))

    assert ms_until_neutral(ahead, send_it_as_new) <= 210.0 + 3.0 + PERIOD_MS
    assert McuFault.LEASE_EXPIRED in ahead.telemetry.faults


@pytest.mark.parametrize("late_ms", [20, 100, 1000])
@pytest.mark.parametrize("age_ms", [0, 200])
def test_late_neutral_is_applied(ahead: Bench, late_ms: int, age_ms: int) -> None:
    ahead.drive(AHEAD)
    seq = ahead.seq
    ahead.send(ahead.command(NEUTRAL, stamp_ms=int(ahead.now_ms) - late_ms, age_ms=age_ms))
    ahead.run(110)
    assert are(1500.0, ahead.widths())
    assert (ahead.telemetry.seq, ahead.telemetry.state) == (
        seq,
        McuState.ARMED,
    )  # which command holds has not changed, ...
    ahead.run(200)
    assert ahead.telemetry.state is McuState.DISARMED  # ... nor for how long


def test_restarted_computer_clock_is_accepted(bench: Bench) -> None:
    bench.ready()
    bench.send(bench.command(NEUTRAL, stamp_ms=2**32 - 5))
    bench.run(10)
    bench.send(bench.command(NEUTRAL, stamp_ms=5))
    bench.run(10)
    assert bench.telemetry.seq == bench.seq
    assert bench.telemetry.faults == McuFault(0)


def test_telemetry_reports_command_age(bench: Bench) -> None:
    bench.ready()
    bench.run(60)
    assert bench.telemetry.command_age_ms == NO_COMMAND_MS
    bench.send(bench.command(NEUTRAL, age_ms=40))
    bench.run(10)
    assert bench.telemetry.command_age_ms == 40
    bench.run(1000)
    assert bench.telemetry.command_age_ms == pytest.approx(1000, abs=60)
