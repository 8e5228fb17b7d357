"""Every plant, sensor and actuator of every scenario and robot implements its interface: each can replace another."""

from collections.abc import Iterator
from dataclasses import replace
from types import ModuleType
from typing import Any

import pytest

from snr_sim.core.config import AnyFactory
from snr_sim.devices.commands import ActuatorLoopFactory
from snr_sim.devices.pwm.pwm_loop import PwmLoopFactory
from snr_sim.devices.readings import SensorLoopFactory
from snr_sim.prelude.device import PwmOut
from snr_sim.prelude.ground_signals import ArmCommand, DriveCommand
from snr_sim.prelude.scenario import RobotContext, RobotInfo
from snr_sim.prelude.signals import DozerCommand, EngineCommand, MotorCommand, PwmCommand
from snr_sim.scenario import library
from snr_sim.testing.contracts import check_actuator, check_plant, check_sensor
from snr_sim.testing.pwm_contract import check_pwm_out

# A valid command for each input that any plant has, so that plants are checked in motion and not only at rest.
COMMANDS = {
    "arm": ArmCommand([0.1, 0.5, -1.0, 0.5, 0.0, 0.0]),
    "arm_goals": ArmCommand([0.1, 0.5, -1.0, 0.5, 0.0, 0.0]),
    "dozer": DozerCommand(left_mps=0.1, right_mps=0.08, blade=1.0),
    "engine": EngineCommand(throttle=0.3, gimbal_rad=0.01, attitude=0.2),
    "motors": MotorCommand(a=40.0, d=25.0),
    "pwm": PwmCommand([1500.0] * 8),
    "drive": DriveCommand("speed", [2.0] * 6),
    **{f"motor_{wheel}": DriveCommand("current", [1.0]) for wheel in ("LF", "LM", "LB", "RF", "RM", "RB")},
}


def load(found: library.FoundItem) -> tuple[ModuleType, ModuleType]:
    """The scenario and its robot."""
    robot = library.load_robot(library.find("robots", library.robot_of_scenario(found)))
    return library.load_scenario(found), robot


class PlantBench:
    """The outputs of a simulated vehicle: the plant's thrusters show what comes to them."""

    can_unplug = False

    def __init__(self, io: str) -> None:
        found = library.find("scenarios", "urov_depth_hold")
        self.scenario, self.robot = load(found)
        self.vehicle = self.scenario.plant(1, "mujoco")
        about = RobotInfo(self.scenario.ROBOT, "urov", found.name, "mujoco", self.scenario.parameters(1), {})
        self.plant = self.robot.wrap_plant(RobotContext(about, io, 1, self.vehicle))
        self.context = RobotContext(about, io, 1, self.plant)
        self.io = io

    def open(self) -> PwmOut:
        out: PwmOut = self.robot.DEVICES[self.io]["pwm"](self.context)
        return out

    def now_s(self) -> float:
        return self.plant.time_s

    def advance(self, seconds: float) -> None:
        for _ in range(round(seconds / self.plant.step_s)):
            self.plant.step(self.plant.step_s)

    def pins_us(self) -> list[float] | None:
        return None if self.io == "loopback" else [float(one) for one in self.vehicle.snapshot().pulses]

    def unplug(self) -> None:
        raise NotImplementedError("no wire")

    plug_in = unplug


every_scenario = pytest.mark.parametrize(
    ("found", "engine"),
    [
        pytest.param(found, engine, id=f"{found.name}-{engine}")
        for found in library.list_available("scenarios")
        for engine in load(found)[0].ENGINES
    ],
)


def devices(found: library.FoundItem, engine: str) -> Iterator[AnyFactory]:
    """The loops around every device of the robot, as it is simulated."""
    scenario, robot = load(found)
    about = RobotInfo(scenario.ROBOT, robot.ROLES[0], found.name, engine, scenario.parameters(1), {})
    context = RobotContext(about, "sim", 1, scenario.plant(1, engine))
    if hasattr(robot, "wrap_plant"):
        context = replace(context, plant=robot.wrap_plant(context))
    for factories in robot.roles(context, []).values():
        yield from factories


@pytest.mark.parametrize("found", library.list_available("robots"), ids=lambda found: found.name)
def test_robot_states_its_options_so_that_a_misspelt_one_is_refused(found: library.FoundItem) -> None:
    assert isinstance(library.load_robot(found).OPTIONS, dict)


def every_plant() -> list[Any]:
    """Return every plant; that of a robot and engine which an earlier scenario has, in the slow lane."""
    params, seen = [], set()
    for found in library.list_available("scenarios"):
        scenario, _ = load(found)
        for engine in scenario.ENGINES:
            marks = [pytest.mark.slow] if (scenario.ROBOT, engine) in seen else []
            params.append(pytest.param(found, engine, id=f"{found.name}-{engine}", marks=marks))
            seen.add((scenario.ROBOT, engine))
    return params


@pytest.mark.parametrize(("found", "engine"), every_plant())
def test_plants_pass_contract(found: library.FoundItem, engine: str) -> None:
    scenario, _ = load(found)
    names = scenario.plant(1, engine).inputs
    assert set(names) <= set(COMMANDS), "an input without a command here: add one"
    check_plant(lambda: scenario.plant(1, engine), {name: COMMANDS[name] for name in names})


@every_scenario
def test_sensors_pass_contract(found: library.FoundItem, engine: str) -> None:
    sensors = [factory for factory in devices(found, engine) if isinstance(factory, SensorLoopFactory)]
    assert sensors
    for sensor in sensors:
        check_sensor(sensor.open_device)


@every_scenario
def test_actuators_pass_contract(found: library.FoundItem, engine: str) -> None:
    actuators = [factory for factory in devices(found, engine) if isinstance(factory, ActuatorLoopFactory)]
    assert actuators
    for actuator in actuators:
        if not isinstance(actuator, PwmLoopFactory):
            check_actuator(actuator.open_device, COMMANDS[actuator.key])


@pytest.mark.parametrize("io", ["sim", "loopback"])
def test_pwm_outputs_pass_contract(io: str) -> None:
    check_pwm_out(PlantBench(io))


def test_emulated_outputs_and_power_monitor_pass_contract(emulators: None) -> None:
    bench = PlantBench("emulated")
    check_pwm_out(bench)
    check_sensor(lambda: bench.robot.DEVICES["emulated"]["power"](bench.context))
    bench.plant.board.close()


def test_motors_and_readings_over_emulated_controllers_pass_contract() -> None:
    found = library.find("scenarios", "rover_hill")
    scenario, robot = load(found)
    about = RobotInfo(scenario.ROBOT, "rover", found.name, "pymunk", scenario.parameters(1), {})
    plant = robot.wrap_plant(RobotContext(about, "emulated", 1, scenario.plant(1, "pymunk")))
    devices = robot.DEVICES["emulated"]
    check_sensor(lambda: devices["motor"](RobotContext(about, "emulated", 1, plant), "motor_LB"))
    check_actuator(lambda: devices["drive"](RobotContext(about, "emulated", 1, plant)), COMMANDS["drive"])
