"""Motors behind VESC controllers, by the real bytes of emulated ones: commands, readings, and what fails on the way."""

import math
from collections.abc import Callable
from typing import Any

import pytest

from snr_sim.devices.emulated.emulated_vesc import ScriptedFault
from snr_sim.devices.emulated.vesc_plant import TICK_S, VescPlant
from snr_sim.devices.motors.motor_backend import RELEASE_S
from snr_sim.devices.motors.vesc_line import ANSWER_S, VescLine
from snr_sim.devices.motors.vesc_motors import FRESH_S, VescMotors, VescSensor
from snr_sim.devices.wire.vesc_messages import Firmware
from snr_sim.prelude.device import Health
from snr_sim.prelude.errors import CommandError, DeviceError
from snr_sim.prelude.ground_signals import NEUTRAL_BRAKE_A, DriveCommand, MotorReading
from snr_sim.prelude.life_cycle import LifeCycle
from snr_sim.testing.contracts import check_actuator, check_sensor
from snr_sim.testing.fakes import FakePlant
from tests.devices.benches import stale

NAMES = ("motor_LF", "motor_RF")
ERPM_PER_RPM = 228.0
LIMITS = {"speed": 18.0, "current": 6.0, "brake": 6.0, "duty": 1.0}
STATE = MotorReading(3.0, 1.5, 0.5, 0.25, 24.0, 7.0, 0.0)
TIMEOUT_S = 0.25  # of the controllers
STEP = 1e-3  # of the bytes, or less


def started(device: Any) -> Any:
    device.configure()
    device.activate()
    return device


class Bench:
    """Two controllers, and the devices that share them. The plant notes what its motors do, and does not move."""

    def __init__(self, **faults: ScriptedFault) -> None:
        self.fake = FakePlant(dict.fromkeys(NAMES, STATE), NAMES)
        self.plant = VescPlant(self.fake, NAMES, ERPM_PER_RPM, {name: [fault] for name, fault in faults.items()})
        self.lines = [self.line(name) for name in NAMES]

    def line(self, name: str) -> VescLine:
        path = f"/dev/ttyACM{NAMES.index(name)}"
        return VescLine(name, lambda: self.plant.open_port(path), lambda: self.plant.time_s, ERPM_PER_RPM)

    def motors(self, **options: Any) -> VescMotors:
        return VescMotors(self.lines, LIMITS, NEUTRAL_BRAKE_A, **options)

    def sensors(self) -> list[VescSensor]:
        return [started(VescSensor(line)) for line in self.lines]

    def do(self, name: str) -> tuple[str, float]:
        """Return what a motor does."""
        command = next(command for at, command in reversed(self.fake.written) if at == name)
        return command.mode, command.values[0]

    def advance(self, seconds: float, each: Callable[[], Any] = lambda: None) -> None:
        for _ in range(round(seconds / TICK_S)):
            self.plant.step(TICK_S)
            each()


def test_vesc_motors_pass_actuator_contract() -> None:
    check_actuator(lambda: Bench().motors(), DriveCommand("speed", [2.0, -2.0]))


def test_vesc_sensor_passes_sensor_contract() -> None:
    check_sensor(lambda: VescSensor(Bench().lines[0]))


@pytest.mark.parametrize(
    ("command", "applied", "does"),
    [
        (DriveCommand("speed", [3.0, -3.0]), [3.0, -3.0], [("speed", 3.0), ("speed", -3.0)]),
        (DriveCommand("speed", [99.0, -99.0]), [18.0, -18.0], [("speed", 18.0), ("speed", -18.0)]),
        (DriveCommand("current", [7.0, -2.5]), [6.0, -2.5], [("current", 6.0), ("current", -2.5)]),
        (DriveCommand("duty", [0.57, -2.0]), [0.57, -1.0], [("duty", 0.57), ("duty", -1.0)]),
        (DriveCommand("brake", [5.0, -9.0]), [5.0, -6.0], [("brake", 5.0), ("brake", 6.0)]),
        (DriveCommand("off", [5.0, 99.0]), [5.0, 99.0], [("current", 0.0), ("current", 0.0)]),
        (DriveCommand("speed"), [], [("brake", NEUTRAL_BRAKE_A), ("brake", NEUTRAL_BRAKE_A)]),
    ],
    ids=lambda one: f"{one.mode} {one.values}" if isinstance(one, DriveCommand) else "",
)
def test_command_is_clamped_and_reaches_each_motor(
    command: DriveCommand, applied: list[float], does: list[tuple[str, float]]
) -> None:
    bench = Bench()
    motors = started(bench.motors())
    assert motors.write(command) == DriveCommand(command.mode, applied)
    for name, (mode, value) in zip(NAMES, does, strict=True):
        assert bench.do(name) == (mode, pytest.approx(value, abs=STEP))


