"""The motors of a rover, and the battery that feeds them, on whatever turns the wheels.

Each motor is a line, a torque that falls with the wheel's rate, so that an engine integrates it implicitly: a speed
loop computed once a step shook light wheels, and let a parked rover slide. Brakes are dry friction at the axle.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Protocol

from snr_sim.plants.battery import Battery
from snr_sim.plants.ground.dc_motor import MODES, Drive
from snr_sim.plants.ground.motor_faults import MotorFault, MotorFaults
from snr_sim.plants.ground.rover_vehicle import RoverVehicle
from snr_sim.plants.mujoco_engine import MujocoWorld
from snr_sim.plants.outputs import PowerOutput
from snr_sim.prelude.device import Stale
from snr_sim.prelude.errors import PlantError, UnknownNameError, suggest
from snr_sim.prelude.ground_signals import NEUTRAL_BRAKE_A, DriveCommand, MotorReading

SAME_V = 0.02  # the motors' lines are computed again when the voltage has changed by more
FREE_NM = 1e-9  # friction of an axle without any: MuJoCo has no row for one of 0


class Axles(Protocol):
    """What turns the wheels of a rover in an engine."""

    def set_drives(self, drives: Sequence[Drive]) -> None:
        """Set what each motor does from now on."""

    def set_limits(self, limits_nm: Sequence[tuple[float, float]]) -> None:
        """Set the least and the largest torque of each motor."""

    def torques_nm(self) -> list[float]:
        """Return the torque of each motor in the last step, without its dry friction."""


class MujocoAxles:
    """The wheels with motors of a rover in MuJoCo. Implements `Axles`: motors are actuators, integrated implicitly.

    Attributes:
        dofs: of the wheels, in MuJoCo's velocities.
    """

    def __init__(self, vehicle: RoverVehicle, world: MujocoWorld) -> None:
        model, data = world.model, world.data
        self.dofs: list[int] = [int(model.joint(f"wheel_{wheel.name}").dofadr[0]) for wheel in vehicle.motor_wheels]
        count = len(self.dofs)  # motors come before the servos of an arm
        self._controls, self._torques = data.ctrl[:count], data.actuator_force[:count]
        self._gains, self._slopes = model.actuator_gainprm[:count, 0], model.actuator_biasprm[:count, 2]
        self._ranges, self._friction = model.actuator_forcerange[:count], model.dof_frictionloss

    def set_drives(self, drives: Sequence[Drive]) -> None:
        """Set what each motor does from now on."""
        self._controls[:] = [one.value for one in drives]
        self._gains[:] = [one.gain_nm for one in drives]
        self._slopes[:] = [-one.slope_nms for one in drives]
        self._friction[self.dofs] = [max(FREE_NM, one.friction_nm) for one in drives]

    def set_limits(self, limits_nm: Sequence[tuple[float, float]]) -> None:
        """Set the least and the largest torque of each motor."""
        self._ranges[:] = limits_nm

    def torques_nm(self) -> list[float]:
        """Return the torque of each motor in the last step, without its dry friction."""
        torques: list[float] = self._torques.tolist()
        return torques


class RoverMotors:
    """All motors of a rover. Rates are those of the wheels.

    Attributes:
        inputs: of the plant: "drive" for all motors, and "motor_<wheel>" for each alone.
        faults: motors that break.
        until_s: when `expire` is due.
    """

    def __init__(self, vehicle: RoverVehicle, axles: Axles) -> None:
        self._vehicle, self._motor, self._axles, self._count = vehicle, vehicle.motor, axles, len(vehicle.motor_wheels)
        names = [f"motor_{wheel.name}" for wheel in vehicle.motor_wheels]
        self._motors_of: dict[str, Sequence[int]] = {"drive": range(self._count)}
        self._motors_of |= {name: (i,) for i, name in enumerate(names)}
        self.inputs: tuple[str, ...] = tuple(self._motors_of)
        self._commands: list[tuple[str, float]] = [("off", 0.0)] * self._count
        motor = vehicle.motor
        self._per_motor = 1.0 / motor.nm_per_a, motor.resistance_ohm, motor.v_per_radps, vehicle.electronics_a
        limit_nm = self._motor.limit_a * self._motor.nm_per_a
        self._full_range = [(-limit_nm, limit_nm)] * self._count
        self.reset(1.0)

    def reset(self, charge: float, faults: Sequence[MotorFault] = ()) -> None:
        """Begin with motors off, a charge of the battery, and motors that will break."""
        self.faults: MotorFaults = MotorFaults(faults, [wheel.name for wheel in self._vehicle.motor_wheels])
        self.battery: Battery = Battery(self._vehicle.battery, charge)
        self._voltage_v = self._line_v = self.battery.voltage_v(self._vehicle.electronics_a)
        self.current_a: float = self._vehicle.electronics_a  # out of the battery
        self.until_s: float = math.inf
        self._untils = [math.inf] * self._count
        self.command("off", (0.0,) * self._count)

    def order(self, name: str, command: DriveCommand, time_s: float) -> None:
        """Do what a command says; one without values is neutral, a brake of NEUTRAL_BRAKE_A.

        Args:
            name: one of `inputs`: "drive", or the only motor that the command is for.
            command: see `DriveCommand`.
            time_s: of the plant. A command that is valid until then is neutral.

        Raises:
            UnknownNameError: there is no such mode.
            PlantError: the values are not one finite number for each motor.
        """
        if name not in self.inputs:
            raise UnknownNameError(f"This plant has no input '{name}'.", fix=suggest(name, self.inputs))
        if command.mode not in MODES:
            raise UnknownNameError(f"Motors have no mode '{command.mode}'.", fix=suggest(command.mode, MODES))
        which = self._motors_of[name]
        mode, values = (command.mode, command.values) if command.values else ("brake", [NEUTRAL_BRAKE_A] * len(which))
        if len(values) != len(which) or not all(map(math.isfinite, values)):
            expected = "one finite number" if len(which) == 1 else f"{len(which)} finite numbers, one for each motor"
            raise PlantError(
                f"At {time_s:g} s the command '{name}' is {values}.",
                fix=f"send {expected}.",
            )
        is_valid = command.until_s > time_s  # also if it is NaN
        self.command(mode if is_valid else "brake", values if is_valid else [NEUTRAL_BRAKE_A] * len(which), which)
        for i in which:
            self._untils[i] = command.until_s if is_valid else math.inf
        self.until_s = min(self._untils)

    def expire(self, time_s: float) -> None:
        """Put motors at neutral whose commands are valid no longer."""
        which = [i for i, until_s in enumerate(self._untils) if until_s <= time_s]
        self.command("brake", [NEUTRAL_BRAKE_A] * len(which), which)
        for i in which:
            self._untils[i] = math.inf
        self.until_s = min(self._untils)

    def command(self, mode: str, values: Sequence[float], which: Sequence[int] | None = None) -> None:
        """Set what motors do, of all or of those with these indices: see `DcMotor.drive`."""
        for i, value in zip(range(self._count) if which is None else which, values, strict=True):
            self._commands[i] = mode, value
        self._line_v = self._voltage_v
        self._set_lines()

    def neutral(self) -> None:
        """Brake: a rover that rolls freely drives down a slope."""
        self.command("brake", (NEUTRAL_BRAKE_A,) * self._count)

    def _set_lines(self) -> None:
        motor, voltage_v = self._motor, self._line_v
        drives = [motor.drive(mode, value, voltage_v) for mode, value in self._commands]
        self._axles.set_drives(self.faults.apply(drives))
        self._axles.set_limits(self._full_range)
        self._is_limited = False
        # Below this rate the voltage allows the whole current, in both directions.
        self._free_radps = max(0.0, voltage_v - SAME_V - motor.limit_a * motor.resistance_ohm) / motor.v_per_radps

    def break_due(self, time_s: float) -> None:
        """Break the motors that are to be broken by now."""
        self.faults.advance(time_s)
        self._set_lines()

    def limit(self, rates: Sequence[float]) -> None:
        """Limit the torques of the next step to what the voltage allows at these rates."""
        free = self._free_radps
        if max(rates) > free or min(rates) < -free:
            self._axles.set_limits([self._motor.limits_nm(rate, self._voltage_v) for rate in rates])
            self._is_limited = True
        elif self._is_limited:
            self._axles.set_limits(self._full_range)
            self._is_limited = False

    def draw(self, rates: Sequence[float], step_s: float, power_w: float = 0.0) -> None:
        """Draw from the battery what motors and electronics have taken in a step, and the power of an arm."""
        amperes, ohms, emf, electronics_a = self._per_motor
        for torque, rate in zip(self._axles.torques_nm(), rates, strict=True):
            current_a = torque * amperes
            one_w = current_a * (current_a * ohms + rate * emf)
            if one_w > 0.0:  # the controllers burn what comes back
                power_w += one_w
        before_v = self._voltage_v
        current_a = electronics_a + (power_w / before_v if before_v > 0.0 else 0.0)
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

    def reading(self, motor_index: int, rate_radps: float, turned_rad: float, time_s: float) -> MotorReading | Stale:
        """Return the state of a motor; its current is that of the last step."""
        if self.faults.broken.get(motor_index) == "silent":
            return Stale("The motor's controller sends nothing. Does it have power?")
        motor, supply_v = self._motor, self._voltage_v
        current_a = self._axles.torques_nm()[motor_index] / motor.nm_per_a
        volts = current_a * motor.resistance_ohm + rate_radps * motor.v_per_radps
        duty = min(1.0, max(-1.0, volts / supply_v)) if supply_v > 0.0 else 0.0
        battery_a = max(0.0, current_a * duty)
        return MotorReading(rate_radps, current_a, battery_a, duty, supply_v, turned_rad, time_s)

    def power(self, time_s: float) -> PowerOutput:
        """Return what is at the battery's terminals."""
        return PowerOutput(self._voltage_v, self.current_a, self.battery.charge, time_s)

    def snapshot(self) -> tuple[Any, ...]:
        """Return all of its state that the engine's does not hold."""
        state = tuple(self._commands), tuple(self._untils), self._voltage_v, self._line_v, self.current_a
        return *state, self.battery.snapshot(), self.faults.snapshot()

    def restore(self, snapshot: tuple[Any, ...]) -> None:
        """Put back what `snapshot` returned."""
        commands, untils, self._voltage_v, self._line_v, self.current_a, battery, faults = snapshot
        self._commands, self._untils = list(commands), list(untils)
        self.until_s = min(untils)
        self.faults.restore(faults)
        self.battery.restore(battery)
        self._set_lines()
