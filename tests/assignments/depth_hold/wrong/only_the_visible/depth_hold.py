"""Goes to 3 m, whatever the pilot asks for."""

from telling import told
from thruster import NEWTONS_PER_KGF, STOP_US, pulse_us

from snr_sim import Endpoint, EndpointFactory, TaskType

KP_NPM = 80.0
MOST_N = 80.0

VERTICAL = {4: +1, 5: -1, 6: -1, 7: +1}


def factories(robot):
    return [DepthHoldFactory()]


class DepthHoldFactory(EndpointFactory):
    def get(self, parent):
        return DepthHold(self, parent, "depth_hold")


class DepthHold(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.goal_m = None
        self.task_handlers = {(TaskType.process_data, "imu"): self.on_tick}

    def on_tick(self, task, task_id):
        controls = self.get_data("controls")
        depth = self.get_data("depth")
        is_armed = controls is not None and controls["is_armed"]
        pulses = [STOP_US] * 8
        if controls is not None and controls["depth_m"] is not None:
            self.goal_m = controls["depth_m"]
        if is_armed and depth is not None and self.goal_m is not None:
            pulses = pulses_us(up_force_n(depth["depth_m"], self.goal_m))
        vehicle = told(controls, self.goal_m, False, self.get_data("imu"))
        return [
            self.store_data_task("pwm", {"pulses_us": pulses, "is_armed": is_armed}, process=False),
            self.store_data_task("vehicle", vehicle),
        ]


def up_force_n(depth_m, goal_m):
    error_m = depth_m - 3.0
    return max(-MOST_N, min(MOST_N, KP_NPM * error_m))


def pulses_us(up_n):
    pulses = [STOP_US] * 8
    for channel, sign in VERTICAL.items():
        pulses[channel] = pulse_us(sign * up_n / len(VERTICAL) / NEWTONS_PER_KGF)
    return pulses
