"""A pilot who gets the vehicle's position, and steers it along a route: forward and sideways, while it holds the rest.

    page "position_fix" --> next waypoint --> steering: sticks --> page "controls"

He flies as a person does: by eye, with a delay, with the sticks. Depth and heading he asks for by number.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import msgspec

from snr_sim import Endpoint, EndpointFactory, SomeTasks, handles
from snr_sim.devices import PositionFix
from snr_sim.scenario import NodeApi

from .controls import Controls
from .steering import Steering

ARM_S = 2.0  # speed controllers need a second before it


@dataclass(frozen=True)
class Waypoint:
    """Where to go next."""

    x_m: float  # world frame
    y_m: float
    depth_m: float  # positive down
    heading_rad: float  # on the way there
    within_m: float = 0.25  # as close as this counts as there
    stay_s: float = 0.0  # how long to stay there: a vehicle that arrives sideways keeps drifting sideways


class WaypointPilot(Endpoint):
    """Answers each position fix with controls, and stays at the last waypoint of its route."""

    route: Sequence[Waypoint]

    def __init__(self, factory: EndpointFactory, parent: NodeApi, name: str) -> None:
        super().__init__(factory, parent, name)
        self.left = list(self.route)
        self.steering = Steering()
        self.seen_s: float | None = None
        self.there_since_s = 0.0
        self.number = 0

    @handles("position_fix")
    def on_position_fix(self, position_fix: dict[str, Any]) -> SomeTasks:
        """Steer to the next waypoint."""
        fix = PositionFix(**position_fix)
        x, y, z = fix.position_m
        goal = self.left[0]
        now_s = self.get_time_s()
        if math.dist((goal.x_m, goal.y_m, -goal.depth_m), (x, y, z)) > goal.within_m:
            self.there_since_s = now_s
        elif len(self.left) > 1 and now_s - self.there_since_s >= goal.stay_s:
            del self.left[0]
            goal = self.left[0]
        dt_s = 0.0 if self.seen_s is None else now_s - self.seen_s
        self.seen_s = now_s
        self.number += 1
        is_armed = now_s >= ARM_S
        surge = sway = 0.0
        if is_armed and dt_s > 0.0:
            surge, sway = self.steering.sticks((goal.x_m, goal.y_m), (x, y), fix.yaw_rad, dt_s)
        target: dict[str, Any] = {"depth_m": goal.depth_m, "heading_rad": goal.heading_rad}
        controls = Controls(self.number, "heading_hold", is_armed, surge=surge, sway=sway, **target)
        return self.store_data_task("controls", msgspec.structs.asdict(controls))
