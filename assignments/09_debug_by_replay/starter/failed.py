"""The code of the failed landing, as it flew. Three components, one after the other. Do not change this file.

page "radar" --> estimator --> page "estimate" --> planner --> page "plan" --> throttler --> page "engine"

    estimate  height_m, velocity_mps (up is positive): as they are now, since the radar reports them late
    plan      phase: fall, brake, sink or drop; target_speed_mps: how fast to go; slowing_mps2: how fast that changes
    engine    throttle, 0 to 1
"""

import math

from snr_sim import Endpoint, handles

GRAVITY_MPS2 = 1.62
THRUST_N = 45040.0  # of the engine at full throttle
EXHAUST_MPS = 3049.9  # thrust takes this many newtons from each kilogram a second

BRAKE_MPS2 = 3.5  # how hard it brakes; at full throttle it could do 3.7 even with the heaviest module
SINK_M, SINK_MPS = 25.0, 3.0  # where braking ends, and how fast the module then still is
LAST_MPS = 0.8  # how fast it comes in at the end
DROP_M, SLOW_MPS = 0.3, 2.8  # this low, and slower than this, the engine may go out
RESPONSE_S = 1.0  # in this time an error in velocity is to be taken out


class Estimator(Endpoint):
    """Says how high and how fast the module is now."""

    @handles("radar")
    def on_radar(self, radar):
        late_s = self.get_time_s() - radar["stamp_s"]
        velocity_mps = radar["velocity_mps"]
        height_m = radar["altitude_m"] - velocity_mps * late_s
        return self.store_data_task("estimate", {"height_m": height_m, "velocity_mps": velocity_mps})


class Planner(Endpoint):
    """Falls until it has to brake, brakes until it is low, sinks slowly, and drops at the end."""

    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.phase = "fall"

    @handles("estimate")
    def on_estimate(self, estimate):
        height_m, velocity_mps = estimate["height_m"], estimate["velocity_mps"]
        curve_mps = braking_mps(height_m)
        if self.phase == "fall" and velocity_mps < curve_mps + 2.0:  # the engine needs a moment
            self.phase = "brake"
        if self.phase == "brake" and height_m < SINK_M + 1.0:
            self.phase = "sink"
        if self.phase == "sink" and (height_m < DROP_M or velocity_mps > -SLOW_MPS):
            self.phase = "drop"
        plan = {"phase": self.phase, "target_speed_mps": 0.0, "slowing_mps2": 0.0}
        if self.phase == "brake":
            plan["target_speed_mps"] = curve_mps
            plan["slowing_mps2"] = BRAKE_MPS2
        elif self.phase == "sink":
            plan["target_speed_mps"] = -min(SINK_MPS, max(LAST_MPS, height_m / 5.0))
        return self.store_data_task("plan", plan)


def braking_mps(height_m):
    """Return the velocity from which steady braking ends at SINK_M, with SINK_MPS to go."""
    left_m = max(0.0, height_m - SINK_M)
    return -math.sqrt(SINK_MPS**2 + 2.0 * BRAKE_MPS2 * left_m)


class Throttler(Endpoint):
    """Finds the throttle that gives the wanted velocity, for a module that loses mass as it burns."""

    mass_kg: float

    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.before_s = 0.0
        self.throttle = 0.0

    @handles("plan")
    def on_plan(self, plan):
        now_s = self.get_time_s()
        self.mass_kg -= self.throttle * THRUST_N / EXHAUST_MPS * (now_s - self.before_s)
        self.before_s = now_s
        velocity_mps = self.get_data("estimate")["velocity_mps"]
        push_mps2 = (plan["target_speed_mps"] - velocity_mps) / RESPONSE_S + plan["slowing_mps2"]
        if plan["phase"] == "brake":
            push_mps2 += GRAVITY_MPS2
        throttle = self.mass_kg * push_mps2 / THRUST_N
        if plan["phase"] in ("fall", "drop"):
            throttle = 0.0
        self.throttle = min(1.0, max(0.0, throttle))
        return self.store_data_task("engine", {"throttle": self.throttle})


def factories(robot):
    return [Estimator.factory(), Planner.factory(), Throttler.factory(mass_kg=robot.parameters.mass_kg)]