@pytest.mark.parametrize(
    ("command", "message"),
    [
        (DriveCommand("speed", [1.0]), "has 1 values, and there are 2 motors"),
        (DriveCommand("speed", [1.0, math.nan]), r"drive.values\[1\] must be finite"),
        (DriveCommand("off", [1.0, math.inf]), r"drive.values\[1\] must be finite"),
        (DriveCommand("sped", [1.0, 1.0]), "did you mean 'speed'"),  # type: ignore[arg-type]
        ({"mode": "speed"}, "not dict"),
    ],
)
def test_invalid_command_is_refused_and_the_last_one_stays(command: Any, message: str) -> None:
    bench = Bench()
    motors = started(bench.motors())
    motors.write(DriveCommand("speed", [2.0, 2.0]))
    before = list(bench.fake.written)
    with pytest.raises(CommandError, match=message):
        motors.write(command)
    assert bench.fake.written == before


def test_motors_brake_until_active_and_after_their_end() -> None:
    bench = Bench()
    motors = bench.motors()
    motors.configure()
    assert motors.write(DriveCommand("speed", [2.0, 2.0])) == DriveCommand("speed")
    assert bench.do("motor_LF") == ("brake", NEUTRAL_BRAKE_A)
    motors.activate()
    motors.write(DriveCommand("speed", [2.0, 2.0]))
    motors.close()
    assert bench.do("motor_RF") == ("current", 0.0)
    bench.advance(TIMEOUT_S + 2 * TICK_S)
    assert bench.do("motor_RF") == ("brake", NEUTRAL_BRAKE_A)
    with pytest.raises(DeviceError, match="were closed"):
        motors.write(DriveCommand())


def test_motor_without_commands_brakes_by_its_controllers_timeout() -> None:
    bench = Bench()
    started(bench.motors()).write(DriveCommand("speed", [2.0, 2.0]))
    bench.advance(TIMEOUT_S)
    assert bench.do("motor_LF")[0] == "speed"
    bench.advance(2 * TICK_S)
    assert [bench.do(name) for name in NAMES] == [("brake", NEUTRAL_BRAKE_A)] * 2


def test_reading_is_that_of_the_motor_to_the_steps_of_its_bytes() -> None:
    bench = Bench()
    sensor = bench.sensors()[0]
    bench.advance(0.1)
    reading = sensor.read()
    assert isinstance(reading, MotorReading)
    assert reading.stamp_s == bench.plant.time_s
    assert reading.speed_radps == pytest.approx(STATE.speed_radps, abs=5e-4)
    assert reading.turned_rad == pytest.approx(STATE.turned_rad, abs=5e-3)  # 6 x 228 steps in a turn
    assert (reading.current_a, reading.battery_a, reading.duty, reading.voltage_v) == (1.5, 0.5, 0.25, 24.0)
    assert sensor.health().counts == {"frames": 2, "damaged": 0, "skipped": 0, "unknown": 0}


def readings(bench: Bench, command: DriveCommand, seconds: float) -> list[list[Any]]:
    """Return what sensors read while motors are commanded, by time."""
    motors, sensors = started(bench.motors()), bench.sensors()
    found: list[list[Any]] = []

    def tick() -> None:
        motors.write(command)
        found.append([sensor.read() for sensor in sensors])

    bench.advance(seconds, tick)
    return found


