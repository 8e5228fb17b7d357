"""Finds the plate by position: from the vehicle's position fix, and the plate's known position 0, 0. For comparison.

page "position_fix" --> where in the picture the plate would be --> page "target" --> steer.py
"""

import math

from steer import SteerFactory

from snr_sim import Endpoint, handles

PLATE_DEPTH_M = 3.9
PIXEL = 2.0 * math.tan(math.radians(40.0)) / 64.0  # how wide a pixel is, 1 m away


class ByPosition(Endpoint):
    @handles("position_fix")
    def on_position_fix(self, fix):
        target = {"mode": "stop", "right_px": 0.0, "down_px": 0.0, "stamp_s": fix["stamp_s"]}
        if self.get_time_s() - fix["stamp_s"] < 1.0:
            x, y, z = fix["position_m"]
            cos, sin = math.cos(fix["yaw_rad"]), math.sin(fix["yaw_rad"])
            ahead_m, left_m = -(cos * x + sin * y), -(-sin * x + cos * y)
            above_m = z + PLATE_DEPTH_M
            target["mode"] = "track"
            target["right_px"] = -left_m / above_m / PIXEL
            target["down_px"] = -ahead_m / above_m / PIXEL
        return self.store_data_task("target", target)


def factories(robot):
    return [ByPosition.factory(), SteerFactory(robot.parameters)]
