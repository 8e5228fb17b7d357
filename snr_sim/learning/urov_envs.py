"""The underwater vehicle's two environments: go to a depth and stay there, and hold a position in a current."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from snr_sim.learning.gym import box, spaces
from snr_sim.learning.scenario_env import ScenarioEnv
from snr_sim.plants.urov.t200 import curve
from snr_sim.prelude.angles import wrap_rad
from snr_sim.prelude.device import LEASE_S
from snr_sim.prelude.scenario import Verdict
from snr_sim.prelude.sums import ordered_sum
from snr_sim.std_mods.allocation import Allocation
from snr_sim.std_mods.thrust_curve import ThrustCurve

EFFORT_WEIGHT = 0.05  # for full thrust all the time, relative to 1 for each metre of position error
SMOOTHING_S = 0.15  # of speeds that are computed from positions, as in the vehicle's own depth hold
FLOOR_M = 6.0


class Rate:
    """How fast a measured quantity changes: the difference of its last two readings, smoothed.

    Args:
        smoothing_s: time constant.

    >>> rate = Rate(smoothing_s=0.0)
    >>> rate.update(1.0, stamp_s=0.0), rate.update(1.5, stamp_s=0.5), rate.update(1.5, stamp_s=0.5)
    (0.0, 1.0, 1.0)
    """

    def __init__(self, smoothing_s: float = SMOOTHING_S) -> None:
        self._smoothing_s = smoothing_s
        self._before: tuple[float, float] | None = None
        self._rate = 0.0

    def update(self, value: float, stamp_s: float) -> float:
        """Use a reading, unless it has been used, and return the rate [per second]."""
        if self._before is None:
            self._before = value, stamp_s
        elif stamp_s > self._before[1]:
            period_s = stamp_s - self._before[1]
            newest = (value - self._before[0]) / period_s
            self._rate += (newest - self._rate) * period_s / (self._smoothing_s + period_s)
            self._before = value, stamp_s
        return self._rate


class UrovEnv(ScenarioEnv):
    """Base of both environments: the agent commands a wrench, thrusts are allocated as on board, error is the cost.

    An action holds fractions of a full stick, -1 to 1, of the axes that the environment names. They become a wrench in
    the vehicle's frame, thrusts (`std_mods/allocation.py`), and pulses, which pass through the vehicle's own outputs;
    so thrusters have their lag and their dead band, and the battery its sag. Pulses are sent once per step: there is no
    slew limit, and only the vehicle's own buoyancy levels it.

    The first observation is two seconds after the start of the scenario, when speed controllers are armed. There is no
    early end: an episode is truncated when the scenario gives its verdict, which `info` then holds (`outcome`,
    `success`, `reason`). The reward of a step is less than or equal to 0: minus the true distance from the target [m],
    each metre counting 1 and at most three, and minus 0.05 times the mean square of the action.
    """

    rate_hz: float = 10.0
    begins_s: float = 2.0
    ends_by_clock = True
    AXES: tuple[int, ...]  # of the wrench: 0 surge, 1 sway, 2 heave, 5 yaw

    def __init__(self, scenario: str, engine: str | None, render_mode: str | None, sensed: list[float]) -> None:
        super().__init__(scenario, engine, render_mode)
        self.action_space: spaces.Space[Any] = box([-1.0] * len(self.AXES), [1.0] * len(self.AXES))
        self.observation_space: spaces.Space[Any] = box([-one for one in sensed], sensed)

    def begin(self) -> None:
        """Hold thrusters still until they are armed."""
        parameters: Any = self.run.robot.parameters
        self._thruster = ThrustCurve(*curve(parameters.nominal_v)[:2])
        matrix = parameters.vehicle.thruster_matrix()
        self._allocation = Allocation(matrix, self._thruster.limits_n, priority_axes=parameters.priority_axes)
        limits = [*parameters.holds.sticks_n, 0.0, 0.0, parameters.holds.yaw_nm]
        self._limits = [limits[axis] for axis in self.AXES]
        self._effort = 0.0
        self._sink = Rate()
        self._write([0.0] * 6)

    def act(self, action: NDArray[np.float32]) -> None:
        """Push."""
        shares = [float(one) for one in action]
        self._effort = ordered_sum(one * one for one in shares) / len(shares)
        wrench = [0.0] * 6
        for axis, share, limit in zip(self.AXES, shares, self._limits, strict=True):
            wrench[axis] = share * limit
        self._write(wrench)

    def reward(self, verdict: Verdict | None) -> float:
        """Return what the last step was worth."""
        return -min(3.0, self.error_m()) - EFFORT_WEIGHT * self._effort

    def error_m(self) -> float:
        """Return how far from where it should be the vehicle truly is [m]."""
        raise NotImplementedError(f"{type(self).__name__} needs a method error_m(self)")

    def sink_mps(self) -> float:
        """Return how fast the measured depth grows [m/s]."""
        depth = self.sensors["depth"].read()
        return self._sink.update(depth.depth_m, depth.stamp_s)

    def _write(self, wrench: list[float]) -> None:
        thrusts, _, _ = self._allocation.allocate(wrench)
        pulses_us = [self._thruster.pulse_us(thrust) for thrust in thrusts]
        self.actuators["pwm"].write_us(pulses_us, self.plant.time_s, LEASE_S)


class UrovDepthHold(UrovEnv):
    """Scenario urov_depth_hold: at 1 m, then to 3 m, and stay when the payload is released. 10 steps a second; 38 s.

    Observation, Box(6), float32: what the sensors read.
        0  down_m     to the target depth, positive down [m], -6 to 6
        1  depth_m    [m], -6 to 6
        2  sink_mps   computed from depth, positive down [m/s], -3 to 3
        3  roll_rad   [rad], -pi to pi
        4  pitch_rad  [rad], -pi to pi
        5  supply_v   of the battery [V], -20 to 20

    Action, Box(1): heave, -1 (down) to 1 (up).

    Args:
        engine: 'mujoco', or 'pymunk' for the vehicle in the plane.
        render_mode: None or 'rgb_array'.
    """

    AXES: tuple[int, ...] = (2,)

    def __init__(self, engine: str | None = None, render_mode: str | None = None) -> None:
        limits = [FLOOR_M, FLOOR_M, 3.0, math.pi, math.pi, 20.0]
        super().__init__("urov_depth_hold", engine, render_mode, limits)

    @property
    def target_m(self) -> float:
        """The depth that the scenario's pilot asks for at this moment, as depth [m]."""
        script = self.run.robot.parameters.script
        asked = [cue.changes["depth_m"] for cue in script if cue.at_s <= self.plant.time_s + 1e-9]
        return float(asked[-1])

    def observe(self) -> list[float]:
        """Return what the sensors read."""
        depth, imu, power = (self.sensors[name].read() for name in ("depth", "imu", "power"))
        return [
            self.target_m - depth.depth_m,
            depth.depth_m,
            self.sink_mps(),
            imu.roll_rad,
            imu.pitch_rad,
            power.voltage_v,
        ]

    def error_m(self) -> float:
        """Return the error of the true depth [m]."""
        plant: Any = self.plant
        return abs(self.target_m + float(plant.position_m[2]))


