"""Finds the plate by position: the vehicle is told where it is, and the plate is known to be at 0, 0. For comparison.

page "place" --> where in the picture the plate would be --> page "target" --> steer.py
"""

import math

from steer import SteerFactory

from snr_sim import Endpoint, EndpointFactory, TaskType

PLATE_DEPTH_M = 3.9
PIXEL = 2.0 * math.tan(math.radians(40.0)) / 64.0  # how wide a pixel is, 1 m away


def factories(robot):
    return [ByPositionFactory(), SteerFactory(robot.parameters)]


class ByPositionFactory(EndpointFactory):
    def get(self, parent):
        return ByPosition(self, parent, "by_position")


class ByPosition(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.task_handlers = {(TaskType.process_data, "place"): self.on_place}

    def on_place(self, task, task_id):
        place = self.get_data("place")
        target = {"mode": "stop", "right_px": 0.0, "down_px": 0.0, "stamp_s": place["stamp_s"]}
        if self.get_time_s() - place["stamp_s"] < 1.0:
            x, y, z = place["position_m"]
            cos, sin = math.cos(place["yaw_rad"]), math.sin(place["yaw_rad"])
            ahead_m, left_m = -(cos * x + sin * y), -(-sin * x + cos * y)
            above_m = z + PLATE_DEPTH_M
            target["mode"] = "track"
            target["right_px"] = -left_m / above_m / PIXEL
            target["down_px"] = -ahead_m / above_m / PIXEL
        return self.store_data_task("target", target)
