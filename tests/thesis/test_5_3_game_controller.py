"""Listings 5.3 and A.6 to A.11: a game controller drives a robot over sockets.

    python tests/thesis/test_5_3_game_controller.py robot
    python tests/thesis/test_5_3_game_controller.py topside        with a pad plugged in

    topside   pad --> page "pad" --> controller --> page "controller_input" --> client --.
    robot     server --> page "controller_input" --> mixer --> page "thrust" --> motors <-'

What was wrong. The pad's module was in a folder whose name begins with a dot, so no installation ever held it. It
opened a window to receive the pad's events. It read the newest page and `<key>_prev` to find out what was pressed,
which the code of the time had in one of its two versions only. A robot whose pad was unplugged kept the last command,
and so did one whose page of the released sticks was lost. The client's key was a text, of which each letter became a
key (see listing 5.1).

What we changed. Nothing has to be: `Joystick`, `InputMapping` and `ButtonEvents`, at the end of this file, do what the
listings do by their names and calls. For a robot that moves, the pad is a device like any other (`GamepadLoopFactory`,
and behind it `PygameGamepad` from the extra `pad`); no window. A pad that is unplugged is at rest within one tick.
Nothing moves unless the dead man's button is held. The motors stop by themselves when commands are older than half a
second. What is pressed is derived from `<key>_prev` as in the thesis.
"""

from __future__ import annotations

import logging
import sys
import threading
from collections.abc import Callable
from types import MappingProxyType
from typing import Any

import msgspec
import pytest

from snr_sim import (
    AbstractNode,
    CliRunner,
    ComponentName,
    ComponentsByRole,
    Config,
    DataKey,
    Endpoint,
    EndpointFactory,
    FakeActuator,
    FakeSensor,
    LoopFactory,
    Node,
    Page,
    SimRunner,
    SocketsPair,
    SomeTasks,
    StopwatchEndpointFactory,
    Task,
    TaskId,
    TaskType,
    ThreadLoop,
    tasks,
)
from snr_sim.devices.commands import ActuatorLoopFactory
from snr_sim.devices.gamepad import GamepadLoopFactory
from snr_sim.devices.pygame_gamepad import PygameGamepad
from snr_sim.prelude.device import Actuator, Sensor, Stale
from snr_sim.prelude.signals import GamepadReading
from snr_sim.testing.function_components import FunctionEndpointFactory

# What each axis and button of this pad means: A.8. Another pad is another table.
AXES = {"turn": 0, "ahead": 1}
BUTTONS = {"dead_man": 4, "lights": 0}
DEAD_BAND = 0.1  # a released stick does not return to 0 by itself
RATE_HZ = 20.0


