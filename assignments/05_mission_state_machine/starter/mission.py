"""The pilot's mission at the surface: through all gates, one after the other.

pages "position_fix", "vehicle", "depth", "leak" --> what is known --.
page "panel" comes, 20 times a second -------------------------------+--> machine.py --> pages "controls", "mission"
"""

import math
from typing import Any

from machine import Machine
from snr_sim_robot_urov.steering import Steering

from snr_sim import Endpoint, handles

ROLES = ("topside",)  # the vehicle has a controller of its own
FIX_TIMEOUT_S = 0.5  # a place that is older than this is not where the vehicle is now
SURFACE_M = 0.2  # the depth to ask for on the way up


class Mission(Endpoint):
    route: list[Any]  # two places for each gate: one before it, to line up, and one behind it

    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.machine = Machine(gates=len(self.route) // 2)
        self.steering = Steering()
        self.sticks = 0.0, 0.0
        self.seen_s = None
        self.number = 0

    def goal(self):
        """Return the place to go to; None in a state that goes nowhere."""
        gate, state = self.machine.gate, self.machine.state
        if state == "lining_up":
            return self.route[2 * gate]
        if state == "passing":
            return self.route[2 * gate + 1]
        return None

    @handles("position_fix")
    def on_position_fix(self, fix):
        """Steers: a person who sees the vehicle would move the sticks like this. Do not change it."""
        goal, now_s = self.goal(), self.get_time_s()
        if goal is None or self.seen_s is None or now_s <= self.seen_s:
            self.sticks = 0.0, 0.0
        else:
            at, dt_s = fix["position_m"], now_s - self.seen_s
            self.sticks = self.steering.sticks((goal.x_m, goal.y_m), at, fix["yaw_rad"], dt_s)
        self.seen_s = now_s

    @handles("panel")
    def on_panel(self, panel):
        """Runs the machine, then stores its state. Do not change this function."""
        before = self.machine.state
        self.machine.step(self.known(panel))
        machine = self.machine
        if machine.state != before:
            print(f"{self.get_time_s():6.2f} s  {before} -> {machine.state}, gate {machine.gate}")
            self.steering.reset()
            self.sticks = 0.0, 0.0
        status = {"state": machine.state, "gate": machine.gate, "since_s": machine.since_s}
        return [self.store_data_task("controls", self.controls()), self.store_data_task("mission", status)]

    def known(self, panel):
        """Return the inputs of the machine. Do not change this function."""
        vehicle, leak, depth = self.get_data("vehicle"), self.get_data("leak"), self.get_data("depth")
        return {
            "now_s": self.get_time_s(),
            "stop": panel["stop"],  # the button is down
            "reset": panel["reset"],
            "is_ready": vehicle is not None and not vehicle["is_stopped"],  # the vehicle is there, and keeps no stop
            "is_wet": leak is not None and leak["is_wet"],
            "has_fix": self.get_data("position_fix") is not None and self.get_age_s("position_fix") <= FIX_TIMEOUT_S,
            "distance_m": self.distance_m(),  # how far it is to the goal; infinite if there is none
            "depth_m": 99.0 if depth is None else depth["depth_m"],
        }

    def distance_m(self):
        goal, fix = self.goal(), self.get_data("position_fix")
        if goal is None or fix is None:
            return math.inf
        return math.dist((goal.x_m, goal.y_m, -goal.depth_m), fix["position_m"])

    def controls(self):
        """Return what the vehicle is asked for, 20 times a second: see the table in the README."""
        self.number += 1
        controls = {"number": self.number, "mode": "heading_hold", "is_armed": False, "is_stop": False}
        controls |= {"clears_stop": False, "surge": 0.0, "sway": 0.0, "depth_m": None, "heading_rad": None}
        goal = self.goal()
        if goal is not None:
            controls["is_armed"] = True
            controls["surge"], controls["sway"] = self.sticks
            controls["depth_m"], controls["heading_rad"] = goal.depth_m, goal.heading_rad
        # Step 3: what do "waiting", "holding", "surfacing" and "stopped" ask for?
        return controls


def factories(robot):
    return [Mission.factory(route=robot.parameters.route)]
