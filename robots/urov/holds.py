"""From controls and sensors to the wrench that the thrusters should give: sticks, and what each mode holds.

mode          sticks push          is held
manual        surge sway heave yaw nothing
stabilise     surge sway heave yaw level: roll and pitch are 0, and the yaw stick gives a rate
depth_hold    surge sway, heave moves the depth that is held
heading_hold  surge sway, and yaw moves the heading that is held
"""

from __future__ import annotations

import math

from snr_sim.scenario import wrap_rad
from snr_sim.signals import DepthReading, ImuReading
from snr_sim.std_mods import Pid, approach

from .controls import MODES, Controls
from .parameters import Gains, HoldParameters


class HoldController:
    """Setpoints of depth and heading, and their controllers. Axes that thrusters cannot push are not controlled.

    The vehicle's `drag` is that in heave, linear [N s/m] and quadratic [N s2/m2].
    """

    def __init__(self, numbers: HoldParameters, drag: tuple[float, float], unactuated: tuple[str, ...] = ()) -> None:
        self.numbers = numbers
        self._depth = _pid(numbers.depth, derivative_filter_s=0.15)
        self._heading = _pid(numbers.heading, is_angle=True)
        self._roll = _pid(numbers.level, is_angle=True)
        self._pitch = _pid(numbers.level, is_angle=True)
        self._drag = drag
        self._unactuated = unactuated
        self.reset()

    def reset(self) -> None:
        """Drop the setpoints; the next ones are the depth and heading then."""
        self.depth_m: float | None = None
        self.heading_rad: float | None = None
        self._target_depth_m: float | None = None
        self._target_heading_rad = 0.0
        self._depth_rate = 0.0
        self._seen: DepthReading | None = None
        for pid in (self._depth, self._heading, self._roll, self._pitch):
            pid.reset()

    def wrench(self, controls: Controls, depth: DepthReading, imu: ImuReading, dt_s: float) -> list[float]:
        """Return force [N] and moment [N m], body frame, for now."""
        level = MODES.index(controls.mode)
        surge_n, sway_n, heave_n = self.numbers.sticks_n
        wrench = [surge_n * controls.surge, sway_n * controls.sway, 0.0, 0.0, 0.0, 0.0]
        if level >= MODES.index("stabilise"):
            wrench[3] = self._levelled(self._roll, "roll", imu.roll_rad, imu.rate_radps[0], dt_s)
            wrench[4] = self._levelled(self._pitch, "pitch", imu.pitch_rad, imu.rate_radps[1], dt_s)
        if level >= MODES.index("depth_hold"):
            up_n = self._hold_depth(controls, depth, dt_s)
        else:
            up_n, self.depth_m, self._target_depth_m = heave_n * controls.heave, None, None
            if level == 0:
                wrench[2] = up_n
                up_n = 0.0
        if level >= MODES.index("heading_hold"):
            wrench[5] = self._hold_heading(controls, imu, dt_s)
        else:
            self.heading_rad = None
            wrench[5] = self.numbers.yaw_nm * controls.yaw
            if level >= MODES.index("stabilise"):
                wrench[5] -= self.numbers.heading.kd * imu.rate_radps[2]
        # Up is up, however the vehicle is tilted.
        wrench[0] -= up_n * math.sin(imu.pitch_rad)
        wrench[1] += up_n * math.cos(imu.pitch_rad) * math.sin(imu.roll_rad)
        wrench[2] += up_n * math.cos(imu.pitch_rad) * math.cos(imu.roll_rad)
        return wrench

    def _levelled(self, pid: Pid, axis: str, angle_rad: float, rate_radps: float, dt_s: float) -> float:
        return 0.0 if axis in self._unactuated else pid.update(0.0, angle_rad, dt_s, rate=rate_radps)

    def _hold_depth(self, controls: Controls, depth: DepthReading, dt_s: float) -> float:
        """Return the upward force."""
        if self.depth_m is None or self._target_depth_m is None:
            self.depth_m = self._target_depth_m = max(0.0, depth.depth_m)
            self._depth.reset()
        if controls.depth_m is not None:
            self._target_depth_m = controls.depth_m
        numbers = self.numbers
        if controls.heave:
            self._target_depth_m = self._moved(self._target_depth_m, controls.heave, depth.depth_m, dt_s)
        move_m = approach(self._target_depth_m - self.depth_m, numbers.sink_mps, numbers.brake_mps2, dt_s)
        self.depth_m += move_m
        # What moving costs is known: the drag at that speed. So it has not to be learnt by being late.
        sink_mps = move_m / dt_s
        drag_n = (self._drag[0] + self._drag[1] * abs(sink_mps)) * sink_mps
        rate = self._rate(depth) - sink_mps
        return -self._depth.update(self.depth_m, depth.depth_m, dt_s, rate=rate, feed_forward=drag_n)

    def _moved(self, target_m: float, heave: float, depth_m: float, dt_s: float) -> float:
        """Return the target depth that the stick moves a depth to: not beyond what a vehicle on the floor can follow.

        Else a stick that was held down there for long would have to be held up for as long.
        """
        numbers = self.numbers
        moved_m = max(0.0, target_m - heave * numbers.sink_mps * dt_s)
        if moved_m > target_m:
            return max(target_m, min(moved_m, depth_m + numbers.max_lead_m))
        return min(target_m, max(moved_m, depth_m - numbers.max_lead_m))

    def _rate(self, depth: DepthReading) -> float:
        """Compute the rate once for each reading: the depth has a lower rate than control."""
        seen = self._seen
        if seen is None or depth.stamp_s > seen.stamp_s:
            if seen is not None:
                period_s = depth.stamp_s - seen.stamp_s
                newest = (depth.depth_m - seen.depth_m) / period_s
                self._depth_rate += (
                    (newest - self._depth_rate) * period_s / (self._depth.derivative_filter_s + period_s)
                )
            self._seen = depth
        return self._depth_rate

    def _hold_heading(self, controls: Controls, imu: ImuReading, dt_s: float) -> float:
        numbers = self.numbers
        if self.heading_rad is None:
            self.heading_rad = self._target_heading_rad = imu.yaw_rad
            self._heading.reset()
        if controls.heading_rad is not None:
            self._target_heading_rad = controls.heading_rad
        self._target_heading_rad = wrap_rad(self._target_heading_rad + controls.yaw * numbers.turn_radps * dt_s)
        turn = approach(
            wrap_rad(self._target_heading_rad - self.heading_rad), numbers.turn_radps, numbers.brake_radps2, dt_s
        )
        self.heading_rad = wrap_rad(self.heading_rad + turn)
        return self._heading.update(self.heading_rad, imu.yaw_rad, dt_s, rate=imu.rate_radps[2] - turn / dt_s)


def _pid(gains: Gains, derivative_filter_s: float = 0.0, is_angle: bool = False) -> Pid:
    return Pid(gains.kp, gains.ki, gains.kd, (-gains.output_limit, gains.output_limit), derivative_filter_s, is_angle)
