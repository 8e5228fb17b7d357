"""Lands by page "smooth", which you make: comes down at a walk and shuts the engine off near the ground.

Do not change it.
"""

from snr_sim import Endpoint, handles

OFF_M = 2.0  # the engine is shut off at this height, for good
WALK_MPS = 1.5


class Pilot(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.is_down = False

    @handles("smooth")
    def on_smooth(self, smooth):
        if smooth["altitude_m"] < OFF_M:
            self.is_down = True  # one such page is enough: the engine does not start again
        target_speed_mps = -WALK_MPS - 0.08 * max(0.0, smooth["altitude_m"] - 10.0)
        throttle = 0.27 + 0.15 * (target_speed_mps - smooth["velocity_mps"])
        if self.is_down:
            throttle = 0.0
        return self.store_data_task("engine", {"throttle": min(1.0, max(0.0, throttle))})
