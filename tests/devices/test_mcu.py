"""Outputs and power monitor on the microcontroller: the real firmware in simavr, over its serial line."""

import gc
import math
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from snr_sim.devices.device_loop import start_device
from snr_sim.devices.emulated.board import PINS
from snr_sim.devices.mcu.mcu import McuPower, McuPwm, PowerScale
from snr_sim.devices.wire.mcu_messages import McuState
from snr_sim.prelude.device import LEASE_S, Stale
from snr_sim.prelude.errors import DeviceError, ParameterError
from snr_sim.prelude.signals import LOST, NOT_ACTIVE, SLEWING, STOPPED, TOO_OLD
from snr_sim.testing.contracts import check_sensor
from snr_sim.testing.pwm_contract import check_pwm_out

TICK_S = 0.02
STILL = [1500.0] * 8
AHEAD = [1700.0] * 8


class Pilot:
    """Writes 50 times a second, as the loop does."""

    def __init__(self, bench: Any, out: McuPwm) -> None:
        self.bench, self.out = bench, out

    def hold(self, pulses_us: list[float], seconds: float) -> Any:
        for _ in range(round(seconds / TICK_S)):
            self.bench.advance(TICK_S)
            applied = self.out.write_us(pulses_us, self.bench.now_s())
        return applied

    def arm(self) -> None:
        self.out.configure()
        self.out.activate()
        self.hold(STILL, 2.0)
        assert self.out.health().state == "active"


@pytest.fixture
def pilot(bench: Any) -> Iterator[Pilot]:
    """Armed outputs that have followed a command ahead for half a second."""
    pilot = Pilot(bench, bench.open())
    pilot.arm()
    pilot.hold(AHEAD, 0.5)
    yield pilot
    pilot.out.close()


@pytest.mark.parametrize("mcu", list(PINS))
@pytest.mark.parametrize("channels", [8, 3])
def test_mcu_pwm_passes_pwm_contract(make_bench: Callable[..., Any], mcu: str, channels: int) -> None:
    check_pwm_out(make_bench(mcu, channels))


def test_mcu_power_passes_sensor_contract(bench: Any) -> None:
    check_sensor(lambda: McuPower(bench.open_board()))


def test_mcu_pwm_returns_pulses_at_the_pins(bench: Any) -> None:
    out = bench.open()
    pilot = Pilot(bench, out)
    pilot.arm()
    applied = pilot.hold([1900.0] * 8, 3 * TICK_S)
    assert applied.reason == [SLEWING]
    assert all(1500.0 < one < 1600.0 for one in applied.pulses_us)  # 400 us in 100 ms
    assert pilot.hold([1900.0] * 8, 0.2).pulses_us == [1900.0] * 8 == pytest.approx(bench.pins_us(), abs=0.5)
    out.close()


def test_mcu_pwm_arms_only_after_neutral_for_speed_controllers(bench: Any) -> None:
    out = start_device(bench.open(), "the outputs")
    pilot = Pilot(bench, out)
    applied = pilot.hold(AHEAD, 0.5)  # a command that is not neutral is not sent until the outputs are armed
    assert out.health().state == "activating"
    assert NOT_ACTIVE in applied.reason
    assert bench.pins_us() == pytest.approx(STILL, abs=0.5)
    pilot.hold(STILL, 1.5)
    assert out.health().state == "active"
    out.close()


def test_mcu_pwm_resent_old_command_expires(bench: Any, pilot: Pilot) -> None:
    """The lease counts from when a command was computed: a stuck planner behind a live loop stops the robot (H11)."""
    out = pilot.out
    computed_s = bench.now_s()
    for _ in range(round(LEASE_S / TICK_S) + 1):
        applied = out.write_us(AHEAD, computed_s)
        bench.advance(TICK_S)
    assert bench.pins_us() == pytest.approx(STILL, abs=0.5)
    bench.advance(0.06)  # the board sends every 50 ms, also without a command
    applied = out.write_us(AHEAD, computed_s)
    assert TOO_OLD in applied.reason
    assert out.health().state == "inactive"
    assert "no new command in time" in out.health().reason
    assert pilot.hold(AHEAD, 0.5).pulses_us == STILL  # it stays so until it is armed again
    assert bench.pins_us() == pytest.approx(STILL, abs=0.5)


def test_mcu_board_unclosed_at_exit_sends_disarm(bench: Any, pilot: Pilot) -> None:
    out = pilot.out
    out.board._finalizer()  # which Python calls at exit
    bench.advance(TICK_S)
    assert bench.pins_us() == pytest.approx(STILL, abs=0.5)


def test_mcu_pwm_sends_age_of_command(bench: Any) -> None:
    out = bench.open()
    Pilot(bench, out).arm()
    bench.advance(0.16)  # a command that was computed before the last one is not accepted
    out.write_us(AHEAD, bench.now_s() - 0.15)
    bench.advance(0.01)
    out.write_us(AHEAD, bench.now_s())
    assert 150 <= out.board.telemetry.command_age_ms < 170


def test_mcu_pwm_late_arm_reply_after_deactivate_arms_nothing(bench: Any) -> None:
    out = bench.open()
    out.configure()
    bench.advance(1.6)
    out.activate()
    out.write_us(STILL, bench.now_s())  # asks, and the answer is on its way
    out.deactivate("thought better of it")
    out.activate()
    bench.advance(0.03)
    out.write_us(STILL, bench.now_s())
    assert out.health().state == "activating"
    assert out.board.telemetry.state == McuState.DISARMED
    out.close()


