"""Motors behind emulated controllers on a virtual CAN bus, in simulated time: contract, silence, faults, ports file."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from itertools import count, pairwise
from pathlib import Path
from typing import Any

import can
import msgspec
import pytest

from snr_sim.cli.io_motors import lines_of
from snr_sim.devices.emulated.emulated_can import EmulatedCanNode
from snr_sim.devices.emulated.emulated_vesc import EmulatedVesc, ScriptedFault
from snr_sim.devices.motors.bench_check import measure_timeout
from snr_sim.devices.motors.can_line import SILENT_S, STATUS_S, CanLine
from snr_sim.devices.motors.motor_backend import MotorBackend
from snr_sim.devices.motors.motor_guard import ControllerSettings, can_lines, open_links
from snr_sim.devices.motors.ports_file import read_ports
from snr_sim.devices.motors.vesc_motors import VescMotors, VescSensor
from snr_sim.devices.wire.can_bus import CanBus
from snr_sim.devices.wire.can_messages import CanFrame
from snr_sim.prelude.device import LEASE_S
from snr_sim.prelude.errors import DeviceError, ParameterError
from snr_sim.prelude.ground_signals import NEUTRAL_BRAKE_A, DriveCommand, MotorReading
from snr_sim.prelude.life_cycle import LifeCycle
from snr_sim.scenario.device_bench import devices_of
from snr_sim.testing.contracts import check_actuator, check_sensor
from snr_sim.testing.motor_contract import check_motors
from tests.devices.benches import Bench, stale
from tests.devices.test_bench_check import TurningMotor
from tests.lanes import slow

NAMES = ["motor_LF", "motor_RF"]
NUMBERS = {"7": "motor_LF", "254": "motor_RF"}
LIMITS = {"speed": 18.0, "current": 6.0, "brake": 6.0, "duty": 1.0}
SETTINGS = ControllerSettings(NAMES, 228.0, LIMITS, NEUTRAL_BRAKE_A, "stock", NUMBERS)
FAST = DriveCommand("speed", [2.0, 3.0])
TICK_S = 0.01
Make = Callable[..., "CanBench"]
BENCHES = count()


class StillMotor:
    """Notes what it does, and has one state."""

    def __init__(self, speed_radps: float) -> None:
        self.does: list[tuple[str, float]] = []
        self.reading = MotorReading(speed_radps, 1.5, 0.5, 0.25, 24.0, 7.0, 0.0)

    def drive(self, mode: str, value: float) -> None:
        self.does.append((mode, value))

    def read(self) -> MotorReading:
        return self.reading


class CanBench(Bench):
    """Controllers at the far end of a virtual bus; a line that waits lets the bench's time pass."""

    def __init__(self, patch: pytest.MonkeyPatch, stops_all: bool = True, **faults: ScriptedFault) -> None:
        self.stops_all = stops_all
        self.text = f"can:virtual:bench{next(BENCHES)}"
        self.far = CanBus(self.text)
        self.motors = [StillMotor(float(i)) for i in range(len(NAMES))]
        self.nodes = [
            EmulatedCanNode(
                EmulatedVesc(motor, name, 228.0, faults=[faults[name]] if name in faults else ()), int(number), 228.0
            )
            for motor, (number, name) in zip(self.motors, NUMBERS.items(), strict=True)
        ]
        self.is_in = [True] * len(NAMES)
        self.sensors: list[VescSensor] = []
        self.opened: list[LifeCycle] = []
        self.sent = b""
        patch.setattr(CanBus, "wait", lambda _bus, seconds: self.pass_time(seconds))

    def lines(self) -> list[CanLine]:
        return can_lines(SETTINGS, self.text, self.now_s)

    def open(self) -> MotorBackend:
        lines = self.lines()
        for sensor in self.sensors:
            sensor.close()
        self.sensors = [VescSensor(line) for line in lines]
        for sensor in self.sensors:
            sensor.configure()
            sensor.activate()
        motors = VescMotors(lines, LIMITS, NEUTRAL_BRAKE_A, "neutral" if self.stops_all else "continue")
        self.opened += [motors, *self.sensors]
        return motors

    def pump(self) -> None:
        frames: list[CanFrame] = []
        with suppress(DeviceError):  # the adapter of another is off
            frames = self.far.receive()
        for node, is_in in zip(self.nodes, self.is_in, strict=True):
            sent = node.feed(frames, self.time_s) if is_in else []
            if not is_in:
                node.tick(self.time_s)
            for frame in sent:
                self.far.send(frame)
                self.sent += frame.id.to_bytes(4, "big") + frame.data

    def pass_time(self, seconds: float) -> None:
        for _ in range(round(seconds / TICK_S)):
            self.time_s += TICK_S
            self.pump()

    def advance(self, seconds: float) -> None:
        for i in range(round(seconds / TICK_S)):
            self.pass_time(TICK_S)
            for sensor in self.sensors if i % 5 == 4 else ():
                sensor.read()

    def does(self) -> Sequence[tuple[str, float]]:
        self.pump()
        return [motor.does[-1] for motor in self.motors]

    def unplug(self, index: int) -> None:
        self.is_in[index] = False

    def plug_in(self, index: int) -> None:
        self.is_in[index] = True

    def started(self) -> MotorBackend:
        motors = self.open()
        motors.configure()
        motors.activate()
        return motors


