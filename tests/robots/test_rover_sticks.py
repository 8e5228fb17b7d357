"""The rover at a person's sticks: which commands count, what the wheels get, and what pad, keyboard and display do."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import pytest

from snr_sim import Config, Page, SimRunner, Task, TaskType
from snr_sim.devices.gamepad import GamepadLoopFactory
from snr_sim.prelude.errors import CommandError, ParameterError, UnknownNameError
from snr_sim.prelude.signals import GamepadReading
from snr_sim.scenario import library
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import SimulationRun
from snr_sim.teleop.gamepad_pilot import BUTTON_COUNT, BUTTONS
from snr_sim.testing.fakes import FakeSensor
from snr_sim.testing.function_components import FunctionEndpoint, FunctionEndpointFactory, FunctionLoopFactory

library.load_robot(library.find("robots", "rover"))
CONTROLLER = library.load_controller(library.find("robots", "rover"), "sticks")

from snr_sim_robot_rover.controls import DEADMAN_BUTTON, LAYOUTS, LEGENDS, controls_of, gamepad_pilot  # noqa: E402
from snr_sim_robot_rover.display import display  # noqa: E402
from snr_sim_robot_rover.evaluation import Sample  # noqa: E402
from snr_sim_robot_rover.parameters import RoverParameters  # noqa: E402

PARAMETERS = RoverParameters()
TOP = PARAMETERS.limit_mps / 0.13  # rad/s of a wheel at a full stick
BRAKED = {"mode": "brake", "values": []}
HELD = {"mode": "brake", "values": [PARAMETERS.neutral_a] * 6}  # brakes, too, but arms no motors
MOTOR = {"speed_radps": 3.0}


def driven(controls_at: Callable[[float], dict[str, Any] | None], until_s: float = 1.0) -> list[tuple[float, Any]]:
    """The commands of the wheels, with their times, of a rover that looks to the east and does not move.

    Args:
        controls_at: page "controls" of a time; None: none comes.
    """
    commands: list[tuple[float, Any]] = []
    parts: list[FunctionEndpoint] = []
    number = 0

    def bring(loop: Any) -> None:
        nonlocal number
        number += 1
        now_s = loop.get_time_s()
        controls = controls_at(now_s)
        if controls is not None:
            page = Page("controls", {"number": number, **controls}, "topside_node", now_s, True)
            loop.schedule(Task(TaskType.store_page, "controls", [page]))
        for wheel in PARAMETERS.vehicle.wheels:
            loop.store_data(f"motor_{wheel.name}", MOTOR, process=False)
        loop.store_data("imu", {"yaw_rad": 0.0, "stamp_s": now_s})

    keep = {
        (TaskType.process_data, "drive"): lambda task, task_id: commands.append((now(), parts[0].get_data("drive")))
    }

    def now() -> float:
        return parts[0].get_time_s()

    config = Config(
        factories={
            "rover": [
                FunctionLoopFactory(bring, "bringer", 20.0),
                CONTROLLER.SticksDriver.factory(parameters=PARAMETERS),
                FunctionEndpointFactory(keep, begin=parts.append),
            ]
        }
    )
    SimRunner(config, until_s=until_s, log_notes=False).run()
    return commands


def last(**controls: Any) -> Any:
    """The command of the wheels after a second of the same controls."""
    return driven(lambda now_s: {"is_armed": True, **controls})[-1][1]


def test_full_sticks_of_both_sides_turn_each_side_at_its_limit() -> None:
    command = last(left=1.0, right=-1.0)
    assert command["mode"] == "speed"
    assert command["values"] == pytest.approx([TOP] * 3 + [-TOP] * 3)


def test_sticks_are_shares_of_current_or_duty_in_those_modes() -> None:
    assert last(mode="current", ahead=1.0) == {"mode": "current", "values": [6.0] * 6}
    assert last(mode="duty", ahead=-1.0) == {"mode": "duty", "values": [-1.0] * 6}
    assert last(mode="duty", ahead=0.05) == {"mode": "duty", "values": [0.0] * 6}


def test_triggers_brake_their_side_and_both_the_rover() -> None:
    assert last(mode="current", ahead=1.0, brake_left=True) == {"mode": "current", "values": [-3.0] * 3 + [6.0] * 3}
    assert last(ahead=1.0, brake_right=True)["values"] == pytest.approx([TOP] * 3 + [0.0] * 3)
    assert last(ahead=1.0, brake_left=True, brake_right=True) == {"mode": "brake", "values": [6.0] * 6}


def test_rover_that_does_not_turn_is_asked_to_turn_more() -> None:
    first, *_, newest = (command["values"] for _, command in driven(lambda now_s: {"is_armed": True, "turn": 0.8})[1:])
    assert 0.0 < first[3] < newest[3]
    assert first[0] == pytest.approx(-first[3])


def test_sticks_at_rest_stand_without_keeping_a_heading() -> None:
    commands = driven(lambda now_s: {"is_armed": True, "turn": 0.8 if now_s < 0.5 else 0.0})
    assert commands[-1][1] == {"mode": "speed", "values": [0.0] * 6}


@pytest.mark.parametrize("controls", [{"is_armed": False, "ahead": 1.0}, {"is_armed": True, "is_stop": True}, None])
def test_wheels_stay_braked_without_armed_controls(controls: dict[str, Any] | None) -> None:
    assert {str(command) for _, command in driven(lambda now_s: controls)} == {str(BRAKED)}


def test_silence_of_a_fifth_of_a_second_brakes_until_controls_come_again() -> None:
    controls = {"is_armed": True, "ahead": 1.0}
    commands = driven(lambda now_s: None if 0.52 < now_s < 1.48 else controls, 2.0)
    braked_s = [now_s for now_s, command in commands if command == HELD]
    assert 0.7 < min(braked_s) < 0.76
    assert max(braked_s) < 1.5


def test_invalid_controls_are_reported_and_do_not_count() -> None:
    commands = driven(lambda now_s: {"is_armed": True, "ahead": 1.0 if now_s < 0.5 else math.nan})
    assert commands[5][1] not in (BRAKED, HELD)
    assert commands[-1][1] == HELD


@pytest.mark.parametrize("stick", ["ahead", "turn", "left", "right"])
def test_stick_out_of_range_is_refused(stick: str) -> None:
    with pytest.raises(CommandError, match=f"'{stick}' must be in -1 to 1"):
        controls_of({stick: 1.5})


# -- gamepad, keyboard, display ---------------------------------------------------------------------------------------


def piloted(layout: str, axes: Sequence[float], *down: str) -> Any:
    """The controls that a gamepad makes."""
    made: list[Any] = []
    parts: list[FunctionEndpoint] = []
    buttons = [number in [BUTTONS[name] for name in down] for number in range(BUTTON_COUNT)]
    rest = GamepadReading([0.0] * 6, [False] * BUTTON_COUNT, [])
    readings = FakeSensor([rest, GamepadReading(list(axes), buttons, [])])
    keep = {(TaskType.process_data, "controls"): lambda task, task_id: made.append(parts[0].get_data("controls"))}
    hand = GamepadLoopFactory("gamepad", lambda: readings, 20.0)
    config = Config(
        factories={"topside": [hand, gamepad_pilot(layout), FunctionEndpointFactory(keep, begin=parts.append)]}
    )
    SimRunner(config, until_s=0.08).run()
    return controls_of(made[-1])


def test_right_stick_drives_and_turns_in_arcade() -> None:
    controls = piloted("arcade", [0.7, 0.7, 0.0, -0.5, -0.9, 0.0], "arm")
    assert (controls.ahead, controls.turn, controls.left, controls.right) == (0.9, 0.5, 0.0, 0.0)
    assert (controls.is_armed, controls.mode) == (True, "speed")


def test_each_stick_drives_its_side_in_tank() -> None:
    controls = piloted("tank", [0.7, -1.00003, -1.0, 0.7, 0.25, -1.0], "mode_up")
    assert (controls.ahead, controls.turn, controls.left, controls.right) == (0.0, 0.0, 1.0, -0.25)
    assert controls.mode == "current"


def test_trigger_brakes_its_side_from_half_on() -> None:
    for pressed, brakes in ((-1.0, False), (0.0, False), (0.1, True), (1.0, True)):
        controls = piloted("arcade", [0.0, 0.0, pressed, 0.0, 0.0, 1.0])
        assert (controls.brake_left, controls.brake_right) == (brakes, True)


def test_deadman_button_is_the_left_shoulder() -> None:
    assert BUTTONS["mode_down"] == DEADMAN_BUTTON


@pytest.mark.parametrize("layout", LAYOUTS)
def test_legend_contains_every_key_of_the_sticks(layout: str) -> None:
    assert {key for stick in LAYOUTS[layout].values() for key in stick.keys} <= set(" ".join(LEGENDS[layout]).split())


VEHICLE = {"control_state": "pilot", "mode": "speed", "is_armed": True, "is_stopped": False, "rejected_command": ""}
PLACE = {"position_m": [3.04, -1.0], "yaw_rad": 1.5708, "speed_mps": 0.81, "way_m": 12.3}


def shown(has_gamepad: bool = False, **changes: Any) -> dict[str, str]:
    data = {"vehicle": {**VEHICLE, **changes}, "odometry": PLACE, "power": {"voltage_v": 23.1, "current_a": 4.4}}
    if has_gamepad:
        data["gamepad"] = {"is_connected": True}
    pages = {key: Page(key, value, "rover", 10.0, True) for key, value in data.items()}
    return {name: text for name, text, _ in display(has_gamepad).rows(pages, 0.1)}


def test_display_shows_state_place_and_battery() -> None:
    rows = shown()
    assert rows["state"] == "armed, speed, control: pilot"
    assert rows["place"] == "3.0 m east, -1.0 m north of the start, heading 90 deg"
    assert rows["speed"] == "0.8 m/s, 12 m so far"
    assert rows["battery"] == "23.1 V, 4 A"


def test_display_says_how_to_arm_and_why_a_command_was_rejected() -> None:
    assert shown(True, is_armed=False)["state"].startswith("disarmed: 1 (start) arms")
    assert shown(True, is_armed=False, is_stopped=True)["state"].startswith("EMERGENCY STOP: c (Y) clears it")
    assert shown(rejected_command="no such mode")["rejected"] == "no such mode"


# -- options and the scenario -----------------------------------------------------------------------------------------


def config_of(scenario: str, **options: str) -> Any:
    simulation = prepare(Request(scenario, options=options))
    return simulation.config(simulation.plant())


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"sticks": "tanc"}, "no such layout(.|\n)*tank"),
        ({"pilot": "nobody"}, "no such pilot"),
        ({"deadman": "yes"}, "requires pilot=manual"),
    ],
)
def test_option_that_is_not_valid_is_refused(options: dict[str, str], message: str) -> None:
    with pytest.raises((UnknownNameError, ParameterError), match=message):
        config_of("rover_teleop", **options)


def test_invalid_port_is_refused_with_the_port_of_the_rover() -> None:
    with pytest.raises(ParameterError, match=r"port=no is not a valid port(.|\n)*port=9130"):
        config_of("rover_teleop", port="no")


def test_option_of_a_pilot_is_refused_where_there_is_none() -> None:
    with pytest.raises(ParameterError, match="there is no pilot in rover_hill"):
        config_of("rover_hill", pilot="manual")


def test_scenario_without_a_pilot_runs_the_rover_alone() -> None:
    assert prepare(Request("rover_teleop")).roles == ["rover", "topside"]
    assert prepare(Request("rover_teleop", role="rover")).is_standalone
    for scenario in ("rover_hill", "rover_waypoints"):
        assert prepare(Request(scenario)).roles == ["rover"]
        assert not prepare(Request(scenario, role="rover")).is_standalone, "so it is simulated again in lock step"
        with pytest.raises(
            UnknownNameError, match=rf"'topside' has nothing to do in scenario '{scenario}'(.|\n)*rover"
        ):
            prepare(Request(scenario, role="topside"))


def test_gates_of_a_long_run_are_drawn_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """The judge asks at each instant, of each sample: a person may wait at home for all of five minutes."""
    simulation = prepare(Request("rover_teleop", seed=41))
    plant = simulation.plant()
    sample = Sample(0.0, (0.0, 0.0, 0.0), 0.0, 0.0)
    there, back = [sample._replace(position_m=(float(x), 0.0, 0.0)) for x in range(14)], [sample] * 100
    plant.course = [*there, *reversed(there), *back]
    drawn: list[int] = []
    rng_for = simulation.scenario.rng_for
    monkeypatch.setattr(simulation.scenario, "rng_for", lambda seed, name: drawn.append(seed) or rng_for(seed, name))
    simulation.scenario.gates.cache_clear()
    verdict = simulation.scenario.verdict(plant)
    assert verdict is not None
    assert verdict.outcome == "completed"
    assert drawn == [41]


@pytest.mark.parametrize(
    ("ways", "passed"),
    [
        ([(0, 14), (14, 0)], [1, 2, 3, -3, -2, -1]),
        ([(0, 6), (6, 2), (2, 14), (14, 0)], [1, 2, 3, -3, -2, -1]),
        ([(0, 14), (14, 10), (10, 14), (14, 6), (6, 10), (10, 0)], [1, 2, 3, -3, -2, -1]),
        ([(0, 6), (6, 0)], []),
        ([(0, 14), (14, 6)], [1, 2, 3, -3, -2]),
    ],
)
def test_gate_that_is_driven_back_through_at_once_does_not_count(
    ways: list[tuple[int, int]], passed: list[int]
) -> None:
    simulation = prepare(Request("rover_teleop", engine="pymunk"))
    plant = simulation.plant()
    places = [float(x) for begin, end in ways for x in range(begin, end, 1 if end > begin else -1)]
    plant.course = [Sample(0.1 * i, (x, 0.0, 0.0), 0.0, 0.0) for i, x in enumerate([*places, float(ways[-1][1])])]
    assert simulation.scenario.passed_gates(plant) == passed


def test_person_at_the_surface_has_pad_pilot_display_and_link() -> None:
    names = [
        type(one).__name__ for one in config_of("rover_teleop", pilot="manual", sticks="tank").factories["topside"]
    ]
    assert names[1:] == ["GamepadLoopFactory", "GamepadPilotFactory", "DisplayFactory", "LinkMonitorFactory"]


@pytest.mark.slow
def test_rover_brakes_while_the_link_is_cut_and_drives_on_after_it(monkeypatch: pytest.MonkeyPatch) -> None:
    simulation = prepare(Request("rover_teleop"))
    parameters = simulation.robot.parameters
    cut = replace(parameters, radio=replace(parameters.radio, cut=((4.0, 5.5),)))
    monkeypatch.setattr(simulation, "robot", replace(simulation.robot, parameters=cut))
    monkeypatch.setattr(simulation.scenario, "TIME_LIMIT_S", 9.0)
    plant = simulation.plant()
    result = SimulationRun(simulation, plant, simulation.config(plant)).run()
    assert result.error == ""
    speeds = {round(sample.time_s, 1): sample.speed_mps for sample in plant.course}
    assert speeds[4.1] > 0.7, "the lease has not ended"
    assert max(speeds[round(0.1 * i, 1)] for i in range(49, 56)) < 0.02, "a fifth of a second, and the way to stop"
    assert speeds[8.5] > 0.7, "the link is back"
