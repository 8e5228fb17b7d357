"""A person flies: from the sticks and buttons of a game controller to controls.

    left stick    up and down: heave    left and right: yaw
    right stick   up and down: surge    left and right: sway
    start arms, back disarms, B is the emergency stop, Y clears it (disarmed only), shoulders choose the mode

Numbers are those of an Xbox controller under Linux. A button does something when it goes down, not while it is held.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import msgspec

from snr_sim import Endpoint, EndpointFactory, SomeTasks, Task, TaskId, TaskType
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.signals import PadReading

from .controls import MODES, Controls

# Which axis moves which stick, and which way: to the right and down are positive on a pad, left and up are for us.
AXES = {"yaw": 0, "heave": 1, "sway": 3, "surge": 4}
BUTTONS = {"stop": 1, "clear": 3, "mode_down": 4, "mode_up": 5, "disarm": 6, "arm": 7}
AXIS_COUNT, BUTTON_COUNT = 6, 8
DEAD_ZONE = 0.08  # sticks at rest are not at 0
SOFTNESS = 0.5  # 0 is even; 1 gives small movements almost nothing


def eased(axis: float) -> float:
    """Returns how far a stick counts: nothing in the dead zone, little at first, all at the end.

    >>> eased(0.05), eased(1.0), eased(-1.0), 0.0 < eased(0.3) < 0.2
    (0.0, 1.0, -1.0, True)
    """
    size = max(0.0, min(1.0, abs(axis)) - DEAD_ZONE) / (1.0 - DEAD_ZONE)
    size = (1.0 - SOFTNESS) * size + SOFTNESS * size**3
    return size if axis >= 0.0 else -size


@dataclass(frozen=True)
class Held:
    """What buttons have set, and stays set."""

    mode: int = 0
    is_armed: bool = False
    is_stop: bool = False


def pressed(held: Held, down: Sequence[str]) -> Held:
    """Returns what is set after some buttons went down. The emergency stop counts before all others.

    >>> pressed(Held(is_armed=True), ["mode_up", "stop"])
    Held(mode=0, is_armed=False, is_stop=True)
    """
    if "stop" in down:
        return Held(held.mode, is_stop=True)
    mode = held.mode + ("mode_up" in down) - ("mode_down" in down)
    is_armed = (held.is_armed or "arm" in down) and "disarm" not in down
    is_stop = held.is_stop and not ("clear" in down and not is_armed)
    return Held(min(len(MODES) - 1, max(0, mode)), is_armed and not is_stop, is_stop)


class PadPilotFactory(EndpointFactory):
    """Makes the mapping from page 'pad' to page 'controls'.

    Args:
        key: of the page, if it goes to somebody at the surface who makes "controls" of it.
    """

    def __init__(self, key: str = "controls") -> None:
        super().__init__()
        self.key = key

    def get(self, parent: NodeApi) -> PadPilot:
        """Returns the endpoint 'pilot'."""
        return PadPilot(self, parent, "pilot")


class PadPilot(Endpoint):
    """Answers each reading of the pad with controls. A pad that has gone is one at rest: what is armed stays armed."""

    factory: PadPilotFactory

    def __init__(self, factory: PadPilotFactory, parent: NodeApi, name: str) -> None:
        super().__init__(factory, parent, name)
        self.held = Held()
        self.clears = False
        self.number = 0
        self.before: list[bool] | None = None
        self.task_handlers = {(TaskType.process_data, "pad"): self.on_pad}

    def on_pad(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Maps one reading."""
        pad = PadReading(**self.get_data("pad"))
        self.number += 1
        was_stop = self.held.is_stop
        self.held = pressed(self.held, self.gone_down(pad.buttons))
        # To clear a stop is asked for until the vehicle says that it is cleared: one command may be lost.
        vehicle = self.get_data("vehicle")
        is_stopped = isinstance(vehicle, dict) and vehicle.get("is_stopped") is True
        self.clears = not self.held.is_stop and (was_stop or (self.clears and is_stopped))
        sticks = {stick: -eased(pad.axes[number]) if number < len(pad.axes) else 0.0 for stick, number in AXES.items()}
        controls = Controls(
            self.number,
            MODES[self.held.mode],
            self.held.is_armed and not self.clears,
            self.held.is_stop,
            self.clears,
            **sticks,
        )
        return self.store_data_task(self.factory.key, msgspec.structs.asdict(controls))

    def gone_down(self, buttons: list[bool]) -> list[str]:
        """Returns the names of the buttons that are down and were not.

        Of the first reading, and of the first of another pad, only the emergency stop counts.
        """
        before, self.before = self.before, buttons
        down = [name for name, number in BUTTONS.items() if number < len(buttons) and buttons[number]]
        if before is None or len(before) != len(buttons):
            return [name for name in down if name == "stop"]
        return [name for name in down if not before[BUTTONS[name]]]
