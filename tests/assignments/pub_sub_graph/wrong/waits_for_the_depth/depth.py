"""Waits for the task process_data of page "depth", which the vehicle's sensor does not send."""

from laws import Rate, lift_force_n

from snr_sim import Endpoint, EndpointFactory, TaskType


def factories(robot):
    return [DepthFactory()]


class DepthFactory(EndpointFactory):
    def get(self, parent):
        return Depth(self, parent, "depth_hold")


class Depth(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.wanted_m = None
        self.is_armed = False
        self.rate_mps = 0.0
        self.rate = Rate()
        self.task_handlers = {
            (TaskType.process_data, "imu"): self.on_imu,
            (TaskType.process_data, "depth"): self.on_depth,
            (TaskType.process_data, "controls"): self.on_controls,
        }

    def on_controls(self, task, task_id):
        controls = self.get_data("controls")
        self.is_armed = controls["is_armed"]
        if not self.is_armed:
            self.wanted_m = None
        elif controls["depth_m"] is not None:
            self.wanted_m = controls["depth_m"]

    def on_depth(self, task, task_id):
        depth = self.get_data("depth")
        self.rate_mps = self.rate.update(depth["depth_m"], depth["stamp_s"])

    def on_imu(self, task, task_id):
        imu, depth = self.get_data("imu"), self.get_data("depth")
        if depth is None:
            return None
        force_n = 0.0
        if self.is_armed:
            if self.wanted_m is None:
                self.wanted_m = depth["depth_m"]
            force_n = lift_force_n(self.wanted_m, depth["depth_m"], self.rate_mps)
        return self.store_data_task("lift", {"stamp_s": imu["stamp_s"], "force_n": force_n})
