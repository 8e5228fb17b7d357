"""Lands by page "smooth", which you make: comes down at a walk and shuts the engine off near the ground.

Needs no change of yours.
"""

from snr_sim import Endpoint, EndpointFactory, TaskType

OFF_M = 2.0  # the engine is shut off at this height, for good
WALK_MPS = 1.5


class PilotFactory(EndpointFactory):
    def get(self, parent):
        return Pilot(self, parent, "pilot")


class Pilot(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.is_down = False
        self.task_handlers = {(TaskType.process_data, "smooth"): self.on_smooth}

    def on_smooth(self, task, task_id):
        smooth = self.get_data("smooth")
        if smooth["altitude_m"] < OFF_M:
            self.is_down = True  # one page that says so is enough: the engine does not start again
        wanted_mps = -WALK_MPS - 0.08 * max(0.0, smooth["altitude_m"] - 10.0)
        throttle = 0.27 + 0.15 * (wanted_mps - smooth["velocity_mps"])
        if self.is_down:
            throttle = 0.0
        return self.store_data_task("engine", {"throttle": min(1.0, max(0.0, throttle))})
