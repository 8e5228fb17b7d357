"""How long a command holds, and that it counts from when it was computed."""

from collections.abc import Callable
from itertools import pairwise

import pytest

from snr_sim.devices.wire.mcu_frames import encode
from snr_sim.devices.wire.mcu_messages import NO_COMMAND_MS, Fault, SetWidths, State

from .conftest import NEUTRAL, SESSION, Bench

AHEAD, SLOW = (1900.0,) * 8, (1700.0,) * 8
NEUTRAL_WITHIN_MS = 250.0
PERIOD_MS = 8.0


@pytest.fixture
def ahead(bench: Bench) -> Bench:
    """All full ahead; the last command was computed now."""
    bench.armed()
    bench.drive(AHEAD, 150)
    assert bench.told.widths_us == AHEAD
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


def test_h1_when_no_more_commands_come_all_are_neutral_within_250_ms(ahead: Bench) -> None:
    assert 200.0 <= ms_until_neutral(ahead) <= 200.0 + 3.0 + PERIOD_MS < NEUTRAL_WITHIN_MS
    assert ahead.told.faults == Fault.LEASE_EXPIRED
    assert ahead.told.state is State.DISARMED


def test_h11_a_stuck_planner_behind_a_thread_that_sends_its_last_command_again_times_out(ahead: Bench) -> None:
    stuck_ms = int(ahead.now_ms)

    def send_it_again() -> None:
        age_ms = int(ahead.now_ms) - stuck_ms
        ahead.send(SetWidths(SESSION, ahead.seq, stuck_ms, age_ms, 200, AHEAD))

    assert ms_until_neutral(ahead, send_it_again) <= 200.0 + 3.0 + PERIOD_MS
    assert Fault.LEASE_EXPIRED in ahead.told.faults


def test_h11_a_thread_that_repeats_the_bytes_of_the_last_command_keeps_nothing_going(ahead: Bench) -> None:
    frame = encode(ahead.command(AHEAD))
    assert ms_until_neutral(ahead, lambda: ahead.board.uart_in(frame) and None) <= 200.0 + 3.0 + PERIOD_MS
    assert Fault.REPEATED in ahead.told.faults


@pytest.mark.parametrize(
    ("age_ms", "lease_ms", "holds_ms"), [(150, 200, 50), (0, 60, 60), (0, 5000, 200), (30, 5000, 170)]
)
def test_h11_a_lease_counts_from_the_computing_and_is_never_longer_than_200_ms(
    ahead: Bench, age_ms: int, lease_ms: int, holds_ms: int
) -> None:
    ahead.run(10)
    ahead.seq += 1
    ahead.send(SetWidths(SESSION, ahead.seq, int(ahead.now_ms), age_ms, lease_ms, AHEAD))
    assert holds_ms <= ms_until_neutral(ahead) <= holds_ms + 4.0 + PERIOD_MS


@pytest.mark.parametrize(("age_ms", "lease_ms"), [(200, 200), (65535, 200), (0, 0), (300, 65535)])
def test_a_command_that_is_already_too_old_is_not_taken(ahead: Bench, age_ms: int, lease_ms: int) -> None:
    ahead.run(10)
    ahead.send(SetWidths(SESSION, 4321, int(ahead.now_ms), age_ms, lease_ms, SLOW))
    ahead.run(10)
    assert ahead.told.seq != 4321
    assert Fault.STALE in ahead.told.faults
    assert ahead.told.widths_us == AHEAD


def test_a_command_computed_before_the_last_one_is_not_taken(ahead: Bench) -> None:
    ahead.run(10)
    ahead.send(ahead.command(SLOW, stamp_ms=int(ahead.now_ms) - 100))
    ahead.run(10)
    assert Fault.REPEATED in ahead.told.faults
    assert ahead.told.widths_us == AHEAD


def are(wanted_us: float, widths: list[set[float]]) -> bool:
    return all(abs(width_us - wanted_us) <= 1.0 for found in widths for width_us in found)


def test_two_commands_of_one_moment_are_both_taken_in_the_order_of_their_numbers(ahead: Bench) -> None:
    ahead.run(10)
    stamp_ms = int(ahead.now_ms)
    first, second = (ahead.command(widths, stamp_ms=stamp_ms) for widths in (AHEAD, SLOW))
    ahead.send(first, second)
    ahead.run(100)
    assert are(SLOW[0], ahead.widths())
    ahead.send(first)
    assert are(SLOW[0], ahead.widths())
    assert ahead.told.seq == second.seq
    assert Fault.REPEATED in ahead.told.faults


def test_h11_new_numbers_make_a_command_of_one_moment_no_younger(ahead: Bench) -> None:
    stuck_ms = int(ahead.now_ms) + 1

    def send_it_as_new() -> None:
        ahead.send(ahead.command(AHEAD, stamp_ms=stuck_ms))

    assert ms_until_neutral(ahead, send_it_as_new) <= 210.0 + 3.0 + PERIOD_MS
    assert Fault.LEASE_EXPIRED in ahead.told.faults


@pytest.mark.parametrize("late_ms", [20, 100, 1000])
@pytest.mark.parametrize("age_ms", [0, 200])
def test_neutral_is_taken_however_late_it_comes(ahead: Bench, late_ms: int, age_ms: int) -> None:
    ahead.drive(AHEAD)
    seq = ahead.seq
    ahead.send(ahead.command(NEUTRAL, stamp_ms=int(ahead.now_ms) - late_ms, age_ms=age_ms))
    ahead.run(110)
    assert are(1500.0, ahead.widths())
    assert (ahead.told.seq, ahead.told.state) == (seq, State.ARMED)  # which command holds has not changed, ...
    ahead.run(200)
    assert ahead.told.state is State.DISARMED  # ... nor for how long


def test_the_computers_clock_may_begin_anew(bench: Bench) -> None:
    bench.ready()
    bench.send(bench.command(NEUTRAL, stamp_ms=2**32 - 5))
    bench.run(10)
    bench.send(bench.command(NEUTRAL, stamp_ms=5))
    bench.run(10)
    assert bench.told.seq == bench.seq
    assert bench.told.faults == Fault(0)


def test_the_age_of_the_last_command_is_told(bench: Bench) -> None:
    bench.ready()
    bench.run(60)
    assert bench.told.command_age_ms == NO_COMMAND_MS
    bench.send(bench.command(NEUTRAL, age_ms=40))
    bench.run(10)
    assert bench.told.command_age_ms == 40
    bench.run(1000)
    assert bench.told.command_age_ms == pytest.approx(1000, abs=60)
