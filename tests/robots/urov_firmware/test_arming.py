"""Conditions of arming and disarming, and which clients may send commands."""

import pytest

from snr_sim.devices.wire.mcu_messages import (
    TYPE_OF,
    Answer,
    Arm,
    ClearStop,
    Disarm,
    EmergencyStop,
    Fault,
    Hello,
    Ident,
    ResetCause,
    Result,
    SetWidths,
    State,
)

from .conftest import NEUTRAL, SESSION, TICK_MS, Bench

AHEAD = (1700.0,) * 8
STOP_WITHIN_MS = 20.0


def is_neutral(bench: Bench, ms: float = 20) -> bool:
    return all(abs(width_us - 1500.0) <= 1.0 for found in bench.widths(ms) for width_us in found)


def test_h4_it_is_not_armed_before_the_speed_controllers_have_been_shown_neutral(bench: Bench) -> None:
    bench.run(20)
    bench.send(Hello(SESSION))
    bench.drive(NEUTRAL, 1400)
    assert bench.told.state is State.STARTING
    assert bench.ask(Arm(SESSION)) is Result.STARTING
    bench.drive(NEUTRAL, 100)
    assert bench.told.state is State.DISARMED
    assert bench.ask(Arm(SESSION)) is Result.DONE
    bench.drive(NEUTRAL)
    assert bench.told.state is State.ARMED


def test_h4_a_stop_that_is_cleared_does_not_shorten_the_time_in_which_neutral_is_shown(bench: Bench) -> None:
    bench.run(20)
    bench.send(Hello(SESSION))
    assert bench.ask(EmergencyStop()) is Result.DONE
    assert bench.ask(ClearStop(SESSION)) is Result.DONE
    bench.drive(NEUTRAL, 100)
    assert bench.told.state is State.STARTING
    assert bench.ask(Arm(SESSION)) is Result.STARTING


def test_h3_it_is_not_armed_without_a_command_in_force(bench: Bench) -> None:
    bench.ready()
    assert bench.ask(Arm(SESSION)) is Result.NO_COMMAND
    bench.drive(NEUTRAL)
    bench.run(200)
    assert bench.ask(Arm(SESSION)) is Result.NO_COMMAND


@pytest.mark.parametrize("channel", range(8))
@pytest.mark.parametrize("width_us", [1500.5, 1900.0, 0.0])
def test_h3_it_is_not_armed_unless_each_channel_is_neutral(bench: Bench, channel: int, width_us: float) -> None:
    bench.ready()
    bench.drive(tuple(width_us if i == channel else 1500.0 for i in range(8)))
    assert bench.ask(Arm(SESSION)) is Result.NOT_NEUTRAL
    assert is_neutral(bench)


def test_commands_alone_move_nothing(bench: Bench) -> None:
    bench.ready()
    bench.drive(AHEAD, 300)
    assert is_neutral(bench)
    assert bench.told.state is State.DISARMED


def test_disarming_is_neutral_at_once_without_slew(bench: Bench) -> None:
    bench.armed()
    bench.drive(AHEAD, 150)
    assert bench.ask(Disarm(SESSION)) is Result.DONE
    assert is_neutral(bench)
    bench.drive(AHEAD, 100)
    assert is_neutral(bench)


def test_h3_after_the_link_was_lost_nothing_moves_before_it_is_armed_again(bench: Bench) -> None:
    bench.armed()
    bench.drive(AHEAD, 150)
    bench.run(300)
    assert bench.told.faults == Fault.LEASE_EXPIRED
    bench.drive(AHEAD, 300)
    assert is_neutral(bench)
    assert bench.ask(Arm(SESSION)) is Result.NOT_NEUTRAL
    bench.drive(NEUTRAL)
    assert bench.ask(Arm(SESSION)) is Result.DONE
    bench.drive(AHEAD, 100)
    assert bench.told.widths_us == AHEAD
    assert bench.told.faults == Fault(0)