@pytest.fixture
def make(monkeypatch: pytest.MonkeyPatch) -> Iterator[Make]:
    """Make benches, and close their far ends."""
    made = []

    def one(**options: Any) -> CanBench:
        made.append(CanBench(monkeypatch, **options))
        return made[-1]

    yield one
    for bench in made:
        for device in bench.opened:
            device.close()
        bench.far.close()


@pytest.mark.parametrize("stops_all", [True, slow(False)], ids=["stops all", "others continue"])
def test_motors_on_a_can_bus_pass_contract(make: Make, stops_all: bool) -> None:
    check_motors(make(stops_all=stops_all))


def test_motors_and_sensors_on_a_can_bus_pass_the_contracts_of_devices(make: Make) -> None:
    check_actuator(lambda: make().open(), FAST)
    check_sensor(lambda: VescSensor(make().lines()[0]))


def test_readings_and_frames_are_the_same_each_time_to_the_steps_of_their_bytes(make: Make) -> None:
    def drive() -> tuple[list[Any], bytes]:
        bench = make()
        motors, found = bench.started(), []
        for i in range(30):
            motors.write(DriveCommand("duty", [0.01 * i, -0.01 * i]))
            bench.advance(0.05)
            readings = [sensor.read() for sensor in bench.sensors]
            assert bench.time_s - readings[0].stamp_s == pytest.approx(0.05), "since the look before: not older"
            found.append((readings, bench.does()))
        return found, bench.sent

    found, sent = drive()
    assert (found, sent) == drive()
    readings, does = found[-1]
    assert does == [("duty", 0.29), ("duty", -0.29)]
    for i, reading in enumerate(readings):
        assert isinstance(reading, MotorReading)
        assert (reading.current_a, reading.battery_a, reading.duty, reading.voltage_v) == (1.5, 0.5, 0.25, 24.0)
        assert reading.speed_radps == pytest.approx(i, abs=5e-4)
        assert reading.turned_rad == pytest.approx(7.0, abs=5e-3)
    stamps_s = [left.stamp_s for (left, _), _ in found]
    assert [after - before for before, after in pairwise(stamps_s)] == pytest.approx([0.05] * 29)


def test_controller_that_loses_its_frames_brakes_and_is_lost_without_the_others(make: Make) -> None:
    bench = make(stops_all=False)
    motors = bench.started()
    motors.write(FAST)
    assert [mode for mode, _ in bench.does()] == ["speed", "speed"]
    bench.unplug(0)
    for _ in range(round((SILENT_S + 2 * STATUS_S) / TICK_S)):
        bench.advance(TICK_S)
        motors.write(FAST)
    assert motors.health().counts["unsent"] == round(2 * STATUS_S / TICK_S)
    assert [mode for mode, _ in bench.does()] == ["speed", "speed"], "its own timeout is longer"
    for _ in range(round(LEASE_S / TICK_S)):
        bench.advance(TICK_S)
        motors.write(FAST)
    assert [mode for mode, _ in bench.does()] == ["brake", "speed"]
    assert "The controller of motor_LF has sent no status for 0.1 s." in stale(bench.sensors[0].read())
    assert isinstance(bench.sensors[1].read(), MotorReading)