def test_mcu_pwm_reset_board_is_lost_and_stays_neutral_until_armed(bench: Any, pilot: Pilot) -> None:
    out = pilot.out
    bench.board.reset()
    applied = pilot.hold(AHEAD, 0.3)
    assert LOST in applied.reason
    assert "has restarted (its reset pin" in out.health().reason
    assert bench.pins_us() == pytest.approx(STILL, abs=0.5)
    out.configure()
    pilot.hold(AHEAD, 0.5)
    assert bench.pins_us() == pytest.approx(STILL, abs=0.5)
    pilot.arm()
    pilot.hold(AHEAD, 0.5)
    assert bench.pins_us() == pytest.approx(AHEAD, abs=0.5)
    assert out.health().counts["reopened"] == 1


def test_mcu_pwm_session_of_another_program_is_reported(bench: Any) -> None:
    out = bench.open()
    pilot = Pilot(bench, out)
    pilot.arm()
    other = bench.open_board(session=500)
    other.open(other)
    applied = pilot.hold(AHEAD, 0.2)
    assert LOST in applied.reason
    assert "another program has greeted the microcontroller" in out.health().reason
    assert bench.pins_us() == pytest.approx(STILL, abs=0.5)
    out.close()
    other.release(other)


def test_mcu_pwm_emergency_stop_holds_until_cleared(bench: Any, pilot: Pilot) -> None:
    out = pilot.out
    out.stop()
    assert STOPPED in pilot.hold(AHEAD, TICK_S).reason
    assert bench.pins_us() == pytest.approx(STILL, abs=0.5)
    pilot.hold(STILL, 0.5)
    assert out.health().reason == "emergency stop"
    with pytest.raises(DeviceError, match="has its emergency stop set"):
        out.activate()
    assert out.health().state == "inactive"
    out.close()
    again = bench.open()
    with pytest.raises(DeviceError, match=r"emergency stop is set(.|\n)*clear the stop"):
        again.configure()
    again.clear_stop()
    bench.advance(0.1)
    Pilot(bench, again).arm()
    again.close()


def test_mcu_pwm_silent_board_with_open_port_is_lost(bench: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    out = bench.open()
    pilot = Pilot(bench, out)
    pilot.arm()
    monkeypatch.setattr(bench.board, "uart_out", lambda: b"")
    assert LOST in pilot.hold(STILL, 0.4).reason
    assert "no telemetry for 0." in out.health().reason
    out.close()


def test_mcu_pwm_unreferenced_outputs_are_neutral_within_one_frame(bench: Any) -> None:
    """Without `close`: not in 200 ms, when the lease expires, but as soon as they are deleted (H8)."""
    out = bench.open()
    pilot = Pilot(bench, out)
    pilot.arm()
    pilot.hold(AHEAD, 0.5)
    del out, pilot
    gc.collect()
    bench.advance(0.02)
    assert bench.pins_us() == pytest.approx(STILL, abs=0.5)


def test_mcu_pwm_line_noise_is_counted_and_changes_nothing(bench: Any, pilot: Pilot) -> None:
    out = pilot.out
    for i in range(20):
        bench.board.uart_in(bytes([i * 11 % 251 + 1, 3, i + 1, 0]))
        assert pilot.hold(AHEAD, TICK_S).pulses_us == AHEAD
    assert bench.pins_us() == pytest.approx(AHEAD, abs=0.5)
    bench.advance(0.1)
    out.write_us(AHEAD, bench.now_s())
    counts = out.health().counts
    assert counts["crc_errors_at_mcu"] >= 20
    assert counts["crc_errors"] == counts["gaps"] == 0


def test_mcu_pwm_too_few_channels_raises_device_error(bench: Any) -> None:
    out = McuPwm(bench.open_board(), bench.now_s, 9)
    with pytest.raises(DeviceError, match=r"8 channels \(required: 9 at least\)(.|\n)*a second board"):
        out.configure()
    out.close()


def test_mcu_power_equals_pin_voltage_and_is_stale_when_unplugged(bench: Any) -> None:
    scale = PowerScale()
    for pin, millivolts in enumerate(scale.pins_mv(14.8, 25.0)):
        bench.board.set_millivolts(pin, millivolts)
    bench.advance(0.1)
    board = bench.open_board()
    power, out = McuPower(board, scale), McuPwm(board, bench.now_s, 8)  # on one board
    power.configure()
    power.activate()
    out.configure()
    reading = power.read()
    assert not isinstance(reading, Stale)
    assert reading.voltage_v == pytest.approx(14.8, abs=11.0 * 5.0 / 1024)
    assert reading.current_a == pytest.approx(25.0, abs=37.9 * 5.0 / 1024)
    assert reading.stamp_s == pytest.approx(bench.now_s(), abs=0.06)
    bench.unplug()
    gone = power.read()
    assert isinstance(gone, Stale)
    assert gone.since_s == reading.stamp_s
    bench.plug_in()
    board.mark_lost("pulled")
    out.fail("pulled")
    out.configure()  # the device that acts brings it back for both
    assert not isinstance(power.read(), Stale)
    out.close()
    assert not isinstance(power.read(), Stale), "the board stays open for its other user"
    power.close()
    assert not board.is_open


def test_power_scale_zero_raises_error() -> None:
    with pytest.raises(ParameterError, match="must be positive"):
        PowerScale(volts_per_volt=0.0)
    assert PowerScale().pins_mv(1000.0, -1000.0) == (5000.0, 0.0)
    assert math.isclose(PowerScale().reading(*PowerScale().pins_mv(14.8, 25.0), 1.0).current_a, 25.0, abs_tol=1e-3)
