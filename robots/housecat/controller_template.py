"""A controller for Housecat: drives to the east with the blade down, and stops at the edge of the pit.

page "pose":   position_m [x, y], heading_rad (0 to the east, positive to the left), stamp_s
page "mono":   rgb (36 x 48 pixels), field_of_view_rad, stamp_s
page "stereo": left, right (32 x 96 pixels each), baseline_m, field_of_view_rad, stamp_s
page "dozer":  left_mps, right_mps (up to 0.3), blade (0 up, 1 down)
"""

from snr_sim import Endpoint, handles


class ControllerTemplate(Endpoint):
    stop_m = 0.9  # the blade is 0.3 m in front of the position, and the edge of the pit at 1.2 m

    @handles("pose")
    def on_pose(self, pose):
        x_m, y_m = pose["position_m"]
        if x_m >= self.stop_m:
            return self.store_data_task("dozer", {"left_mps": 0.0, "right_mps": 0.0, "blade": 1.0})
        turn_mps = -0.1 * (pose["heading_rad"] + y_m)  # back to the middle
        return self.store_data_task("dozer", {"left_mps": 0.15 - turn_mps, "right_mps": 0.15 + turn_mps, "blade": 1.0})


def factories(robot):
    return [ControllerTemplate.factory()]
