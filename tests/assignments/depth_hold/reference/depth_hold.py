"""A solution."""

from telling import vehicle_status
from thruster import NEWTONS_PER_KGF, STOP_US, pulse_us

from snr_sim import Endpoint, handles

KP_NPM = 80.0
MAX_FORCE_N = 80.0

VERTICAL = {4: +1, 5: -1, 6: -1, 7: +1}


def factories(robot):
    return [DepthHold.factory()]


class DepthHold(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.goal_m = None

    @handles("imu")
    def on_tick(self, imu):
        controls = self.get_data("controls")
        depth = self.get_data("depth")
        is_armed = controls is not None and controls["is_armed"]
        pulses = [STOP_US] * 8
        if controls is not None and controls["depth_m"] is not None:
            self.goal_m = controls["depth_m"]
        if is_armed and depth is not None and self.goal_m is not None:
            pulses = pulses_us(up_force_n(depth["depth_m"], self.goal_m))
        vehicle = vehicle_status(controls, self.goal_m, False, imu)
        return [
            self.store_data_task("pwm", {"pulses_us": pulses, "is_armed": is_armed}, process=False),
            self.store_data_task("vehicle", vehicle),
        ]


def up_force_n(depth_m, goal_m):
    error_m = depth_m - goal_m  # too deep: up
    return max(-MAX_FORCE_N, min(MAX_FORCE_N, KP_NPM * error_m))


def pulses_us(up_n):
    pulses = [STOP_US] * 8
    for channel, sign in VERTICAL.items():
        pulses[channel] = pulse_us(sign * up_n / len(VERTICAL) / NEWTONS_PER_KGF)
    return pulses
