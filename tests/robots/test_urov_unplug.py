"""From a game controller that SDL takes for a real one, over link and vehicle, to the pulses: and unplugged."""

from collections.abc import Iterator
from typing import Any

import pytest

pytest.importorskip("pygame", reason="the extra 'pad' is not installed")

from snr_sim import SimRunner, TaskType
from snr_sim.core.clocks import SimClock
from snr_sim.devices.pwm.pwm_backend import LoopbackPwm
from snr_sim.devices.pygame_gamepad import PygameGamepad
from snr_sim.plants.stepping import Stepper
from snr_sim.prelude.device import Stale
from snr_sim.prelude.errors import UnknownNameError
from snr_sim.prelude.scenario import RobotContext
from snr_sim.prelude.signals import GamepadReading
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.teleop.manual_input import DeadmanSwitch
from snr_sim.testing.contracts import check_sensor
from snr_sim.testing.function_components import FunctionEndpointFactory, FunctionLoopFactory
from snr_sim.testing.virtual_gamepad import VirtualGamepad

ARM, AHEAD, TRIGGER = 7, 4, 5  # a button and two axes, as of an Xbox controller under Linux
ARMED_S, PUSHED_S, UNPLUGGED_S, END_S = 1.5, 1.6, 2.5, 3.2
CONTROL_S = 0.04  # a reading of the inertial unit, and a tick of the outputs


@pytest.fixture
def virtual() -> Iterator[VirtualGamepad]:
    pad = VirtualGamepad()
    yield pad
    pad.unplug()


class SeenPwm(LoopbackPwm):
    """Outputs that keep what they make, and when."""

    def __init__(self, context: RobotContext, made: list[tuple[float, list[float]]]) -> None:
        super().__init__(context.now_s, 8)
        self.made = made

    def put(self, pulses_us: list[float], stamp_s: float, lease_s: float, reasons: list[str]) -> list[float]:
        self.made.append((self.now_s(), pulses_us))
        return pulses_us


class Dive:
    """Controls that the vehicle received and pulses that it made, while the pad was changed now and then.

    Args:
        steps: what to do and when, by the surface's clock.
        options: of the robot.
    """

    def __init__(self, steps: list[tuple[float, Any]], **options: str) -> None:
        self.controls: list[tuple[float, dict[str, Any]]] = []
        self.pulses: list[tuple[float, list[float]]] = []
        simulation = prepare(Request("urov_teleop", io="loopback", options={"pilot": "manual", **options}))
        simulation.robot_file.DEVICES["loopback"]["pwm"] = lambda context: SeenPwm(context, self.pulses)
        plant = simulation.plant()
        config = simulation.config(plant)
        parameters = simulation.scenario.parameters(0)
        self.latest_s = 1.0 / parameters.command_hz + parameters.tether.latency_s + parameters.tether.jitter_s
        left = list(steps)

        def play(loop: Any) -> None:
            while left and loop.get_time_s() >= left[0][0] - 1e-9:
                left.pop(0)[1]()

        parts: list[Any] = []

        def on_controls(task: Any, task_id: Any) -> None:
            self.controls.append((parts[0].get_time_s(), parts[0].get_data("controls")))

        listener = FunctionEndpointFactory({(TaskType.store_page, "controls"): on_controls}, begin=parts.append)
        # Before the pad's loop, so that what is done at a moment is seen in that moment's reading.
        config.factories["topside"].insert(0, FunctionLoopFactory(play, "player"))
        config.factories["urov"].append(listener)
        clock = SimClock()
        clock.follow(Stepper(plant).advance_to)
        SimRunner(config, clock=clock, until_s=END_S).run()

    def pulses_at(self, time_s: float) -> list[float]:
        return [pulses for at_s, pulses in self.pulses if at_s <= time_s][-1]


def is_still(pulses_us: list[float]) -> bool:
    return all(pulse == 1500.0 for pulse in pulses_us)


def test_gamepad_unplugged_at_full_thrust_gives_neutral_in_one_command(
    virtual: VirtualGamepad,
) -> None:
    dive = Dive(
        [
            (ARMED_S, lambda: virtual.press(ARM)),
            (PUSHED_S, lambda: virtual.move(AHEAD, -1.0)),
            (UNPLUGGED_S, virtual.unplug),
        ]
    )
    before = dive.pulses_at(UNPLUGGED_S)
    assert max(before) > 1700.0
    assert min(before) < 1300.0
    neutral_command_s = next(at_s for at_s, one in dive.controls if at_s > UNPLUGGED_S and one["surge"] == 0.0)
    assert neutral_command_s <= UNPLUGGED_S + dive.latest_s
    assert neutral_command_s >= UNPLUGGED_S + 0.001, "and not before it was pulled"
    neutral_s = next(at_s for at_s, pulses in dive.pulses if at_s > UNPLUGGED_S and is_still(pulses))
    assert neutral_s <= UNPLUGGED_S + dive.latest_s + CONTROL_S
    assert all(is_still(pulses) for at_s, pulses in dive.pulses if at_s > neutral_s), "and so it stays"


def test_deadman_trigger_released_ignores_sticks(virtual: VirtualGamepad) -> None:
    dive = Dive(
        [
            (ARMED_S, lambda: virtual.press(ARM)),
            (PUSHED_S, lambda: virtual.move(AHEAD, -1.0)),
            (2.0, lambda: virtual.move(TRIGGER, 1.0)),
            (UNPLUGGED_S, lambda: virtual.move(TRIGGER, -1.0)),
        ],
        deadman="yes",
    )
    assert is_still(dive.pulses_at(2.0)), "armed, full ahead, and the trigger is released"
    assert max(dive.pulses_at(UNPLUGGED_S)) > 1700.0
    assert is_still(dive.pulses_at(UNPLUGGED_S + dive.latest_s + CONTROL_S))
    assert dive.controls[-1][1]["is_armed"], "and it is still armed: the trigger is for sticks"


def test_deadman_option_accepts_only_yes_or_no(virtual: VirtualGamepad) -> None:
    with pytest.raises(UnknownNameError, match="deadman must be yes or no, not maybe"):
        Dive([], deadman="maybe")


def test_gamepad_with_deadman_meets_sensor_contract_and_keeps_buttons(virtual: VirtualGamepad) -> None:
    check_sensor(lambda: DeadmanSwitch(PygameGamepad()))
    virtual.press(ARM)
    reading = DeadmanSwitch(PygameGamepad()).read()
    assert isinstance(reading, GamepadReading)
    assert reading.buttons[ARM]
    virtual.unplug()
    assert isinstance(DeadmanSwitch(PygameGamepad()).read(), Stale)
