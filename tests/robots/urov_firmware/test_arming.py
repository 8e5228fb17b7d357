"""Conditions of arming and disarming, and which clients may send commands."""

import pytest

from snr_sim.devices.wire.mcu_messages import (
    TYPE_OF,
    AckResult,
    Arm,
    ClearStop,
    CommandAck,
    Disarm,
    EmergencyStop,
    Hello,
    Ident,
    McuFault,
    McuState,
    ResetCause,
    SetWidths,
)

from .conftest import NEUTRAL, SESSION, TICK_MS, Bench

AHEAD = (1700.0,) * 8
STOP_WITHIN_MS = 20.0


def is_neutral(bench: Bench, ms: float = 20) -> bool:
    return all(abs(width_us - 1500.0) <= 1.0 for found in bench.widths(ms) for width_us in found)


def test_h4_arming_before_neutral_time_is_rejected(bench: Bench) -> None:
    bench.run(20)
    bench.send(Hello(SESSION))
    bench.drive(NEUTRAL, 1400)
    assert bench.telemetry.state is McuState.STARTING
    assert bench.ask(Arm(SESSION)) is AckResult.STARTING
    bench.drive(NEUTRAL, 100)
    assert bench.telemetry.state is McuState.DISARMED
    assert bench.ask(Arm(SESSION)) is AckResult.DONE
    bench.drive(NEUTRAL)
    assert bench.telemetry.state is McuState.ARMED


def test_h4_cleared_stop_keeps_neutral_time(bench: Bench) -> None:
    bench.run(20)
    bench.send(Hello(SESSION))
    assert bench.ask(EmergencyStop()) is AckResult.DONE
    assert bench.ask(ClearStop(SESSION)) is AckResult.DONE
    bench.drive(NEUTRAL, 100)
    assert bench.telemetry.state is McuState.STARTING
    assert bench.ask(Arm(SESSION)) is AckResult.STARTING


def test_h3_arming_without_valid_command_is_rejected(bench: Bench) -> None:
    bench.ready()
    assert bench.ask(Arm(SESSION)) is AckResult.NO_COMMAND
    bench.drive(NEUTRAL)
    bench.run(200)
    assert bench.ask(Arm(SESSION)) is AckResult.NO_COMMAND


@pytest.mark.parametrize("channel", range(8))
@pytest.mark.parametrize("width_us", [1500.5, 1900.0, 0.0])
def test_h3_arming_with_channel_off_neutral_is_rejected(bench: Bench, channel: int, width_us: float) -> None:
    bench.ready()
    bench.drive(tuple(width_us if i == channel else 1500.0 for i in range(8)))
    assert bench.ask(Arm(SESSION)) is AckResult.NOT_NEUTRAL
    assert is_neutral(bench)


def test_unarmed_commands_keep_outputs_neutral(bench: Bench) -> None:
    bench.ready()
    bench.drive(AHEAD, 300)
    assert is_neutral(bench)
    assert bench.telemetry.state is McuState.DISARMED


def test_disarm_sets_neutral_without_slew(bench: Bench) -> None:
    bench.armed()
    bench.drive(AHEAD, 150)
    assert bench.ask(Disarm(SESSION)) is AckResult.DONE
    assert is_neutral(bench)
    bench.drive(AHEAD, 100)
    assert is_neutral(bench)


def test_h3_link_loss_keeps_neutral_until_rearmed(bench: Bench) -> None:
    bench.armed()
    bench.drive(AHEAD, 150)
    bench.run(300)
    assert bench.telemetry.faults == McuFault.LEASE_EXPIRED
    bench.drive(AHEAD, 300)
    assert is_neutral(bench)
    assert bench.ask(Arm(SESSION)) is AckResult.NOT_NEUTRAL
    bench.drive(NEUTRAL)
    assert bench.ask(Arm(SESSION)) is AckResult.DONE
    bench.drive(AHEAD, 100)
    assert bench.telemetry.widths_us == AHEAD
    assert bench.telemetry.faults == McuFault(0)


