"""A person who commands a rover: gamepad, keyboard, dead-man switch, and the controls that are made of them."""

from itertools import pairwise
from typing import Any

import msgspec
import pytest

from snr_sim import Config, Mode, SimRunner, TaskType
from snr_sim.devices.gamepad import GamepadLoopFactory
from snr_sim.prelude.device import Stale
from snr_sim.prelude.errors import MissingExtraError, SensorLostError
from snr_sim.prelude.signals import GamepadReading
from snr_sim.teleop.gamepad_pilot import BUTTONS, GamepadPilotFactory, LatchedButtons, Stick, apply_expo
from snr_sim.teleop.keyboard import BUTTON_KEYS, KEY_HOLD_S, Keyboard, legend
from snr_sim.teleop.manual_input import TRIGGER, DeadmanSwitch, ManualInput
from snr_sim.testing.contracts import check_sensor
from snr_sim.testing.fakes import FakeSensor
from snr_sim.testing.function_components import FunctionEndpoint, FunctionEndpointFactory

RATE_HZ = 20.0
STICKS = {"drive": Stick(4, "ws"), "turn": Stick(0, "ad")}
MODES = ("manual", "speed", "heading", "route")


class Drive(msgspec.Struct, frozen=True):
    """Controls of a rover."""

    number: int
    mode: str
    is_armed: bool
    is_stop: bool
    clears_stop: bool
    drive: float
    turn: float


def pad(*down: str, **sticks: float) -> GamepadReading:
    """A reading with some buttons down and some axes moved."""
    axes, buttons = [0.0] * 6, [False] * 8
    for stick, value in sticks.items():
        axes[STICKS[stick].axis] = value
    for name in down:
        buttons[BUTTONS[name]] = True
    return GamepadReading(axes, buttons, [])


def at(stamp_s: float, reading: GamepadReading) -> GamepadReading:
    """The same of another time."""
    return msgspec.structs.replace(reading, stamp_s=stamp_s)


def commanded(readings: list[Any], vehicle_stopped: list[bool] | None = None) -> list[dict[str, Any]]:
    """The controls that a pilot makes of readings, one after the other.

    Args:
        readings: of the pad.
        vehicle_stopped: what the vehicle says, at each of them.
    """
    commands: list[dict[str, Any]] = []
    states = list(vehicle_stopped or [])
    parts: list[FunctionEndpoint] = []

    def on_controls(task: Any, task_id: Any) -> Any:
        commands.append(dict(parts[0].get_data("controls")))
        return parts[0].store_data_task("vehicle", {"is_stopped": states.pop(0)}) if states else None

    listener = FunctionEndpointFactory({(TaskType.process_data, "controls"): on_controls}, begin=parts.append)
    hand = GamepadLoopFactory("gamepad", lambda: FakeSensor(readings), RATE_HZ)
    config = Config(Mode.TEST, {"topside": [hand, GamepadPilotFactory(Drive, STICKS, MODES), listener]})
    SimRunner(config, until_s=(len(readings) - 0.5) / RATE_HZ).run()
    return commands


def test_expo_is_zero_in_dead_zone_and_smooth_beyond() -> None:
    assert apply_expo(0.079) == 0.0
    course = [apply_expo(i / 100 - 1.0) for i in range(201)]
    assert course == sorted(course)
    assert (course[0], course[-1]) == (-1.0, 1.0)
    assert max(b - a for a, b in pairwise(course)) < 0.03


def test_buttons_act_on_press_only() -> None:
    commands = commanded([pad(), pad("mode_up"), pad("mode_up"), pad(), pad("mode_up"), pad("arm"), pad("disarm")])
    assert [MODES.index(one["mode"]) for one in commands] == [0, 1, 1, 1, 2, 2, 2]
    assert [one["is_armed"] for one in commands] == [False] * 5 + [True, False]


def test_button_down_at_first_reading_is_ignored() -> None:
    assert [one["is_armed"] for one in commanded([pad("arm"), pad("arm")])] == [False, False]


def test_stop_acts_in_first_reading_and_during_unplug() -> None:
    assert [one["is_stop"] for one in commanded([pad("stop", "arm"), pad()])] == [True, True]
    of_eleven = GamepadReading([0.0] * 6, [False] * 11, [])
    commands = commanded([of_eleven, pad("stop", "arm"), pad("arm"), pad()])
    assert [one["is_stop"] for one in commands] == [False, True, True, True]
    assert not commands[-1]["is_armed"]


def test_mode_is_clamped_at_both_ends() -> None:
    assert LatchedButtons(mode=0).after(["mode_down"], len(MODES)).mode == 0
    assert LatchedButtons(mode=len(MODES) - 1).after(["mode_up"], len(MODES)).mode == len(MODES) - 1


def test_stop_disarms_until_cleared() -> None:
    stopped = LatchedButtons(2, is_armed=True).after(["stop", "arm"], len(MODES))
    assert stopped == LatchedButtons(2, is_armed=False, is_stop=True)
    assert stopped.after(["arm"], len(MODES)) == stopped
    assert stopped.after(["clear"], len(MODES)) == LatchedButtons(2)


def test_clear_is_repeated_unarmed_until_vehicle_confirms() -> None:
    readings = [pad(), pad("stop"), pad(), pad("clear"), pad(), pad("arm"), pad(), pad()]
    commands = commanded(readings, [False, True, True, True, True, True, False, False])
    assert [one["is_stop"] for one in commands] == [False, True, True, False, False, False, False, False]
    assert [one["clears_stop"] for one in commands] == [False, False, False, True, True, True, True, False]
    assert [one["is_armed"] for one in commands] == [False] * 7 + [True]