class ThrustCommand(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Commands of the two motors: -1 to 1 each."""

    left: float = 0.0
    right: float = 0.0


class ControllerFactory(EndpointFactory):
    """Makes what knows the pad's layout."""

    def get(self, parent: Node) -> Endpoint:
        return Controller(self, parent, "controller")


class Controller(Endpoint):
    """Turns numbered axes and buttons into named wishes: A.7, A.9."""

    def __init__(self, factory: EndpointFactory, parent: Node, name: str) -> None:
        super().__init__(factory, parent, name)
        self.task_handlers = {(TaskType.process_data, "pad"): self.read_pad}

    def read_pad(self, task: Task, task_id: TaskId) -> SomeTasks:
        pad = self.get_data("pad")
        is_held = is_down(pad, "dead_man")
        wish = {name: axis_of(pad, number) if is_held else 0.0 for name, number in AXES.items()}
        pressed = is_down(pad, "lights") and not is_down(self.get_data("pad_prev"), "lights")
        wish["ahead"] = -wish["ahead"]  # pushing a stick away gives -1
        store = self.store_data_task("controller_input", wish | {"lights_pressed": pressed})
        return [store, tasks.event("lights")] if pressed else store


def axis_of(pad: dict[str, Any], number: int) -> float:
    """An axis, with nothing in the middle; 0 if the pad has none of that number."""
    position: float = pad["axes"][number] if number < len(pad["axes"]) else 0.0
    return 0.0 if abs(position) < DEAD_BAND else position


def is_down(pad: dict[str, Any] | None, name: str) -> bool:
    """Whether a button is pressed; there is no pad before the first page."""
    number = BUTTONS[name]
    return pad is not None and number < len(pad["buttons"]) and pad["buttons"][number]


class MixerFactory(EndpointFactory):
    """Makes what turns wishes into thrust."""

    def get(self, parent: Node) -> Endpoint:
        return Mixer(self, parent, "mixer")


class Mixer(Endpoint):
    """Two motors side by side: A.10."""

    def __init__(self, factory: EndpointFactory, parent: Node, name: str) -> None:
        super().__init__(factory, parent, name)
        self.task_handlers = {(TaskType.process_data, "controller_input"): self.mix}

    def mix(self, task: Task, task_id: TaskId) -> SomeTasks:
        wish = self.get_data("controller_input")
        return self.store_data_task(
            "thrust", {"left": wish["ahead"] + wish["turn"], "right": wish["ahead"] - wish["turn"]}
        )


def components(
    open_pad: Callable[[], Sensor[GamepadReading]],
    open_motors: Callable[[], Actuator[ThrustCommand]],
    port: int = 54323,
) -> dict[str, list[Any]]:
    """Listing 5.3 and A.11: the wiring."""
    pair = SocketsPair(("127.0.0.1", port), name="tether")
    return {
        "topside": [GamepadLoopFactory("pad", open_pad, RATE_HZ), ControllerFactory(), pair.client("controller_input")],
        "robot": [pair.server(), MixerFactory(), ActuatorLoopFactory("thrust", open_motors, RATE_HZ)],
    }


def motors() -> FakeActuator[ThrustCommand]:
    """Motors without a wire: they store their commands."""
    return FakeActuator(ThrustCommand, {"left": (-1.0, 1.0), "right": (-1.0, 1.0)})


def pad(ahead: float = 0.0, turn: float = 0.0, held: bool = True, lights: bool = False) -> GamepadReading:
    buttons = [False] * 6
    buttons[BUTTONS["dead_man"]], buttons[BUTTONS["lights"]] = held, lights
    return GamepadReading([turn, -ahead], buttons, [])


def play(*readings: GamepadReading | Exception) -> tuple[list[ThrustCommand], Node, list[float]]:
    """Plays a script on the pad, one reading at each tick, in lock step.

    Returns the commands of the motors, the topside, and when the lights were switched.
    """
    sensor, actuator, switched = FakeSensor(readings), motors(), list[float]()
    wiring = components(lambda: sensor, lambda: actuator)
    wiring["topside"].append(StopwatchEndpointFactory(switched, [(TaskType.event, "lights")]))
    # What crosses the link at a tick is written at the next one.
    runner = SimRunner(Config(factories=wiring), until_s=len(readings) / RATE_HZ + 0.001)
    runner.run()
    return actuator.written, runner.nodes["topside"], switched


def test_sticks_drive_the_motors_while_the_dead_mans_button_is_held() -> None:
    written, _, _ = play(
        *[pad()] * 10, *[pad(ahead=1.0)] * 3, *[pad(ahead=0.5, turn=0.25)] * 3, *[pad(1.0, held=False)] * 3
    )
    seen = list(dict.fromkeys((command.left, command.right) for command in written))
    assert seen == [(0.0, 0.0), (1.0, 1.0), (0.75, 0.25)]
    assert written[-1] == ThrustCommand(0.0, 0.0)


def test_a_stick_that_does_not_quite_return_to_the_middle_moves_nothing() -> None:
    written, _, _ = play(*[pad(ahead=0.09, turn=-0.05)] * 12)
    assert set(written) == {ThrustCommand(0.0, 0.0)}


def test_a_button_is_pressed_once_however_long_it_is_held() -> None:
    lit = [False, True, True, True, False, True, False]
    _, _, switched = play(*[pad(lights=is_lit) for is_lit in lit])
    assert switched == [1 / RATE_HZ, 5 / RATE_HZ]


def test_a_pad_that_is_unplugged_stops_the_motors_within_a_tick() -> None:
    written, topside, _ = play(*[pad(ahead=1.0)] * 10, Stale("unplugged"))
    assert topside.get_data("pad")["is_connected"] is False
    assert topside.get_data("controller_input")["ahead"] == 0.0
    assert written[-2:] == [ThrustCommand(1.0, 1.0), ThrustCommand(0.0, 0.0)]


@pytest.mark.slow
def test_scripted_sdl_gamepad_drives_two_nodes_over_sockets(free_ports: Any) -> None:
    """Each move of the script waits for what the one before it has done to the motors, not for a time."""
    pytest.importorskip("pygame", reason="the extra 'pad' is not installed")
    from snr_sim.testing.virtual_gamepad import VirtualGamepad

    virtual = VirtualGamepad()
    script: list[tuple[float, Callable[[], None]]] = [  # once the left motor turns so fast, do this
        (0.0, lambda: virtual.press(BUTTONS["dead_man"])),
        (0.0, lambda: virtual.move(AXES["ahead"], -1.0)),
        (1.0, virtual.unplug),
        (0.0, virtual.plug_in),
    ]

    def follow(task: Task, task_id: TaskId) -> SomeTasks:
        expected, action = script[0]
        if abs(task.val_list[0].data["left"] - expected) < 0.01:
            action()
            script.pop(0)
        return None if script else tasks.terminate("played")

    wiring = components(PygameGamepad, motors, *free_ports(1))
    wiring["robot"].append(FunctionEndpointFactory({(TaskType.store_page, "thrust"): follow}, "follower"))
    nodes = {role: Node(role, Config(factories=wiring)) for role in ("robot", "topside")}
    threads = [threading.Thread(target=node.loop, daemon=True) for node in nodes.values()]
    for thread in threads:
        thread.start()
    threads[0].join(60.0)
    nodes["topside"].enqueue_input(tasks.terminate("test is over"), "test")
    threads[1].join(60.0)
    virtual.unplug()
    assert nodes["robot"].exit_reason == "played"
    assert nodes["topside"].exit_reason == "test is over"


class JoystickFactory(LoopFactory):
    """A.6: makes what reads a joystick; here one that plays a script."""

    def __init__(self, script: list[list[int]], output_data: DataKey = "raw_controller_input") -> None:
        super().__init__([sys.modules[__name__]])
        self.script = script
        self.output_data = output_data

    def get(self, parent: AbstractNode) -> Joystick:
        return Joystick(self, parent)


class Joystick(ThreadLoop):
    """A.6: stores what is pressed, by the buttons' numbers, until the joystick is gone."""

    factory: JoystickFactory

    def __init__(self, factory: LoopFactory, parent: AbstractNode) -> None:
        super().__init__(factory, parent, "controller_loop", max_tick_rate_hz=20)

    def setup(self) -> None:
        self.positions = iter(self.factory.script)

    def loop(self) -> None:
        buttons = next(self.positions, None)
        if buttons is None:
            self.set_terminate_flag()
            return
        self.store_data(self.factory.output_data, {f"button_{i}": button for i, button in enumerate(buttons)})

    def halt(self) -> None: ...

    def terminate(self) -> None: ...


class InputMappingFactory(EndpointFactory):
    """A.8: makes what names the buttons."""

    def __init__(self, input_data: DataKey = "raw_controller_input", output_data: DataKey = "controller_input") -> None:
        super().__init__(sys.modules[__name__])
        self.input_data = input_data
        self.output_data = output_data

    def get(self, parent: AbstractNode) -> Endpoint:
        return InputMapping(self, parent, self.input_data, self.output_data)


class InputMapping(Endpoint):
    """A.9: a name for each number that has one."""

    names = MappingProxyType({"button_0": "A", "button_1": "B"})

    def __init__(self, factory: EndpointFactory, parent: AbstractNode, input_data: DataKey, output: DataKey) -> None:
        super().__init__(factory, parent, "controller_input_map")
        self.output_data = output
        self.task_handlers = {(TaskType.store_page, input_data): self.map_raw_input}

    def map_raw_input(self, task: Task, key: TaskId) -> SomeTasks:
        page = task.val_list[0]
        assert isinstance(page, Page)
        named = {self.names[number]: value for number, value in page.data.items() if number in self.names}
        return self.store_data_task(self.output_data, named)


class ButtonEventsFactory(EndpointFactory):
    """A.10: makes the endpoint that reports buttons."""

    def get(self, parent: AbstractNode) -> Endpoint:
        return ButtonEvents(self, parent, "input_processor")


class ButtonEvents(Endpoint):
    """A.7: an event for each button that goes down or comes up, from the page and the one before."""

    def __init__(self, factory: EndpointFactory, parent: AbstractNode, name: ComponentName) -> None:
        super().__init__(factory, parent, name)
        self.task_handlers = {(TaskType.store_page, "controller_input"): self.process_input}

    def process_input(self, task: Task, key: TaskId) -> SomeTasks:
        before = self.get_data("controller_input" + "_prev")
        if before is None:
            self.info("no input before this")
            return None
        changes = [(name, value) for name, value in task.val_list[0].data.items() if value != before[name]]
        return [tasks.event("button_pressed" if value else "button_released", [name]) for name, value in changes]


def test_listings_report_each_button_over_tether(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    events: list[tuple[str, Any]] = []
    pair = SocketsPair(("127.0.0.1", 54324))
    components: ComponentsByRole = {
        "topside": [
            JoystickFactory([[0, 0, 1], [1, 0, 0], [1, 1, 0], [0, 1, 1]]),
            InputMappingFactory(),
            pair.client("controller_input"),
        ],
        "robot": [
            pair.server(),
            ButtonEventsFactory(),
            FunctionEndpointFactory({TaskType.event: lambda task, key: events.append((task.name, *task.val_list))}),
        ],
    }
    SimRunner(Config(factories=components), until_s=1.0).run()
    assert events == [("button_pressed", "A"), ("button_pressed", "B"), ("button_released", "A")]
    assert ("snr.robot_node.input_processor", logging.INFO, "no input before this") in caplog.record_tuples


class PrintedJoystickFactory(JoystickFactory):
    """A.6 as printed."""

    def get(self, parent: AbstractNode) -> Joystick:
        return PrintedJoystick(self, parent)


class PrintedJoystick(Joystick):
    """A.6 as printed: the list of all events, which `pygame.event.get()` returns, is compared with one."""

    def loop(self) -> None:
        event = next(self.positions, [])
        if event in (BUTTON_DOWN, BUTTON_UP):
            self.store_data(self.factory.output_data, {"button_0": 1})


BUTTON_DOWN, BUTTON_UP = 1539, 1540  # pygame's numbers


def test_joystick_as_printed_runs_and_stores_nothing_which_is_noted() -> None:
    script = [[], [BUTTON_DOWN], [BUTTON_UP, BUTTON_DOWN]]
    config = Config(factories={"topside": [PrintedJoystickFactory(script), InputMappingFactory()]})
    runner = SimRunner(config, until_s=1.0)
    runner.run()
    (note,) = runner.nodes["topside"].notes
    assert "'controller_input_map' waits for store_page 'raw_controller_input', which was never stored" in note


if __name__ == "__main__":
    CliRunner(components(PygameGamepad, motors)).run()