def test_h3_reset_keeps_neutral_until_hello_and_arm(bench: Bench) -> None:
    bench.armed()
    bench.drive(AHEAD, 150)
    bench.board.reset()
    bench.run(20)
    bench.pulses.clear()
    bench.drive(AHEAD, 1600)
    assert bench.telemetry.reset_cause is ResetCause.EXTERNAL
    assert bench.telemetry.session == 0
    assert bench.last(CommandAck).result is AckResult.OTHER_SESSION
    assert bench.ask(Arm(SESSION)) is AckResult.OTHER_SESSION
    assert all(abs(pulse.width_us - 1500.0) <= 1.0 for pulse in bench.pulses)
    bench.send(Hello(SESSION))
    bench.drive(NEUTRAL, 20)
    assert bench.ask(Arm(SESSION)) is AckResult.DONE


def test_hello_is_answered_with_identity(bench: Bench, mcu: str) -> None:
    bench.ready()
    bench.run(TICK_MS)
    ident = bench.last(Ident)
    assert (ident.protocol, ident.channels, ident.mcu, ident.name) == (1, 8, mcu, "snr_sim esc")
    assert (ident.lowest_us, ident.neutral_us, ident.highest_us, ident.dead_band_us) == (1100.0, 1500.0, 1900.0, 25.0)
    assert (ident.resolution_ns, ident.period_us, ident.max_lease_ms, ident.esc_start_ms) == (500, 8000, 200, 1500)
    assert (ident.slew_us_per_100ms, ident.dwell_ms) == (400, 50)
    assert ident.session == SESSION


def test_hello_with_other_protocol_is_refused(bench: Bench) -> None:
    bench.ready()
    assert bench.ask(Hello(SESSION + 1, protocol=2)) is AckResult.OTHER_PROTOCOL
    bench.run(100)
    assert bench.telemetry.session == SESSION


def test_hello_of_second_program_takes_over_and_disarms_first(bench: Bench) -> None:
    bench.armed()
    bench.drive(AHEAD, 150)
    bench.send(Hello(SESSION + 1))
    bench.run(20)
    bench.received.clear()
    bench.drive(AHEAD, 200)
    assert is_neutral(bench)
    assert bench.last(CommandAck) == CommandAck(
        bench.last(CommandAck).frame_count, SESSION + 1, TYPE_OF[SetWidths], AckResult.OTHER_SESSION
    )
    assert bench.telemetry.session == SESSION + 1
    assert bench.telemetry.faults == McuFault.OTHER_SESSION


def test_repeated_hello_of_same_program_keeps_armed(bench: Bench) -> None:
    bench.armed()
    bench.send(Hello(SESSION))
    bench.drive(AHEAD, 150)
    assert bench.telemetry.widths_us == AHEAD


@pytest.mark.parametrize("session", [SESSION, 0, 9999])
def test_h10_emergency_stop_on_busy_line_is_applied_and_latched(bench: Bench, session: int) -> None:
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
    assert bench.telemetry.state is McuState.STOPPED
    assert McuFault.STOPPED in bench.telemetry.faults
    assert bench.last(CommandAck).result is AckResult.STOPPED


def test_h10_emergency_stop_ends_only_by_clear_and_leaves_disarmed(bench: Bench) -> None:
    bench.armed()
    assert bench.ask(EmergencyStop()) is AckResult.DONE
    bench.send(Hello(SESSION + 1), Disarm(SESSION + 1), Hello(SESSION))
    bench.run(1000)
    bench.drive(NEUTRAL)
    assert bench.ask(Arm(SESSION)) is AckResult.STOPPED
    assert bench.ask(ClearStop(SESSION)) is AckResult.DONE
    bench.drive(AHEAD, 50)
    assert (bench.telemetry.state, bench.telemetry.widths_us, bench.telemetry.faults) == (
        McuState.DISARMED,
        NEUTRAL,
        McuFault(0),
    )
    bench.drive(NEUTRAL)
    assert bench.ask(Arm(SESSION)) is AckResult.DONE
