"""A person commands: from the sticks and buttons of a gamepad to a robot's controls.

    start arms, back disarms, B is the emergency stop, Y clears it (disarmed only), shoulders choose the mode

Numbers are those of an Xbox controller under Linux. A button acts when it goes down, not while it is held.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import msgspec

from snr_sim.core.endpoint import Endpoint, EndpointFactory
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.signals import GamepadReading
from snr_sim.prelude.task import SomeTasks, Task, TaskId, TaskType

BUTTONS = {"stop": 1, "clear": 3, "mode_down": 4, "mode_up": 5, "disarm": 6, "arm": 7}
AXIS_COUNT, BUTTON_COUNT = 6, 8
DEAD_ZONE = 0.08  # sticks at rest are not at 0
EXPO = 0.5  # 0 is linear; 1 gives small movements almost nothing


class Stick(NamedTuple):
    """What moves one field of the controls, from -1 to 1.

    Args:
        axis: of the gamepad. To the right and down are positive there; left and up are positive in the controls.
        keys: of the keyboard: for 1, and for -1.
    """

    axis: int
    keys: str


def apply_expo(axis: float) -> float:
    """Return how far a stick counts: nothing in the dead zone, little at first, all at the end.

    >>> apply_expo(0.05), apply_expo(1.0), apply_expo(-1.0), 0.0 < apply_expo(0.3) < 0.2
    (0.0, 1.0, -1.0, True)
    """
    size = max(0.0, min(1.0, abs(axis)) - DEAD_ZONE) / (1.0 - DEAD_ZONE)
    size = (1.0 - EXPO) * size + EXPO * size**3
    return size if axis >= 0.0 else -size


@dataclass(frozen=True)
class LatchedButtons:
    """What buttons have set, and stays set; `mode` counts from 0."""

    mode: int = 0
    is_armed: bool = False
    is_stop: bool = False

    def after(self, down: Sequence[str], mode_count: int) -> LatchedButtons:
        """Return the state after some buttons went down. The emergency stop has priority.

        >>> LatchedButtons(is_armed=True).after(["mode_up", "stop"], mode_count=2)
        LatchedButtons(mode=0, is_armed=False, is_stop=True)
        """
        if "stop" in down:
            return LatchedButtons(self.mode, is_stop=True)
        mode = self.mode + ("mode_up" in down) - ("mode_down" in down)
        is_armed = (self.is_armed or "arm" in down) and "disarm" not in down
        is_stop = self.is_stop and not ("clear" in down and not is_armed)
        return LatchedButtons(min(mode_count - 1, max(0, mode)), is_armed and not is_stop, is_stop)


class GamepadPilotFactory(EndpointFactory):
    """Makes the mapping from page 'gamepad' to page 'controls'.

    Args:
        command_type: struct of the controls.
        sticks: inputs of each field of the controls.
        modes: its modes, from the first.
        key: of the page, if a component at the surface makes "controls" of it.
        curve: how far a stick counts, from how far it is moved.
        triggers: axes of fields of the controls that are true while a trigger is pressed by more than half.
    """

    def __init__(
        self,
        command_type: type[msgspec.Struct],
        sticks: Mapping[str, Stick],
        modes: Sequence[str],
        key: str = "controls",
        curve: Callable[[float], float] = apply_expo,
        triggers: Mapping[str, int] | None = None,
    ) -> None:
        super().__init__()
        self.command_type: type[msgspec.Struct] = command_type
        self.sticks: Mapping[str, Stick] = sticks
        self.modes: Sequence[str] = modes
        self.key: str = key
        self.curve: Callable[[float], float] = curve
        self.triggers: Mapping[str, int] = triggers or {}

    def get(self, parent: NodeApi) -> GamepadPilot:
        """Return the endpoint 'pilot'."""
        return GamepadPilot(self, parent, "pilot")


class GamepadPilot(Endpoint):
    """Answers each reading with controls. A gamepad that is unplugged is at rest: armed outputs stay armed."""

    factory: GamepadPilotFactory

    def __init__(self, factory: GamepadPilotFactory, parent: NodeApi, name: str) -> None:
        super().__init__(factory, parent, name)
        self.latched: LatchedButtons = LatchedButtons()
        self.clears: bool = False
        self.number: int = 0
        self.before: list[bool] | None = None
        self.task_handlers = {(TaskType.process_data, "gamepad"): self.on_gamepad}

    def on_gamepad(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Map one reading."""
        factory, gamepad = self.factory, GamepadReading(**self.get_data("gamepad"))
        self.number += 1
        was_stop = self.latched.is_stop
        self.latched = latched = self.latched.after(self.pressed_edges(gamepad.buttons), len(factory.modes))
        # The request to clear a stop is repeated until the vehicle reports it: one command may be lost.
        vehicle = self.get_data("vehicle")
        is_stopped = isinstance(vehicle, dict) and vehicle.get("is_stopped") is True
        self.clears = not latched.is_stop and (was_stop or (self.clears and is_stopped))
        controls = factory.command_type(
            number=self.number,
            mode=factory.modes[latched.mode],
            is_armed=latched.is_armed and not self.clears,
            is_stop=latched.is_stop,
            clears_stop=self.clears,
            **{
                name: -factory.curve(gamepad.axes[stick.axis]) if stick.axis < len(gamepad.axes) else 0.0
                for name, stick in factory.sticks.items()
            },
            **{name: axis < len(gamepad.axes) and gamepad.axes[axis] > 0.0 for name, axis in factory.triggers.items()},
        )
        return self.store_data_task(factory.key, msgspec.structs.asdict(controls))

    def pressed_edges(self, buttons: list[bool]) -> list[str]:
        """Return the names of the buttons that are down and were not.

        Of the first reading, and of the first of another gamepad, only the emergency stop counts.
        """
        before, self.before = self.before, buttons
        down = [name for name, number in BUTTONS.items() if number < len(buttons) and buttons[number]]
        if before is None or len(before) != len(buttons):
            return [name for name in down if name == "stop"]
        return [name for name in down if not before[BUTTONS[name]]]
