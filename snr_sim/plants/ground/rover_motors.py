"""The motors of a rover in MuJoCo, and the battery that feeds them.

Each motor is an actuator whose torque falls with the wheel's rate, so that MuJoCo integrates it implicitly: a speed
loop computed once a step shook light wheels, and let a parked rover slide. Brakes are dry friction at the axle.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from snr_sim.plants.battery import Battery
from snr_sim.plants.ground.rover_vehicle import RoverVehicle
from snr_sim.plants.mujoco_engine import MujocoWorld
from snr_sim.prelude.ground_signals import MotorReading

SAME_V = 0.02  # the motors' lines are computed again when the voltage has changed by more
FREE_NM = 1e-9  # friction of an axle without any: MuJoCo has no row for one of 0
NEUTRAL_BRAKE_A = 4.0  # holds until 25 degrees


class RoverMotors:
    """All motors of a rover. Rates are those of the wheels.

    Attributes:
        dofs: of the wheels with motors, in MuJoCo's velocities.
    """

    def __init__(self, vehicle: RoverVehicle, world: MujocoWorld) -> None:
        self._vehicle, self._motor, wheels = vehicle, vehicle.motor, vehicle.motor_wheels
        model, data = world.model, world.data
        self.dofs: list[int] = [int(model.joint(f"wheel_{wheel.name}").dofadr[0]) for wheel in wheels]
        self._controls, self._torques = data.ctrl, data.actuator_force
        self._gains, self._slopes = model.actuator_gainprm[:, 0], model.actuator_biasprm[:, 2]
        self._ranges, self._friction = model.actuator_forcerange, model.dof_frictionloss
        self._per_motor = 1.0 / vehicle.motor.nm_per_a, vehicle.motor.resistance_ohm, vehicle.motor.v_per_radps
        limit_nm = self._motor.limit_a * self._motor.nm_per_a
        self._full_range = [(-limit_nm, limit_nm)] * len(wheels)
        self.reset(1.0)

    def reset(self, charge: float) -> None:
        """Begin with motors off and a charge of the battery."""
        self.battery: Battery = Battery(self._vehicle.battery, charge)
        self._voltage_v = self._line_v = self.battery.voltage_v(self._vehicle.electronics_a)
        self.current_a: float = self._vehicle.electronics_a  # out of the battery
        self.command("off", (0.0,) * len(self.dofs))

    def command(self, mode: str, values: Sequence[float]) -> None:
        """Set what the motors do: see `DcMotor.drive`."""
        self.mode: str = mode
        self.values: tuple[float, ...] = tuple(values)
        self._line_v = self._voltage_v
        self._set_lines()

    def neutral(self) -> None:
        """Brake: a rover that rolls freely drives down a slope."""
        self.command("brake", (NEUTRAL_BRAKE_A,) * len(self.dofs))

    def _set_lines(self) -> None:
        motor, voltage_v = self._motor, self._line_v
        drives = [motor.drive(self.mode, value, voltage_v) for value in self.values]
        self._controls[:] = [one.value for one in drives]
        self._gains[:] = [one.gain_nm for one in drives]
        self._slopes[:] = [-one.slope_nms for one in drives]
        self._friction[self.dofs] = [max(FREE_NM, one.friction_nm) for one in drives]
        self._ranges[:] = self._full_range
        self._is_limited = False
        # Below this rate the voltage allows the whole current, in both directions.
        self._free_radps = max(0.0, voltage_v - SAME_V - motor.limit_a * motor.resistance_ohm) / motor.v_per_radps

    def limit(self, rates: Sequence[float]) -> None:
        """Limit the torques of the next step to what the voltage allows at these rates."""
        free = self._free_radps
        if max(rates) > free or min(rates) < -free:
            self._ranges[:] = [self._motor.limits_nm(rate, self._voltage_v) for rate in rates]
            self._is_limited = True
        elif self._is_limited:
            self._ranges[:] = self._full_range
            self._is_limited = False

    def draw(self, rates: Sequence[float], step_s: float) -> None:
        """Draw from the battery what motors and electronics have taken in a step."""
        amperes, ohms, emf = self._per_motor
        power_w = 0.0
        for torque, rate in zip(self._torques.tolist(), rates, strict=True):
            current_a = torque * amperes
            one_w = current_a * (current_a * ohms + rate * emf)
            if one_w > 0.0:  # the controllers burn what comes back
                power_w += one_w
        before_v = self._voltage_v
        current_a = self._vehicle.electronics_a + (power_w / before_v if before_v > 0.0 else 0.0)
        self.current_a = current_a
        self._voltage_v = voltage_v = self.battery.voltage_v(current_a)
        self.battery.draw(current_a, voltage_v, step_s)
        if abs(voltage_v - self._line_v) > SAME_V:
            self._line_v = voltage_v
            self._set_lines()

    @property
    def voltage_v(self) -> float:
        """Voltage of the battery under the last load."""
        return self._voltage_v

    def reading(self, motor_index: int, rate_radps: float, turned_rad: float, time_s: float) -> MotorReading:
        """Return the state of a motor; its current is that of the last step."""
        motor, supply_v = self._motor, self._voltage_v
        current_a = float(self._torques[motor_index]) / motor.nm_per_a
        volts = current_a * motor.resistance_ohm + rate_radps * motor.v_per_radps
        duty = min(1.0, max(-1.0, volts / supply_v)) if supply_v > 0.0 else 0.0
        battery_a = max(0.0, current_a * duty)
        return MotorReading(rate_radps, current_a, battery_a, duty, supply_v, turned_rad, time_s)

    def snapshot(self) -> tuple[Any, ...]:
        """Return all of its state that MuJoCo's does not hold."""
        return self.mode, self.values, self._voltage_v, self._line_v, self.current_a, self.battery.snapshot()

    def restore(self, snapshot: tuple[Any, ...]) -> None:
        """Put back what `snapshot` returned."""
        self.mode, self.values, self._voltage_v, self._line_v, self.current_a, battery = snapshot
        self.battery.restore(battery)
        self._set_lines()