class UrovStation(UrovEnv):
    """Scenario urov_station_keeping: hold a position that is seen from above, also when a current begins. 10 steps a
    second; 40 s.

    Observation, Box(11), float32: what the vehicle's sensors read, and where a person above sees it, 0.2 s late.
        0  ahead_m      the target, ahead of the vehicle [m], -15 to 15
        1  left_m       and to its left [m], -15 to 15
        2  down_m       and below it [m], -6 to 6
        3  turn_rad     to the heading it had at first, positive to the left [rad], -pi to pi
        4  ahead_mps    speed ahead, computed from the seen position [m/s], -3 to 3
        5  left_mps     and to its left [m/s], -3 to 3
        6  sink_mps     computed from depth, positive down [m/s], -3 to 3
        7  yaw_radps    [rad/s], -10 to 10
        8  roll_rad     [rad], -pi to pi
        9  pitch_rad    [rad], -pi to pi
        10 supply_v     of the battery [V], -20 to 20

    Action, Box(4): surge, sway, heave and yaw, each -1 to 1; ahead, left, up and left are positive.

    Args:
        render_mode: None or 'rgb_array'.
    """

    AXES: tuple[int, ...] = (0, 1, 2, 5)

    def __init__(self, render_mode: str | None = None) -> None:
        limits = [15.0, 15.0, FLOOR_M, math.pi, 3.0, 3.0, 3.0, 10.0, math.pi, math.pi, 20.0]
        super().__init__("urov_station_keeping", None, render_mode, limits)

    def begin(self) -> None:
        """Store the target position."""
        super().begin()
        self._target = self.run.robot.parameters.route[-1]
        self._rates = Rate(), Rate()

    def observe(self) -> list[float]:
        """Return what the sensors read."""
        depth, imu, power, seen = (self.sensors[name].read() for name in ("depth", "imu", "power", "position_fix"))
        x_m, y_m, _ = seen.position_m
        ahead_m, left_m = _in_frame(self._target.x_m - x_m, self._target.y_m - y_m, imu.yaw_rad)
        x_mps, y_mps = (rate.update(at, seen.stamp_s) for rate, at in zip(self._rates, (x_m, y_m), strict=True))
        ahead_mps, left_mps = _in_frame(x_mps, y_mps, imu.yaw_rad)
        turn_rad = wrap_rad(self._target.heading_rad - imu.yaw_rad)
        motion = [ahead_mps, left_mps, self.sink_mps(), imu.rate_radps[2]]
        down_m = self._target.depth_m - depth.depth_m
        return [ahead_m, left_m, down_m, turn_rad, *motion, imu.roll_rad, imu.pitch_rad, power.voltage_v]

    def error_m(self) -> float:
        """Return the true distance from the target [m]."""
        plant: Any = self.plant
        x_m, y_m, z_m = (float(one) for one in plant.position_m)
        return math.dist((x_m, y_m, -z_m), (self._target.x_m, self._target.y_m, self._target.depth_m))


def _in_frame(x: float, y: float, yaw_rad: float) -> tuple[float, float]:
    """Return a horizontal vector of the world as ahead and left of a vehicle."""
    cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
    return cos * x + sin * y, cos * y - sin * x
