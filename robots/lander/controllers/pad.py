"""Lands on the pad: one law for vertical and one for sideways acceleration; the module tilts accordingly.

    inertial, radar --> target acceleration [x, z] --> tilt and throttle
                                    attitude, rate --> jets

The engine pushes along the module only. So going sideways means tilting first, and attitude is the inner, quicker loop.
"""

from __future__ import annotations

import math
from typing import Any

from snr_sim_robot_lander.parameters import LanderParameters

from snr_sim import Endpoint, EndpointFactory, SomeTasks, handles
from snr_sim.plants.lander.module_shapes import PADS_BELOW_M
from snr_sim.scenario import NodeApi, RobotInfo
from snr_sim.signals import EngineCommand, InertialReading, RadarReading

# Down: sink so fast that this deceleration stops the fall at the last metres, and those slowly.
BRAKE_MPS2 = 1.1  # 60 % of thrust gives 2: the rest is for tilting, lag and noise
FASTEST_MPS = 14.0
LAST_M, LAST_MPS = 2.5, 0.9
SINK_RESPONSE_S = 0.8
# Across: a spring and a damper to the middle of the pad, in 1/s^2 and 1/s.
ACROSS_SPRING, ACROSS_DAMPER = 0.030, 0.33
# Wait here until above the pad and slow enough; errors within the gear's limits are not corrected.
GATE_M, GATE_X_M, GATE_MPS = 9.0, 8.0, 0.8
STEEPEST = 0.3  # come in over this slope to the gate: there are hills
TILT_HIGH_RAD, TILT_LOW_RAD = math.radians(22.0), math.radians(4.0)  # from afar, and under the gate
# Attitude: spring and damper of the jets, in 1/s^2 and 1/s; damped a little more than critically.
TURN_SPRING, TURN_DAMPER = 1.6, 2.4


def factories(robot: RobotInfo) -> list[EndpointFactory]:
    """Return what makes the controller's components."""
    return [Pad.factory(parameters=robot.parameters)]


class Pad(Endpoint):
    """Answers every inertial reading with throttle and jets; the radar's page of the same moment is there already."""

    parameters: LanderParameters

    def __init__(self, factory: EndpointFactory, parent: NodeApi, name: str) -> None:
        super().__init__(factory, parent, name)
        self.law = PadLaw(self.parameters)

    @handles("inertial")
    def on_inertial(self, inertial: dict[str, Any]) -> SomeTasks:
        """Pass both readings to the law, and its command to the engine."""
        radar = RadarReading(**self.get_data("radar"))
        command = self.law.update(radar, InertialReading(**inertial), self.get_time_s())
        return self.store_data_task("engine", {"throttle": command.throttle, "attitude": command.attitude})


class PadLaw:
    """Goes to the pad and sinks, upright, onto it."""

    def __init__(self, parameters: LanderParameters) -> None:
        self.module = parameters.module
        self.dry_mass_kg = parameters.mass_kg - parameters.fuel_kg
        self.is_down = False
        self.is_through_gate = False

    def update(self, radar: RadarReading, inertial: InertialReading, now_s: float) -> EngineCommand:
        """Return throttle and jets for now."""
        if self.is_down or any(inertial.contact):
            self.is_down = True  # and stays: an engine that starts again on a bounce turns the module over
            return EngineCommand()
        age_s = now_s - inertial.stamp_s
        (x, _), (vx, vz) = inertial.position_m, inertial.velocity_mps
        # Over a hill the radar's height counts, over a hollow that over the pad.
        height = min(radar.altitude_m, inertial.position_m[1] - PADS_BELOW_M) + vz * age_s
        mass = self.dry_mass_kg + inertial.fuel_kg
        rate = inertial.rate_radps
        attitude = inertial.attitude_rad + rate * age_s

        up = self.module.gravity_mps2 + (self.target_sink_rate(x + vx * age_s, vx, height) - vz) / SINK_RESPONSE_S
        tilt = self.target_tilt(x + vx * age_s, vx, height, max(up, 0.8))
        jets = TURN_SPRING * (tilt - attitude) - TURN_DAMPER * rate
        inertia = mass * self.module.gyration_m**2
        throttle = mass * max(0.0, up) / (math.cos(attitude) * self.module.thrust_n)
        return EngineCommand(
            throttle=min(self.module.throttle.highest, throttle),
            attitude=min(1.0, max(-1.0, jets * inertia / self.module.jets_nm)),
        )

    def target_sink_rate(self, x_m: float, vx_mps: float, height_m: float) -> float:
        """Return the target vertical velocity at a height [m/s, up positive]."""
        if not self.is_through_gate and height_m < GATE_M + 1.0:
            self.is_through_gate = abs(x_m) < GATE_X_M and abs(vx_mps) < GATE_MPS
        floor = LAST_M if self.is_through_gate else GATE_M + STEEPEST * max(0.0, abs(x_m) - GATE_X_M)
        left = height_m - floor
        slow = LAST_MPS if self.is_through_gate else 0.0
        if left <= 0.0:
            return -slow if self.is_through_gate else -0.5 * left
        return -min(FASTEST_MPS, slow + math.sqrt(2.0 * BRAKE_MPS2 * left + 1.0) - 1.0)

    def target_tilt(self, x_m: float, vx_mps: float, height_m: float, up_mps2: float) -> float:
        """Return the attitude that, at an upward push, gives the required sideways one [rad]."""
        spring = 0.0 if self.is_through_gate else ACROSS_SPRING
        across = -spring * x_m - ACROSS_DAMPER * vx_mps
        max_tilt = TILT_LOW_RAD if self.is_through_gate else TILT_HIGH_RAD
        if self.is_through_gate and height_m < LAST_M:
            max_tilt *= 0.5
        return min(max_tilt, max(-max_tilt, math.atan2(-across, up_mps2)))