def test_h3_after_a_reset_nothing_moves_before_somebody_says_hello_and_arms(bench: Bench) -> None:
    bench.armed()
    bench.drive(AHEAD, 150)
    bench.board.reset()
    bench.run(20)
    bench.pulses.clear()
    bench.drive(AHEAD, 1600)
    assert bench.told.reset_cause is ResetCause.EXTERNAL
    assert bench.told.session == 0
    assert bench.last(Answer).result is Result.OTHER_SESSION
    assert bench.ask(Arm(SESSION)) is Result.OTHER_SESSION
    assert all(abs(pulse.width_us - 1500.0) <= 1.0 for pulse in bench.pulses)
    bench.send(Hello(SESSION))
    bench.drive(NEUTRAL, 20)
    assert bench.ask(Arm(SESSION)) is Result.DONE


def test_who_says_hello_is_told_what_it_is(bench: Bench, mcu: str) -> None:
    bench.ready()
    bench.run(TICK_MS)
    ident = bench.last(Ident)
    assert (ident.protocol, ident.channels, ident.mcu, ident.name) == (1, 8, mcu, "snr_sim esc")
    assert (ident.lowest_us, ident.neutral_us, ident.highest_us, ident.dead_band_us) == (1100.0, 1500.0, 1900.0, 25.0)
    assert (ident.resolution_ns, ident.period_us, ident.most_lease_ms, ident.esc_start_ms) == (500, 8000, 200, 1500)
    assert (ident.slew_us_per_100ms, ident.dwell_ms) == (400, 50)
    assert ident.session == SESSION


def test_another_protocol_is_refused(bench: Bench) -> None:
    bench.ready()
    assert bench.ask(Hello(SESSION + 1, protocol=2)) is Result.OTHER_PROTOCOL
    bench.run(100)
    assert bench.told.session == SESSION


def test_of_two_programs_the_last_one_that_said_hello_is_heard_and_the_first_is_disarmed(bench: Bench) -> None:
    bench.armed()
    bench.drive(AHEAD, 150)
    bench.send(Hello(SESSION + 1))
    bench.run(20)
    bench.heard.clear()
    bench.drive(AHEAD, 200)
    assert is_neutral(bench)
    assert bench.last(Answer) == Answer(bench.last(Answer).nth, SESSION + 1, TYPE_OF[SetWidths], Result.OTHER_SESSION)
    assert bench.told.session == SESSION + 1
    assert bench.told.faults == Fault.OTHER_SESSION


def test_hello_of_the_same_program_again_does_not_disarm(bench: Bench) -> None:
    bench.armed()
    bench.send(Hello(SESSION))
    bench.drive(AHEAD, 150)
    assert bench.told.widths_us == AHEAD


@pytest.mark.parametrize("session", [SESSION, 0, 9999])
def test_h10_an_emergency_stop_is_heard_on_a_full_line_and_stays(bench: Bench, session: int) -> None:
    bench.armed()
    bench.drive(AHEAD, 150)

    def fill_the_line(ms: float) -> None:
        for _ in range(round(ms / 10)):
            bench.send(*[bench.command(AHEAD) for _ in range(4)], Arm(SESSION))
            bench.run(10)

    fill_the_line(100)
    bench.send(EmergencyStop(session))
    while bench.board.waiting:
        bench.run(1)
    begin_us = bench.board.now_us
    bench.pulses.clear()
    fill_the_line(1000)
    late = [pulse for pulse in bench.pulses if pulse.rise_us > begin_us + STOP_WITHIN_MS * 1000]
    assert len(late) > 500
    assert all(abs(pulse.width_us - 1500.0) <= 1.0 for pulse in late)
    assert bench.told.state is State.STOPPED
    assert Fault.STOPPED in bench.told.faults
    assert bench.last(Answer).result is Result.STOPPED


def test_h10_only_clearing_ends_an_emergency_stop_and_then_it_is_disarmed(bench: Bench) -> None:
    bench.armed()
    assert bench.ask(EmergencyStop()) is Result.DONE
    bench.send(Hello(SESSION + 1), Disarm(SESSION + 1), Hello(SESSION))
    bench.run(1000)
    bench.drive(NEUTRAL)
    assert bench.ask(Arm(SESSION)) is Result.STOPPED
    assert bench.ask(ClearStop(SESSION)) is Result.DONE
    bench.drive(AHEAD, 50)
    assert (bench.told.state, bench.told.widths_us, bench.told.faults) == (State.DISARMED, NEUTRAL, Fault(0))
    bench.drive(NEUTRAL)
    assert bench.ask(Arm(SESSION)) is Result.DONE
