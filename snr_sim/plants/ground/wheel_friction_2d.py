"""Wheels with motors on a floor, seen from above: speeds of the body and rates of the wheels after a step.

A wheel whose contact slides with a speed s feels -friction * load * s / |s|; its motor adds a torque that falls with
its rate. Both are stiff: a wheel that rolls changes its force by all it has within a millimetre per second. So both are
taken at the end of the step, linear in the speeds there, with the slope from the origin to the last known point:

    force_i  = -c_i (speed of the body there - radius rate_i),       c_i = friction load / sqrt(s_i^2 + REST_MPS^2)
    torque_i = line_i(rate_i) - d_i rate_i,                          d_i = dry friction / sqrt(rate_i^2 + REST_RADPS^2)

Each rate is eliminated, which leaves three equations for the speeds of the body. Such a step is stable however stiff
the slopes are. The last known point is that before the step, and if the step leads far from it, that of a pass before.

Source: implicit Euler with secant slopes, as for regularised Coulomb friction in any text on multibody dynamics.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt

from snr_sim.plants.ground.dc_motor import Drive
from snr_sim.plants.ground.rover_arms import wheel_inertia_kgm2
from snr_sim.plants.ground.rover_loads import RoverLoads
from snr_sim.plants.ground.rover_vehicle import OWN_MOTOR, RoverVehicle
from snr_sim.plants.ground.wall_contacts import Speeds

REST_MPS = 1e-3  # below this a contact counts as at rest
REST_RADPS = 1e-3
# Share by which a slope may be off, at the end of each pass: one pass if nothing changes, two if a little does. A wheel
# that is locked at once needs four.
NEAR = (0.002, 0.02, 0.02, 0.02, 0.02, 0.02)


Line = tuple[float, float, float]  # torque at rest, its fall with the rate, dry friction
Point = tuple[float, float, float]  # speed of the contact, rate of the wheel, torque of the line there
REST2_MPS2, REST2_RADPS2 = REST_MPS * REST_MPS, REST_RADPS * REST_RADPS


class WheelFriction2D:
    """The wheels of a rover in the plane, each with a motor of its own or none. Implements `Axles`.

    Speeds are in the body's axes: of the center of mass ahead and to the left, and of turning.

    Args:
        vehicle: its wheels.
        loads: its mass and inertia.
        rolling_m: radius at which each wheel rolls.
        step_s: of integration.

    Attributes:
        driven: which wheels have a motor.
    """

    def __init__(self, vehicle: RoverVehicle, loads: RoverLoads, rolling_m: Sequence[float], step_s: float) -> None:
        x_m, y_m = loads.center_m
        self._places: list[tuple[float, float, float, float]] = []
        for wheel, radius_m in zip(vehicle.wheels, rolling_m, strict=True):
            rotor_kgm2 = vehicle.motor.wheel_kgm2 if wheel.motor == OWN_MOTOR else 0.0
            inertia_kgm2 = wheel_inertia_kgm2(wheel)[1] + rotor_kgm2
            self._places.append((wheel.position_m[0] - x_m, wheel.position_m[1] - y_m, radius_m, inertia_kgm2))
        self.driven: list[int] = [i for i, wheel in enumerate(vehicle.wheels) if wheel.motor == OWN_MOTOR]
        self._mass_kg, self._yaw_kgm2, self._step_s = loads.mass_kg, loads.yaw_kgm2, step_s
        self._lines: list[Line] = [(0.0, 0.0, 0.0)] * len(self._places)
        self._limits = [(0.0, 0.0)] * len(self._places)
        self._note_wheels()
        self.restore((0.0,) * len(self._places))

    def snapshot(self) -> tuple[float, ...]:
        """Return the torques of the last step."""
        return tuple(self._torques)

    def restore(self, snapshot: tuple[float, ...]) -> None:
        """Put back what `snapshot` returned."""
        self._torques = list(snapshot)

    def set_drives(self, drives: Sequence[Drive]) -> None:
        """Set what each motor does from now on."""
        for i, one in zip(self.driven, drives, strict=True):
            self._lines[i] = one.value * one.gain_nm, one.slope_nms, one.friction_nm
        self._note_wheels()

    def set_limits(self, limits_nm: Sequence[tuple[float, float]]) -> None:
        """Set the least and the largest torque of each motor."""
        for i, limits in zip(self.driven, limits_nm, strict=True):
            self._limits[i] = limits
        self._note_wheels()

    def _note_wheels(self) -> None:
        """Put the numbers of each wheel into one row, since `advance` goes through them some times in each step."""
        numbers = zip(self._places, self._lines, self._limits, strict=True)
        self._wheels = [(*place, *line, *limits) for place, line, limits in numbers]

    def torques_nm(self) -> list[float]:
        """Return the torque of each motor in the last step, without its dry friction."""
        return [self._torques[i] for i in self.driven]

    def advance(
        self,
        speeds: Speeds,
        kick_mps: tuple[float, float],
        rates: Sequence[float],
        grips_n: Sequence[float],
        drags: Sequence[float],
    ) -> tuple[Speeds, list[float], list[float], float]:
        """Return speeds and rates after a step, the force on each wheel ahead, and that on all to the left [N].

        Args:
            speeds: before the step.
            kick_mps: what gravity alone changes in it, ahead and to the left.
            rates: of the wheels before it [rad/s].
            grips_n: the largest force of each contact.
            drags: resistance of the soil to each wheel [N s/m], whether it rolls or slides.
        """
        h, wheels = self._step_s, self._wheels
        ahead, left, turn = speeds
        points: list[Point] = []
        for (x, y, radius, _, push, fall, _, _, _), rate in zip(wheels, rates, strict=True):
            along, across = ahead - turn * y - radius * rate, left + turn * x
            slide, roll = sqrt(along * along + across * across + REST2_MPS2), sqrt(rate * rate + REST2_RADPS2)
            points.append((slide, roll, push - fall * rate))
        mass_kg, yaw_kgm2 = self._mass_kg, self._yaw_kgm2
        start_ahead, start_left = mass_kg * (ahead + kick_mps[0]), mass_kg * (left + kick_mps[1])
        start_turn = yaw_kgm2 * turn
        for near in NEAR:
            a11, a22, a33, a13, a23 = mass_kg, mass_kg, yaw_kgm2, 0.0, 0.0
            b1, b2, b3 = start_ahead, start_left, start_turn
            rows = []
            for (x, y, radius, inertia, push, fall, dry, low, high), rate, (slide, roll, torque), grip_n, drag in zip(
                wheels, rates, points, grips_n, drags, strict=True
            ):
                if not low <= torque <= high:
                    push, fall = (low if torque < low else high), 0.0
                grip = h * grip_n / slide
                rolled = radius * grip
                start = inertia * rate + h * push
                heavy = inertia + h * (fall + dry / roll) + radius * rolled
                drag *= h
                stiff = grip * (1.0 - radius * rolled / heavy) + drag  # ahead, once the rate is eliminated
                pull = rolled * start / heavy
                grip += drag
                rows.append((rolled, start, heavy, stiff, pull, grip))
                across, along = grip * x, stiff * y
                a11 += stiff
                a22 += grip
                a13 -= along
                a23 += across
                a33 += along * y + across * x
                b1 += pull
                b3 -= pull * y
            turn = (b3 - a13 * b1 / a11 - a23 * b2 / a22) / (a33 - a13 * a13 / a11 - a23 * a23 / a22)
            ahead, left = (b1 - a13 * turn) / a11, (b2 - a23 * turn) / a22
            before, points, new_rates, drives, side_ns, is_near = points, [], [], [], 0.0, True
            for wheel, (rolled, start, heavy, stiff, pull, grip), (old_slide, old_roll, old_torque) in zip(
                wheels, rows, before, strict=True
            ):
                x, y, radius, _, push, fall, _, low, high = wheel
                along, across = ahead - turn * y, left + turn * x
                rate = (start + rolled * along) / heavy
                drives.append((pull - stiff * along) / h)
                side_ns -= grip * across
                along -= radius * rate
                slide, roll = sqrt(along * along + across * across + REST2_MPS2), sqrt(rate * rate + REST2_RADPS2)
                torque = push - fall * rate
                new_rates.append(rate)
                points.append((slide, roll, torque))
                # Slopes of two passes are the same, and the same torques are at a limit.
                if (
                    abs(slide - old_slide) > near * old_slide
                    or abs(roll - old_roll) > near * old_roll
                    or (old_torque < low) != (torque < low)
                    or (old_torque > high) != (torque > high)
                ):
                    is_near = False
            if is_near:
                break
        self._torques = [
            (high if torque > high else torque if torque > low else low)
            for (_, _, torque), (*_, low, high) in zip(points, wheels, strict=True)
        ]
        return (ahead, left, turn), new_rates, drives, side_ns / h