@pytest.mark.parametrize(
    ("kind", "reason"),
    [("mute", "sends nothing"), ("garbage", "bytes that are not its answer"), ("brown_out", "sends nothing")],
)
def test_failed_controller_is_reported_while_others_continue(kind: Any, reason: str) -> None:
    bench = Bench(motor_LF=ScriptedFault(kind, 0.3, 0.8))
    found = readings(bench, DriveCommand("speed", [2.0, 2.0]), 1.5)
    times_s = [TICK_S * (i + 1) for i in range(len(found))]
    lost = [
        (time_s, left) for time_s, (left, _) in zip(times_s, found, strict=True) if not hasattr(left, "speed_radps")
    ]
    assert lost[0][0] == pytest.approx(0.3 + FRESH_S, abs=2 * TICK_S)
    assert lost[-1][0] <= 0.8 + ANSWER_S + TICK_S, "it answers again"
    assert all(reason in stale(left) and "motor_LF" in stale(left) for _, left in lost)
    assert lost[0][1].since_s == pytest.approx(0.3, abs=2 * TICK_S)
    assert all(isinstance(right, MotorReading) for _, right in found)
    assert bench.do("motor_RF") == ("speed", pytest.approx(2.0, abs=STEP))
    assert bench.do("motor_LF") == ("speed", pytest.approx(2.0, abs=STEP)), "mute, it still receives"


def test_controller_without_power_lets_its_motor_turn_freely() -> None:
    bench = Bench(motor_LF=ScriptedFault("brown_out", 0.3, 0.8))
    readings(bench, DriveCommand("speed", [2.0, 2.0]), 0.5)
    assert bench.do("motor_LF")[0] == "off"
    assert bench.do("motor_RF")[0] == "speed"


def test_slow_controller_is_read_less_often_with_the_time_of_the_request() -> None:
    bench = Bench(motor_LF=ScriptedFault("slow", 0.3, 9.0, delay_s=0.1))
    found = readings(bench, DriveCommand("speed", [2.0, 2.0]), 2.0)
    stamps_s = {left.stamp_s for left, _ in found[-50:]}
    assert 4 <= len(stamps_s) <= 6
    assert max(stamps_s) <= bench.plant.time_s - 0.1 + TICK_S


def test_controller_that_reports_a_fault_has_no_reading() -> None:
    bench = Bench(motor_LF=ScriptedFault("motor", 0.3, 0.8, text="fet_hot"))
    found = readings(bench, DriveCommand("speed", [2.0, 2.0]), 0.5)
    assert "has switched its motor off: fet_hot" in stale(found[-1][0])


@pytest.mark.parametrize(
    ("kind", "found"), [("mute", "sent nothing"), ("garbage", "sent [0-9]+ bytes, but not its firmware's version")]
)
def test_controller_that_does_not_answer_at_first_is_refused_by_name(kind: Any, found: str) -> None:
    motors = Bench(motor_RF=ScriptedFault(kind, 0.0, 9.0)).motors()
    with pytest.raises(DeviceError, match=f"controller of motor_RF at .* 4 times who it is, and {found}"):
        motors.configure()
    assert motors.state == "error"


def test_unknown_firmware_is_refused() -> None:
    bench = Bench()
    bench.plant._controllers["motor_LF"]._version = Firmware(9, 1)
    with pytest.raises(DeviceError, match=r"VESC firmware 9\.1"):
        bench.motors().configure()


def test_port_is_shared_and_closed_by_the_last_of_its_devices() -> None:
    bench = Bench()
    devices: list[LifeCycle] = [started(bench.motors()), *bench.sensors()]
    devices[1].close()
    devices[0].write(DriveCommand("speed", [2.0, 2.0]))  # type: ignore[attr-defined]
    assert bench.do("motor_LF")[0] == "speed"
    for device in devices:
        device.close()
    with pytest.raises(DeviceError, match="motor_LF was closed"):
        bench.lines[0].update()