@pytest.mark.parametrize("kind", ["mute", "brown_out", "motor"])
def test_controller_with_a_fault_stops_all_or_lets_its_motor_turn_freely(make: Make, kind: Any) -> None:
    bench = make(motor_RF=ScriptedFault(kind, 0.3, 9.0, text="drv"))
    motors = bench.started()
    for _ in range(100):
        motors.write(FAST)
        bench.advance(TICK_S)
    left, right = (mode for mode, _ in bench.does())
    found = motors.health().state, left, right
    assert (
        found
        == {
            "mute": ("error", "brake", "brake"),
            "brown_out": ("error", "brake", "off"),
            "motor": ("active", "speed", "off"),  # its status does not say so
        }[kind]
    )


def test_bus_that_is_off_is_lost_for_all_and_opened_again(make: Make) -> None:
    bench = make()
    motors = bench.started()
    motors.write(FAST)
    with can.Bus(interface="virtual", channel=bench.text.rpartition(":")[2], ignore_config=True) as adapter:
        adapter.send(can.Message(arbitration_id=0x40, is_error_frame=True))
    assert motors.write(FAST).values == []
    reason = motors.health().reason
    assert f"{bench.text} is off: its adapter has counted too many errors" in reason
    assert [stale(sensor.read()) for sensor in bench.sensors] == [reason] * 2
    bench.advance(0.3)
    assert {mode for mode, _ in bench.does()} == {"brake"}
    motors.configure()
    motors.activate()
    assert motors.write(FAST) == FAST
    assert {mode for mode, _ in bench.does()} == {"speed"}


def test_controller_that_is_not_there_is_refused_by_name_and_number(make: Make) -> None:
    bench = make()
    bench.unplug(1)
    motors = VescMotors(bench.lines(), LIMITS, NEUTRAL_BRAKE_A)
    bench.opened.append(motors)
    with pytest.raises(DeviceError, match=r"motor_RF, number 254 on the CAN bus, sends no status\.\n.*1, 4 and 5"):
        motors.configure()
    assert bench.time_s == pytest.approx(0.5, abs=0.1)


def test_timeout_of_a_controller_on_a_can_bus_is_measured(make: Make) -> None:
    bench = make()
    line, motor = bench.lines()[0], TurningMotor()
    bench.nodes[0]._controller._motor = motor
    line.open(line)

    def sleep(seconds: float) -> None:
        motor.step(seconds)
        bench.pass_time(seconds)

    assert measure_timeout(line, sleep) == pytest.approx(0.28, abs=0.03)
    line.release(line)


def test_ports_file_of_a_can_bus_reaches_the_rovers_guard(tmp_path: Path) -> None:
    file, names = tmp_path / "ports.toml", [f"motor_{side}{place}" for side in "LR" for place in "FMB"]
    rows = "".join(f'"{number}" = "{name}"\n' for number, name in zip(range(20, 26), names, strict=True))
    file.write_text(f'links = "can:virtual:rover"\n[vesc]\n{rows}[timeout_s]\n"20" = 0.25\n')
    simulation = devices_of("rover_teleop", f"ports:{file}")
    guard = simulation.robot_file.motor_guard(simulation.context(None))
    assert guard._opener == "snr_sim.devices.motors.motor_guard:open_links"
    opened = open_links(*guard._args)
    assert [(line.name, line.chip) for line in opened.lines] == list(
        zip(names, ["20", "21", "22", "23", "24", "25"], strict=True)
    )
    assert all(type(line) is CanLine for line in opened.lines)
    settings = simulation.robot_file.controller_settings(simulation.context(None))
    assert [line.chip for line in lines_of(read_ports(file), settings)] == [line.chip for line in opened.lines]
    assert opened.motors._timeouts_s == {"20": 0.25}  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("numbers", "found"),
    [
        ({"7": "motor_LF"}, "nothing for motor_RF on can:virtual:x"),
        ({**NUMBERS, "9": "motor_RF"}, "254, 9 for motor_RF"),
        ({"3a00": "motor_LF"}, "3a00 for motor_LF"),
        ({"7": "motor_LF", "999": "motor_RF"}, "the number 999"),
    ],
)
def test_ports_file_without_one_number_for_each_motor_is_refused(numbers: dict[str, str], found: str) -> None:
    settings = msgspec.structs.replace(SETTINGS, chips=numbers)
    with pytest.raises(ParameterError, match=found):
        open_links("can:virtual:x", msgspec.to_builtins(settings))
