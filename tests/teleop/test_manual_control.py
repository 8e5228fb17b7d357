"""A person who commands a rover: gamepad, keyboard, dead-man switch, and the controls that are made of them."""

from itertools import pairwise
from typing import Any

import msgspec
import pytest

from snr_sim import Config, Mode, SimRunner, TaskType
from snr_sim.devices.pad import PadLoopFactory
from snr_sim.prelude.device import Stale
from snr_sim.prelude.errors import MissingExtra, SensorLost
from snr_sim.prelude.signals import PadReading
from snr_sim.teleop.gamepad_pilot import BUTTONS, GamepadPilotFactory, LatchedButtons, Stick, apply_expo
from snr_sim.teleop.keyboard import BUTTON_KEYS, KEPT_S, Keyboard, legend
from snr_sim.teleop.manual_input import TRIGGER, DeadmanSwitch, ManualInput
from snr_sim.testing.contracts import check_sensor
from snr_sim.testing.fakes import FakeSensor
from snr_sim.testing.parts import Part, PartFactory

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


def pad(*down: str, **sticks: float) -> PadReading:
    """A reading with some buttons down and some axes moved."""
    axes, buttons = [0.0] * 6, [False] * 8
    for stick, value in sticks.items():
        axes[STICKS[stick].axis] = value
    for name in down:
        buttons[BUTTONS[name]] = True
    return PadReading(axes, buttons, [])


def at(stamp_s: float, reading: PadReading) -> PadReading:
    """The same of another time."""
    return msgspec.structs.replace(reading, stamp_s=stamp_s)


def commanded(readings: list[Any], vehicle_stopped: list[bool] | None = None) -> list[dict[str, Any]]:
    """The controls that a pilot makes of readings, one after the other.

    Args:
        readings: of the pad.
        vehicle_stopped: what the vehicle says, at each of them.
    """
    told: list[dict[str, Any]] = []
    said = list(vehicle_stopped or [])
    parts: list[Part] = []

    def hear(task: Any, task_id: Any) -> Any:
        told.append(dict(parts[0].get_data("controls")))
        return parts[0].store_data_task("vehicle", {"is_stopped": said.pop(0)}) if said else None

    listener = PartFactory({(TaskType.process_data, "controls"): hear}, begin=parts.append)
    hand = PadLoopFactory("pad", lambda: FakeSensor(readings), RATE_HZ)
    config = Config(Mode.TEST, {"topside": [hand, GamepadPilotFactory(Drive, STICKS, MODES), listener]})
    SimRunner(config, until_s=(len(readings) - 0.5) / RATE_HZ).run()
    return told


def test_a_stick_that_is_not_quite_at_rest_is_at_rest_and_the_rest_is_smooth() -> None:
    assert apply_expo(0.079) == 0.0
    course = [apply_expo(i / 100 - 1.0) for i in range(201)]
    assert course == sorted(course)
    assert (course[0], course[-1]) == (-1.0, 1.0)
    assert max(b - a for a, b in pairwise(course)) < 0.03


def test_buttons_count_when_they_go_down_and_not_while_they_are_held() -> None:
    told = commanded([pad(), pad("mode_up"), pad("mode_up"), pad(), pad("mode_up"), pad("arm"), pad("disarm")])
    assert [MODES.index(one["mode"]) for one in told] == [0, 1, 1, 1, 2, 2, 2]
    assert [one["is_armed"] for one in told] == [False] * 5 + [True, False]


def test_a_button_that_is_down_at_the_first_reading_does_nothing() -> None:
    assert [one["is_armed"] for one in commanded([pad("arm"), pad("arm")])] == [False, False]


def test_a_stop_counts_also_in_the_first_reading_and_in_that_in_which_a_pad_is_unplugged() -> None:
    assert [one["is_stop"] for one in commanded([pad("stop", "arm"), pad()])] == [True, True]
    of_eleven = PadReading([0.0] * 6, [False] * 11, [])
    told = commanded([of_eleven, pad("stop", "arm"), pad("arm"), pad()])
    assert [one["is_stop"] for one in told] == [False, True, True, True]
    assert not told[-1]["is_armed"]


def test_modes_end_at_both_ends() -> None:
    assert LatchedButtons(mode=0).after(["mode_down"], len(MODES)).mode == 0
    assert LatchedButtons(mode=len(MODES) - 1).after(["mode_up"], len(MODES)).mode == len(MODES) - 1


def test_a_stop_disarms_and_only_clear_ends_it() -> None:
    stopped = LatchedButtons(2, is_armed=True).after(["stop", "arm"], len(MODES))
    assert stopped == LatchedButtons(2, is_armed=False, is_stop=True)
    assert stopped.after(["arm"], len(MODES)) == stopped
    assert stopped.after(["clear"], len(MODES)) == LatchedButtons(2)


def test_clearing_a_stop_is_asked_for_until_the_vehicle_says_it_is_done_and_unarmed_till_then() -> None:
    readings = [pad(), pad("stop"), pad(), pad("clear"), pad(), pad("arm"), pad(), pad()]
    told = commanded(readings, [False, True, True, True, True, True, False, False])
    assert [one["is_stop"] for one in told] == [False, True, True, False, False, False, False, False]
    assert [one["clears_stop"] for one in told] == [False, False, False, True, True, True, True, False]
    assert [one["is_armed"] for one in told] == [False] * 7 + [True]


