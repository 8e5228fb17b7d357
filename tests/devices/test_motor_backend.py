"""Motors of every kind keep one contract: those of a plant, behind controllers at known ports, and found by name."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from snr_sim.devices.emulated.vesc_plant import TICK_S, VescPlant
from snr_sim.devices.motors.motor_backend import MotorBackend, SimMotors
from snr_sim.devices.motors.motor_ports import MotorPorts
from snr_sim.devices.motors.port_watch import PortWatch
from snr_sim.devices.motors.vesc_line import VescLine
from snr_sim.devices.motors.vesc_motors import VescMotors, VescSensor
from snr_sim.devices.wire.vesc_messages import Dialect
from snr_sim.plants import Rover, Rover2D, RoverStart, read_rover
from snr_sim.plants.ground.height_map import flat
from snr_sim.prelude.device import LEASE_S, Stale
from snr_sim.prelude.errors import DeviceError
from snr_sim.prelude.ground_signals import NEUTRAL_BRAKE_A, DriveCommand, MotorReading
from snr_sim.testing.fakes import FakePlant
from snr_sim.testing.motor_contract import check_motors
from tests.lanes import slow

VEHICLE = read_rover(Path(__file__).parents[2] / "robots" / "rover" / "vehicles" / "competition.toml")
NAMES = [f"motor_{wheel.name}" for wheel in VEHICLE.motor_wheels]
LIMITS = {"speed": 18.0, "current": 6.0, "brake": 6.0, "duty": 1.0}


class SimBench:
    """The motors of a rover in the plane."""

    can_unplug, stops_all = False, True

    def __init__(self) -> None:
        self.plant: Any = Rover2D(VEHICLE, flat(), lambda seed: RoverStart())

    def open(self) -> MotorBackend:
        return SimMotors(self.plant, self.now_s, len(NAMES), LIMITS)

    def now_s(self) -> float:
        time_s: float = self.plant.time_s
        return time_s

    def advance(self, seconds: float) -> None:
        for _ in range(round(seconds / self.plant.step_s)):
            self.plant.step(self.plant.step_s)

    def does(self) -> Sequence[tuple[str, float]]:
        commands: Sequence[tuple[str, float]] = self.plant.motors.snapshot()[0]
        return commands

    def unplug(self, index: int) -> None:
        self.plant.unplug(NAMES[index])

    def plug_in(self, index: int) -> None:
        self.plant.plug_in(NAMES[index], NAMES[index])


class VescBench(SimBench):
    """Emulated controllers at known device files, of motors that do not move: each reads its index as speed."""

    can_unplug = True
    dialect: Dialect = "stock"
    poll: Any = staticmethod(dict)

    def __init__(self, stops_all: bool = True) -> None:
        readings = {name: MotorReading(i, 1.5, 0.5, 0.25, 24.0, 7.0, 0.0) for i, name in enumerate(NAMES)}
        self.fake = FakePlant(readings, tuple(NAMES))
        self.plant = VescPlant(self.fake, NAMES, 228.0, dialect=self.dialect)
        self.stops_all = stops_all
        self.sensors: list[VescSensor] = []

    def open_port(self, name: str) -> Any:
        return self.plant.open_port(f"/dev/ttyACM{NAMES.index(name)}")

    def open(self) -> MotorBackend:
        lines = [VescLine(name, partial(self.open_port, name), self.now_s, 228.0, self.dialect) for name in NAMES]
        for sensor in self.sensors:
            sensor.close()
        self.sensors = [VescSensor(line) for line in lines]
        for sensor in self.sensors:
            sensor.configure()
            sensor.activate()
        return VescMotors(lines, LIMITS, NEUTRAL_BRAKE_A, "neutral" if self.stops_all else "continue", self.poll)

    def advance(self, seconds: float) -> None:
        for i in range(round(seconds / TICK_S)):
            self.plant.step(TICK_S)
            for sensor in self.sensors if i % 5 == 4 else ():
                sensor.read()

    def does(self) -> Sequence[tuple[str, float]]:
        newest = dict(self.fake.written)
        return [(newest[name].mode, newest[name].values[0]) for name in NAMES]


class PortsBench(VescBench):
    """The same, behind controllers that are found by their names."""

    dialect: Dialect = "seed"

    def __init__(self, stops_all: bool = True) -> None:
        super().__init__(stops_all)
        self.ports = MotorPorts(PortWatch(self.plant.list_ports), self.plant.open_port, self.now_s)
        self.open_port = self.ports.open_port  # type: ignore[method-assign]
        self.poll = self.ports.poll


@pytest.mark.parametrize("stops_all", [True, False], ids=["stops all", "others continue"])
@pytest.mark.parametrize("bench", [VescBench, PortsBench])
def test_motors_behind_controllers_pass_contract(bench: type[VescBench], stops_all: bool) -> None:
    check_motors(bench(stops_all))


def test_simulated_motors_pass_contract() -> None:
    check_motors(SimBench())


def test_controllers_that_return_swapped_drive_and_read_their_own_wheels() -> None:
    bench = PortsBench()
    motors = bench.open()
    motors.configure()
    motors.activate()
    command = DriveCommand("speed", [2.0, 3.0, 4.0, 5.0, 6.0, 7.0])
    motors.write(command)
    for index in (1, 4):
        bench.unplug(index)
    bench.advance(0.6)
    motors.write(command)
    assert motors.health().reason == "The controller of motor_LM was unplugged from usb-1-1.2."
    reasons = [reading.reason for sensor in bench.sensors if isinstance(reading := sensor.read(), Stale)]
    assert reasons == [
        f"The controller of motor_{name} was unplugged from usb-1-1.{socket}."
        for name, socket in (("LM", 2), ("RM", 5))
    ]
    bench.plant.plug_in(NAMES[4], NAMES[1])
    bench.plant.plug_in(NAMES[1], NAMES[4])
    bench.advance(0.6)
    motors.configure()
    assert {mode for mode, _ in bench.does()} == {"brake"}
    motors.activate()
    motors.write(command)
    bench.advance(0.1)
    readings = [sensor.read() for sensor in bench.sensors]
    assert [getattr(reading, "speed_radps", reading) for reading in readings] == pytest.approx(range(6), abs=5e-4)
    assert [value for _, value in bench.does()] == pytest.approx(command.values, abs=1e-3)


def test_two_controllers_of_one_name_are_stated_and_all_brake_until_one_has_another() -> None:
    bench = PortsBench()
    motors, command = bench.open(), DriveCommand("speed", [2.0] * 6)
    motors.configure()
    motors.activate()
    bench.unplug(0)
    bench.plant._controllers[NAMES[0]]._name = NAMES[3]
    bench.advance(0.6)
    motors.write(command)
    bench.plug_in(0)
    bench.advance(0.6)
    motors.write(command)
    both = "Controllers on usb-1-1.4 and usb-1-1.1 both say they are 'motor_RF'. Neither is driven."
    with pytest.raises(DeviceError, match=f"No controller says it is 'motor_LF'. {both}"):
        motors.configure()
    reasons = [reading.reason for sensor in bench.sensors if isinstance(reading := sensor.read(), Stale)]
    assert reasons == ["The controller of motor_LF was unplugged from usb-1-1.1.", both]
    assert {mode for mode, _ in bench.does()} == {"brake"}
    bench.unplug(0)
    bench.plant._controllers[NAMES[0]]._name = NAMES[0]
    bench.advance(0.6)
    motors.write(command)
    bench.plug_in(0)
    bench.advance(0.6)
    motors.configure()
    motors.activate()
    assert motors.write(command) == command
    assert {mode for mode, _ in bench.does()} == {"speed"}


@pytest.mark.parametrize("body", [Rover2D, slow(Rover)])
def test_wheels_of_a_plant_have_leases_of_their_own_also_after_restore(body: type[Rover2D] | type[Rover]) -> None:
    bench = SimBench()
    bench.plant = body(VEHICLE, flat(), lambda seed: RoverStart())
    bench.plant.write("drive", DriveCommand("current", [1.0] * 6, until_s=0.3))
    bench.plant.write("motor_LM", DriveCommand("current", [1.0], until_s=0.5))
    bench.plant.write("motor_RB", DriveCommand("current", [1.0]))
    snapshot = bench.plant.snapshot()
    for _ in range(2):
        found = []
        for _ in range(3):
            bench.advance(LEASE_S)
            found.append([i for i, (mode, _) in enumerate(bench.does()) if mode == "current"])
        assert found == [[0, 1, 2, 3, 4, 5], [1, 5], [5]]
        bench.plant.restore(snapshot)
