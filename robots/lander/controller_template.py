"""A controller for the lander: sets the throttle after each reading of the radar.

page "radar":  altitude_m, velocity_mps (up is positive), stamp_s
page "engine": throttle, 0 to 1; in lander_pad and lander_rough also gimbal_rad, and attitude (-1 to 1)
"""

from snr_sim import Endpoint, handles


class ControllerTemplate(Endpoint):
    hover = 0.28  # throttle that nearly carries the weight

    @handles("radar")
    def on_radar(self, radar):
        target_mps = -1.0 - 0.05 * radar["altitude_m"]
        throttle = self.hover + 0.1 * (target_mps - radar["velocity_mps"])
        return self.store_data_task("engine", {"throttle": min(max(throttle, 0.0), 1.0)})


def factories(robot):
    return [ControllerTemplate.factory()]