def test_wire_that_is_gone_is_reported_and_the_others_are_driven() -> None:
    bench = Bench()
    motors, (left, right) = started(bench.motors(on_lost_wheel="continue")), bench.sensors()
    bench.plant.unplug("motor_LF")
    motors.write(DriveCommand("speed", [2.0, 2.0]))
    assert "is gone: it was unplugged" in stale(left.read())
    assert isinstance(right.read(), MotorReading)
    assert (bench.do("motor_LF")[0], bench.do("motor_RF")[0]) == ("brake", "speed")
    assert motors.health() == Health("active", "", {"unsent": 1})


def test_lost_wheel_is_driven_again_only_after_a_command_for_neutral() -> None:
    bench = Bench()
    motors, command = started(bench.motors(on_lost_wheel="continue")), DriveCommand("speed", [2.0, 2.0])
    bench.plant.unplug("motor_LF")
    motors.write(command)
    bench.plant.plug_in("motor_LF", "motor_LF")
    motors.write(command)
    assert (bench.do("motor_LF")[0], bench.do("motor_RF")[0]) == ("brake", "speed")
    motors.write(DriveCommand())
    motors.write(command)
    assert (bench.do("motor_LF")[0], bench.do("motor_RF")[0]) == ("speed", "speed")


def test_wire_that_is_gone_stops_all_until_they_are_configured_and_activated() -> None:
    bench = Bench()
    motors, command = started(bench.motors()), DriveCommand("speed", [2.0, 2.0])
    motors.write(command)
    bench.plant.unplug("motor_LF")
    assert motors.write(command) == DriveCommand("speed")
    assert motors.health() == Health("error", "/dev/ttyACM0 is gone: it was unplugged.", {"unsent": 2})
    assert bench.do("motor_RF") == ("current", 0.0)
    bench.advance(RELEASE_S)
    motors.neutral()
    assert bench.do("motor_RF") == ("brake", NEUTRAL_BRAKE_A)
    with pytest.raises(DeviceError, match="no serial port /dev/ttyACM0"):
        motors.configure()
    bench.plant.plug_in("motor_LF", "motor_LF")
    motors.configure()
    motors.write(command)
    assert [bench.do(name)[0] for name in NAMES] == ["brake"] * 2
    motors.activate()
    motors.write(command)
    assert [bench.do(name)[0] for name in NAMES] == ["speed"] * 2


def test_controller_that_must_be_closed_stops_all_with_the_reason() -> None:
    bench = Bench()
    lost: dict[str, str] = {}
    motors, sensors = started(bench.motors(poll=lambda: lost)), bench.sensors()
    motors.write(DriveCommand("speed", [2.0, 2.0]))
    lost["motor_RF"] = "Two are named so."
    motors.write(DriveCommand("speed", [2.0, 2.0]))
    assert (motors.health().reason, stale(sensors[1].read())) == ("Two are named so.", "Two are named so.")
    assert bench.do("motor_LF") == ("current", 0.0)
    bench.advance(RELEASE_S)
    motors.neutral()
    assert bench.do("motor_LF") == ("brake", NEUTRAL_BRAKE_A)


def test_motors_are_not_armed_before_the_timeouts_of_their_controllers_are_measured() -> None:
    bench = Bench()
    chips: dict[str, float] = {}
    motors = bench.motors(timeouts_s=chips)
    motors.configure()
    for line in motors._lines:
        with pytest.raises(DeviceError, match=rf"{line.title} \(chip {line.chip}\) was never(.|\n)*unproven=yes"):
            motors.activate()
        assert motors.write(DriveCommand("speed", [2.0, 2.0])).values == []
        assert bench.do("motor_LF")[0] == "brake"
        chips[line.chip] = 0.25
        motors.configure()
    motors.activate()
    assert motors.health().state == "active"


def test_command_that_is_valid_no_longer_is_neutral() -> None:
    bench = Bench()
    motors = started(bench.motors())
    bench.advance(1.0)
    assert motors.write(DriveCommand("speed", [2.0, 2.0], until_s=1.0)).values == []
    assert bench.do("motor_LF") == ("brake", NEUTRAL_BRAKE_A)
