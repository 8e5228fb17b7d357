"""The line: garbage, floods, telemetry, and that two runs are one."""

import hashlib
import random
from binascii import crc_hqx
from collections.abc import Callable

import pytest

from snr_sim.devices.wire.cobs import encode as cobs
from snr_sim.devices.wire.mcu_frames import encode
from snr_sim.devices.wire.mcu_messages import (
    Arm,
    ClearStop,
    Disarm,
    EmergencyStop,
    Hello,
    McuFault,
    McuState,
    ResetCause,
    SetWidths,
    Telemetry,
)

from .conftest import NEUTRAL, SESSION, Bench

AHEAD = (1700.0,) * 8
FUZZ_BYTES = 100_000
FULL = SetWidths(SESSION, 9, 2**31, 0, 200, (1900.0,) * 8)
DANGEROUS = [FULL, Arm(SESSION), Disarm(SESSION), EmergencyStop(), ClearStop(SESSION), Hello(SESSION + 1)]


def garbage(rng: random.Random) -> bytes:
    """40 to 70 bytes: noise, or frames that would change something, with flipped bits or cut off."""
    data = bytearray()
    while len(data) < 40:
        frame = bytearray(encode(rng.choice(DANGEROUS)))
        kind = rng.randrange(3)
        if kind == 0:
            frame = bytearray(rng.randbytes(rng.randrange(1, 30)))
        elif kind == 1:
            for bit in rng.sample(range(8 * (len(frame) - 1)), rng.randrange(1, 4)):
                frame[bit // 8] ^= 1 << bit % 8
        else:
            frame = frame[rng.randrange(1, len(frame) - 1) :] if rng.random() < 0.5 else frame[: rng.randrange(1, 6)]
            frame += b"\0"
        data += frame
    return bytes(data)


def test_h5_100000_garbage_bytes_keep_outputs(bench: Bench) -> None:
    rng = random.Random(5)
    bench.armed()
    bench.drive(AHEAD, 150)
    sent, errors = 0, bench.telemetry.crc_errors
    bench.pulses.clear()
    while sent < FUZZ_BYTES:
        noise = garbage(rng)
        sent += len(noise)
        bench.board.uart_in(noise + b"\0")
        bench.send(bench.command(AHEAD))
        bench.run(10)
    assert len(bench.pulses) > 900 * 8
    assert all(abs(pulse.width_us - 1700.0) <= 1.0 for pulse in bench.pulses)
    assert bench.telemetry.state is McuState.ARMED
    assert bench.telemetry.crc_errors > errors + 1000
    assert McuFault.OVERRUN not in bench.telemetry.faults
    assert bench.board.resets == 0


def test_h5_garbage_alone_keeps_disarmed(bench: Bench) -> None:
    rng = random.Random(6)
    bench.ready()
    for _ in range(200):
        bench.board.uart_in(rng.randbytes(110))
        bench.run(10)
    assert all(abs(pulse.width_us - 1500.0) <= 1.0 for pulse in bench.pulses)
    assert bench.telemetry.state is McuState.DISARMED


def test_bytes_without_delimiter_are_dropped(bench: Bench) -> None:
    bench.armed()
    bench.board.uart_in(b"\x55" * 1000 + b"\0")
    bench.send(bench.command(NEUTRAL))
    bench.run(150)
    assert bench.telemetry.seq == bench.seq
    assert bench.telemetry.crc_errors == 1


def test_oversized_frame_is_dropped_completely(bench: Bench) -> None:
    bench.armed()
    body = b"\x05" + b"\x11" * 93  # an emergency stop may be of any length
    long = body + crc_hqx(body, 0).to_bytes(2, "big") + b"\x22"
    bench.board.uart_in(cobs(long) + b"\0")
    bench.drive(AHEAD, 50)
    assert bench.telemetry.state is McuState.ARMED
    assert bench.telemetry.crc_errors == 1
    bench.board.uart_in(cobs(long[:-1]) + b"\0")
    bench.drive(AHEAD, 50)
    assert bench.telemetry.state is McuState.STOPPED


def test_frame_of_unknown_type_is_reported_and_ignored(bench: Bench) -> None:
    bench.armed()
    bench.board.uart_in(cobs(b"\x44\x01" + crc_hqx(b"\x44\x01", 0).to_bytes(2, "big")) + b"\0")
    bench.drive(AHEAD, 100)
    assert bench.telemetry.faults == McuFault.UNKNOWN_TYPE
    assert bench.telemetry.widths_us == AHEAD


def test_telemetry_is_sent_at_20_hz_without_request(bench: Bench) -> None:
    bench.run(1010)
    telemetry = [message for message in bench.received if isinstance(message, Telemetry)]
    assert len(telemetry) == 20
    assert [message.frame_count for message in telemetry] == list(range(20))
    assert {(message.session, message.seq, message.faults) for message in telemetry} == {(0, 0, McuFault(0))}
    assert telemetry[-1].uptime_ms == pytest.approx(1000, abs=2)
    assert telemetry[-1].reset_cause is ResetCause.POWER_ON


def test_telemetry_reports_number_of_each_command(bench: Bench) -> None:
    bench.ready()
    for _ in range(20):
        bench.drive(NEUTRAL)
        assert bench.telemetry.seq == bench.seq
    assert (bench.frames.crc_errors, bench.frames.gaps) == (0, 0)


@pytest.mark.parametrize("supply_mv", [5000, 4750, 4200, 3300])
def test_sagging_supply_keeps_battery_voltage_correct(bench: Bench, supply_mv: int) -> None:
    bench.board.set_millivolts(0, 1345)
    bench.board.set_millivolts(1, 600)
    bench.board.set_supply_millivolts(supply_mv)
    bench.run(100)
    assert bench.telemetry.battery_pin_mv == pytest.approx(1345, abs=10)
    assert bench.telemetry.current_pin_mv == pytest.approx(600, abs=10)


def test_measured_reference_corrects_voltages(make_bench: Callable[..., Bench], mcu: str) -> None:
    bench = make_bench(mcu, BANDGAP_MV=1045)  # a chip whose reference is 5 % lower; simavr's has 1100 mV
    bench.board.set_millivolts(0, 2000)
    bench.run(100)
    assert bench.telemetry.battery_pin_mv == pytest.approx(1900, abs=10)


@pytest.mark.parametrize("millivolts", [0, 330, 1450, 2500, 4995])
def test_pin_voltages_are_reported_within_two_adc_steps(bench: Bench, millivolts: int) -> None:
    bench.board.set_millivolts(0, millivolts)
    bench.board.set_millivolts(1, 4995 - millivolts)
    bench.run(110)
    assert bench.telemetry.battery_pin_mv == pytest.approx(millivolts, abs=10)
    assert bench.telemetry.current_pin_mv == pytest.approx(4995 - millivolts, abs=10)


TCCR1B, TIMSK1, TCCR3B, TCCR4B = 0x81, 0x6F, 0x91, 0xA1  # addresses; a timer whose TCCRnB is cleared stands still
HANGS = {"with-interrupts": 0, "without-interrupts": 1, "timer-1-stops": TCCR1B, "no-interrupts-by-it": TIMSK1}


@pytest.mark.parametrize("kind", HANGS.values(), ids=HANGS)
def test_h2_watchdog_sets_neutral_within_200_ms_of_hang(make_bench: Callable[..., Bench], mcu: str, kind: int) -> None:
    assert_neutral_after(make_bench(mcu, HANG=1), kind)


@pytest.mark.parametrize("register", [TCCR3B, TCCR4B], ids=["timer-3", "timer-4"])
def test_h2_watchdog_detects_each_stopped_timer_of_mega(make_bench: Callable[..., Bench], register: int) -> None:
    assert_neutral_after(make_bench("atmega2560", HANG=1), register)


def assert_neutral_after(bench: Bench, kind: int) -> None:
    """Assert that all outputs are neutral 200 ms after the firmware was made to hang, and that it reports why."""
    bench.armed()
    bench.drive(AHEAD, 150)
    order = bytes([0x7F, kind])
    bench.board.uart_in(cobs(order + crc_hqx(order, 0).to_bytes(2, "big")) + b"\0")
    begin_us = bench.board.now_us
    bench.pulses.clear()
    bench.run(500)
    late = [pulse for pulse in bench.pulses if pulse.rise_us > begin_us + 200_000]
    assert {pulse.channel for pulse in late} == set(range(8))
    assert all(abs(pulse.width_us - 1500.0) <= 1.0 for pulse in late)
    assert (bench.telemetry.state, bench.telemetry.reset_cause) == (McuState.STARTING, ResetCause.WATCHDOG)
    assert bench.board.resets == 1


def test_repeated_run_equals_first_to_the_cycle(make_bench, mcu: str) -> None:
    def digest() -> str:
        bench: Bench = make_bench(mcu)
        rng = random.Random(7)
        received = hashlib.sha256()
        bench.armed()
        for _ in range(300):
            bench.board.uart_in(garbage(rng)[:30])
            bench.send(bench.command(tuple(rng.randrange(2200, 3801) / 2 for _ in range(8))))
            bench.board.run_us(10_000)
            received.update(bench.board.uart_out())
            received.update(repr(bench.board.pulses()).encode())
        return received.hexdigest()

    assert digest() == digest()