def test_a_pad_that_is_unplugged_lets_go_of_the_sticks_and_the_controls_go_on() -> None:
    told = commanded([pad(), pad("arm"), pad(drive=-1.0), Stale("gone"), Stale("gone"), pad()])
    assert [one["drive"] for one in told] == [0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
    assert told[-1]["number"] == 6
    assert told[-1]["is_armed"]


class Typist:
    """Types what it is told to, by a clock of its own."""

    def __init__(self) -> None:
        self.keys, self.time_s = "", 0.0

    def typed(self) -> str:
        keys, self.keys = self.keys, ""
        return keys

    def now_s(self) -> float:
        return self.time_s


def test_the_keyboard_keeps_the_promise_of_sensors() -> None:
    check_sensor(lambda: Keyboard(STICKS, lambda: ""))


def test_a_key_holds_its_stick_until_it_is_no_longer_repeated() -> None:
    typist = Typist()
    keyboard = Keyboard(STICKS, typist.typed, typist.now_s)
    typist.keys = "wA"
    assert keyboard.read() == pad(drive=-1.0, turn=-1.0)
    typist.time_s = KEPT_S - 0.01
    assert keyboard.read() == at(typist.time_s, pad(drive=-1.0, turn=-1.0))
    typist.time_s = KEPT_S + 0.01
    assert keyboard.read() == at(typist.time_s, pad())


def test_opposite_keys_cancel_and_others_mean_nothing() -> None:
    typist = Typist()
    keyboard = Keyboard(STICKS, typist.typed, typist.now_s)
    typist.keys = "wsx?\n"
    assert keyboard.read() == pad()


def test_space_is_the_emergency_stop() -> None:
    typist = Typist()
    keyboard = Keyboard(STICKS, typist.typed, typist.now_s)
    typist.keys = "+1c "
    assert keyboard.read() == pad("stop"), "before all that was typed before it"
    assert [keyboard.read() for _ in range(3)] == [pad("mode_up"), pad(), pad()], "which neither arms nor clears"


def test_each_press_of_a_key_counts_however_fast_it_is_typed() -> None:
    typist = Typist()
    keyboard = Keyboard(STICKS, typist.typed, typist.now_s)
    typist.keys = "+++-1"
    readings = [pad(), *(keyboard.read() for _ in range(10))]
    told = commanded(readings)
    modes = [MODES.index(one["mode"]) for one in told]
    assert max(modes) == 3
    assert modes[-1] == 2
    assert told[-1]["is_armed"]


def test_whoever_disarms_in_haste_is_disarmed_at_once_and_whoever_arms_after_it_is_armed() -> None:
    typist = Typist()
    keyboard = Keyboard(STICKS, typist.typed, typist.now_s)
    typist.keys = "1++++2"
    assert keyboard.read() == pad("disarm")
    typist.keys = "21"
    told = commanded([pad(), *(keyboard.read() for _ in range(20))])
    assert told[-1]["is_armed"]


def test_a_key_that_is_leant_on_is_not_obeyed_for_seconds_afterwards() -> None:
    typist = Typist()
    keyboard = Keyboard(STICKS, typist.typed, typist.now_s)
    typist.keys = "+" * 100
    readings = [keyboard.read() for _ in range(40)]
    assert readings[0] == pad("mode_up")
    assert readings[20:] == [pad()] * 20, "a second at 20 Hz"


def test_hands_take_the_pad_if_there_is_one_and_the_keyboard_else_and_stamp_by_the_runs_clock() -> None:
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
        raise MissingExtra("pygame-ce", "pad")

    without = ManualInput(not_installed, lambda: keys, lambda: 7.5)
    assert without.read() == at(7.5, pad("arm"))
    without.close()
    with pytest.raises(SensorLost):
        without.read()


def test_space_stops_the_vehicle_also_while_a_pad_is_plugged_in() -> None:
    typist, plugged = Typist(), FakeSensor([pad("mode_up"), PadReading([], [], [])])
    hands = ManualInput(lambda: plugged, lambda: Keyboard(STICKS, typist.typed, typist.now_s), typist.now_s)
    typist.keys = "w "
    assert hands.read() == pad("mode_up", "stop")
    typist.keys = " "
    assert hands.read().buttons[BUTTONS["stop"]]


def test_deadman_switch_passes_sticks_while_the_trigger_is_held_and_buttons_always() -> None:
    check_sensor(lambda: DeadmanSwitch(FakeSensor([pad(drive=1.0)])))
    held, pushed = pad("arm", drive=1.0), pad("arm", drive=1.0)
    held.axes[TRIGGER] = 0.5
    few = PadReading([1.0], [True], [])
    switch = DeadmanSwitch(FakeSensor([held, pushed, Stale("gone"), few]))
    assert [switch.read() for _ in range(4)] == [held, pad("arm"), Stale("gone"), PadReading([0.0], [True], [])]


def test_legend_names_every_key() -> None:
    words = " ".join(legend("w s ahead, astern  a d turn")).split()
    for key in [*BUTTON_KEYS, *(key for stick in STICKS.values() for key in stick.keys)]:
        assert {" ": "space", "=": "+"}.get(key, key) in words