def test_unplugged_gamepad_centres_sticks_and_controls_continue() -> None:
    commands = commanded([pad(), pad("arm"), pad(drive=-1.0), Stale("gone"), Stale("gone"), pad()])
    assert [one["drive"] for one in commands] == [0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
    assert commands[-1]["number"] == 6
    assert commands[-1]["is_armed"]


class Typist:
    """Types the given keys, at times of its own clock."""

    def __init__(self) -> None:
        self.keys, self.time_s = "", 0.0

    def typed(self) -> str:
        keys, self.keys = self.keys, ""
        return keys

    def now_s(self) -> float:
        return self.time_s


@pytest.fixture
def typist() -> Typist:
    return Typist()


@pytest.fixture
def keyboard(typist: Typist) -> Keyboard:
    return Keyboard(STICKS, typist.typed, typist.now_s)


def test_keyboard_implements_sensor() -> None:
    check_sensor(lambda: Keyboard(STICKS, lambda: ""))


def test_key_holds_stick_while_repeated(typist: Typist, keyboard: Keyboard) -> None:
    typist.keys = "wA"
    assert keyboard.read() == pad(drive=-1.0, turn=-1.0)
    typist.time_s = KEY_HOLD_S - 0.01
    assert keyboard.read() == at(typist.time_s, pad(drive=-1.0, turn=-1.0))
    typist.time_s = KEY_HOLD_S + 0.01
    assert keyboard.read() == at(typist.time_s, pad())


def test_opposite_keys_cancel_and_other_keys_are_ignored(typist: Typist, keyboard: Keyboard) -> None:
    typist.keys = "wsx?\n"
    assert keyboard.read() == pad()


def test_space_is_the_emergency_stop(typist: Typist, keyboard: Keyboard) -> None:
    typist.keys = "+1c "
    assert keyboard.read() == pad("stop"), "before all that was typed before it"
    assert [keyboard.read() for _ in range(3)] == [pad("mode_up"), pad(), pad()], "which neither arms nor clears"


def test_each_key_press_counts_at_any_typing_speed(typist: Typist, keyboard: Keyboard) -> None:
    typist.keys = "+++-1"
    readings = [pad(), *(keyboard.read() for _ in range(10))]
    commands = commanded(readings)
    modes = [MODES.index(one["mode"]) for one in commands]
    assert max(modes) == 3
    assert modes[-1] == 2
    assert commands[-1]["is_armed"]


def test_disarm_is_immediate_and_later_arm_arms(typist: Typist, keyboard: Keyboard) -> None:
    typist.keys = "1++++2"
    assert keyboard.read() == pad("disarm")
    typist.keys = "21"
    commands = commanded([pad(), *(keyboard.read() for _ in range(20))])
    assert commands[-1]["is_armed"]


def test_repeated_key_is_not_queued_for_seconds(typist: Typist, keyboard: Keyboard) -> None:
    typist.keys = "+" * 100
    readings = [keyboard.read() for _ in range(40)]
    assert readings[0] == pad("mode_up")
    assert readings[20:] == [pad()] * 20, "a second at 20 Hz"


def test_manual_input_prefers_gamepad_and_uses_run_clock() -> None:
    keys = FakeSensor([pad("arm")])
    there = ManualInput(
        lambda: FakeSensor([pad(drive=0.5), Stale("unplugged"), pad(turn=0.5)]), lambda: keys, lambda: 7.5
    )
    assert [there.read() for _ in range(3)] == [
        at(7.5, pad("arm", drive=0.5)),
        at(7.5, msgspec.structs.replace(pad("arm"), is_connected=False)),
        at(7.5, pad("arm", turn=0.5)),
    ]

    def not_installed() -> Any:
        raise MissingExtraError("pygame-ce", "pad")

    without = ManualInput(not_installed, lambda: keys, lambda: 7.5)
    assert without.read() == at(7.5, pad("arm"))
    without.close()
    with pytest.raises(SensorLostError):
        without.read()


def test_space_stops_vehicle_with_gamepad_plugged_in() -> None:
    typist, plugged = Typist(), FakeSensor([pad("mode_up"), GamepadReading([], [], [])])
    manual_input = ManualInput(lambda: plugged, lambda: Keyboard(STICKS, typist.typed, typist.now_s), typist.now_s)
    typist.keys = "w "
    assert manual_input.read() == pad("mode_up", "stop")
    typist.keys = " "
    assert manual_input.read().buttons[BUTTONS["stop"]]


def test_deadman_switch_passes_sticks_while_the_trigger_is_held_and_buttons_always() -> None:
    check_sensor(lambda: DeadmanSwitch(FakeSensor([pad(drive=1.0)])))
    held, pushed = pad("arm", drive=1.0), pad("arm", drive=1.0)
    held.axes[TRIGGER] = 0.5
    few = GamepadReading([1.0], [True], [])
    switch = DeadmanSwitch(FakeSensor([held, pushed, Stale("gone"), few]))
    assert [switch.read() for _ in range(4)] == [held, pad("arm"), Stale("gone"), GamepadReading([0.0], [True], [])]


def test_deadman_button_passes_sticks_while_it_is_held_and_does_nothing_else() -> None:
    held, pushed = pad("mode_down", "arm", drive=1.0), pad("arm", drive=1.0)
    switch = DeadmanSwitch(FakeSensor([held, pushed, GamepadReading([1.0], [True], [])]), BUTTONS["mode_down"])
    assert [switch.read() for _ in range(3)] == [
        pad("arm", drive=1.0),
        pad("arm"),
        GamepadReading([0.0], [True], []),
    ]


def test_legend_names_every_key() -> None:
    words = " ".join(legend("w s ahead, astern  a d turn")).split()
    for key in [*BUTTON_KEYS, *(key for stick in STICKS.values() for key in stick.keys)]:
        assert {" ": "space", "=": "+"}.get(key, key) in words
