"""Runs of the rover for the cases: how they begin, what is measured, and levers of its weight."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from snr_sim.plants.ground.height_map import HeightMap, flat, ramp
from snr_sim.plants.ground.rocks import Ledge
from snr_sim.plants.ground.rover import Rover, RoverStart
from snr_sim.plants.ground.rover_file import read_rover
from snr_sim.plants.ground.rover_vehicle import RockerBogie, RoverVehicle
from snr_sim.plants.ground.terramechanics import Ground
from snr_sim.prelude.ground_signals import DriveCommand, MotorReading

ROVER_STEPS_S = (0.001, 0.002, 0.004)
VEHICLE = read_rover(Path(__file__).parents[3] / "robots" / "rover" / "vehicles" / "competition.toml")
STRONG = replace(VEHICLE, motor=replace(VEHICLE.motor, limit_a=60.0))  # its brakes hold any wheel
MOTOR, COUNT, GRAVITY = VEHICLE.motor, len(VEHICLE.wheels), 9.80665
RADIUS_M, WIDTH_M = VEHICLE.wheels[0].radius_m, VEHICLE.wheels[0].width_m
LEFT, RIGHT = slice(0, 3), slice(3, 6)
FRICTION = 0.8

SOFT = "tyres are soft, so loads shift a little as they are pressed"
REGULARISED = "MuJoCo's friction begins and ends gradually"
LAST_STEP = "friction of soil follows load and slip of the step before"


def made(
    step_s: float,
    ground: HeightMap | None = None,
    soil: Ground | None = None,
    vehicle: RoverVehicle = VEHICLE,
    start: RoverStart = RoverStart(),  # noqa: B008 - frozen
    ledges: tuple[Ledge, ...] = (),
) -> Rover:
    return Rover(vehicle, ground or flat(), lambda seed: start, soil, ledges, step_s=step_s)


def go(rover: Rover, seconds: float, mode: str = "", *values: float) -> Rover:
    """Drive for a time, after a command to all wheels or to those of the left and the right side."""
    if mode:
        half = len(rover.vehicle.motor_wheels) // 2
        each = list(values) if len(values) > 2 else [values[0]] * half + [values[-1]] * half
        rover.write("drive", DriveCommand(mode, each))
    for _ in range(round(seconds / rover.step_s)):
        rover.step(rover.step_s)
    return rover


def motors(rover: Rover) -> list[MotorReading]:
    return [rover.read(f"motor_{wheel.name}") for wheel in rover.vehicle.motor_wheels]


def rates(rover: Rover) -> np.ndarray:
    return np.array([motor.speed_radps for motor in motors(rover)])


def place(rover: Rover) -> np.ndarray:
    return np.array(rover.read("pose").position_m)


def speed_mps(rover: Rover) -> float:
    return float(rover.truth()["values"]["speed_mps"])


def slope(degrees: float, size_m: float = 80.0) -> HeightMap:
    return ramp((math.tan(math.radians(degrees)), 0.0), size_m)


def axle_heights_m(rover: Rover) -> np.ndarray:
    """Return the distances of the axles from the ground under them."""
    poses = rover.truth()["poses"]
    return np.array(
        [
            sum((a - p) * n for a, p, n in zip(poses[f"wheel_{wheel.name}"][:3], at[:3], at[3:], strict=True))
            for wheel, at in zip(rover.vehicle.wheels, rover.contacts.planes, strict=True)
        ]
    )


def rolling_radii_m(rover: Rover) -> np.ndarray:
    """Return the distances from the axles to the middle of the contacts."""
    return 0.5 * (np.array([wheel.radius_m for wheel in rover.vehicle.wheels]) + axle_heights_m(rover))


def rolling_radius_m(rover: Rover) -> float:
    """Return the mean of all wheels."""
    return float(rolling_radii_m(rover).mean())


class Turn(NamedTuple):
    """A rover that turns.

    Args:
        radps: mean rate of turning in a second.
        wheel_radps: mean rates of all wheels.
        loads_n, radii_m: of all wheels at its end.
    """

    radps: float
    wheel_radps: np.ndarray
    loads_n: np.ndarray
    radii_m: np.ndarray


def turn(rover: Rover, left: float, right: float) -> Turn:
    """Turn for 3 s, and for the second that is measured."""
    go(rover, 3.0, "speed", left, right)
    joints = [f"wheel_{wheel.name}" for wheel in rover.vehicle.wheels]
    dofs = [int(rover._world.model.joint(name).dofadr[0]) for name in joints]
    turns, speeds = [], []
    for _ in range(round(1.0 / rover.step_s)):
        rover.step(rover.step_s)
        turns.append(rover.read("imu").rate_radps[2])
        speeds.append(np.array(rover._world.data.qvel[dofs]))
    loads = np.array(rover.contacts.read_loads())
    return Turn(float(np.mean(turns)), np.mean(speeds, axis=0), loads, rolling_radii_m(rover))


def balance(vehicle: RoverVehicle, rolled_mps: np.ndarray, grips_n: np.ndarray) -> np.ndarray:
    """Return the speeds ahead, to the left and of turning at which friction of wheels is in balance: its least power.

    With wheel rates and loads given, power is a convex function of the three speeds of the body; it is found by
    weighted least squares, repeated (Weiszfeld), which shares nothing with MuJoCo.
    """
    twist = np.zeros(3)
    places = [wheel.position_m[:2] for wheel in vehicle.wheels]
    per_twist = [np.array([[1.0, 0.0, -y], [0.0, 1.0, x]]) for x, y in places]
    for _ in range(5000):
        matrix, vector = np.zeros((3, 3)), np.zeros(3)
        for to_speed, along, grip in zip(per_twist, rolled_mps, grips_n, strict=True):
            slid = to_speed @ twist - [along, 0.0]
            weight = grip / math.sqrt(slid @ slid + 1e-16)
            matrix += weight * to_speed.T @ to_speed
            vector += weight * to_speed.T @ [along, 0.0]
        new = np.linalg.solve(matrix, vector)
        if np.abs(new - twist).max() < 1e-12:
            break
        twist = new
    return twist


def suspension() -> RockerBogie:
    assert VEHICLE.suspension is not None
    return VEHICLE.suspension


Part = tuple[float, float]  # a mass [kg], and x of it [m]


def parts_of_a_side() -> tuple[list[Part], list[Part]]:
    """Return what weighs on a rocker, half of the chassis with it, and what weighs on its bogie."""
    hung = suspension()
    (rx, _), (bx, _) = hung.rocker_pivot_m, hung.bogie_pivot_m
    front, middle, back = (wheel.position_m[0] for wheel in VEHICLE.wheels[LEFT])
    wheel_kg = VEHICLE.wheels[0].mass_kg
    rocker = [
        (0.5 * VEHICLE.chassis_kg, VEHICLE.center_of_mass_m[0]),
        (hung.rocker_kg, rx + 0.25 * (front - rx + bx - rx)),
        (wheel_kg, front),
    ]
    bogie = [(hung.bogie_kg, bx + 0.25 * (middle - bx + back - bx)), (wheel_kg, middle), (wheel_kg, back)]
    return rocker, bogie


def shared(parts: list[Part], one: float, other: float, on_it: Part = (0.0, 0.0)) -> list[float]:
    """Return the loads of two supports, by the rule of levers; `on_it` is a force [N] and its x."""
    weight = GRAVITY * sum(kg for kg, _ in parts) + on_it[0]
    moment = GRAVITY * sum(kg * x for kg, x in parts) + on_it[0] * on_it[1]
    at_other = (moment - weight * one) / (other - one)
    return [weight - at_other, at_other]


def mass_height_m() -> float:
    """Return the height of the centre of mass: parts by their masses, rods in their middle."""
    (_, rz), (_, bz) = suspension().rocker_pivot_m, suspension().bogie_pivot_m
    axle = VEHICLE.wheels[0].position_m[2]
    rocker_z, bogie_z = rz + 0.25 * (axle - rz + bz - rz), bz + 0.5 * (axle - bz)
    hung = suspension().rocker_kg * rocker_z + suspension().bogie_kg * bogie_z
    wheels = COUNT * VEHICLE.wheels[0].mass_kg * axle
    return (VEHICLE.chassis_kg * VEHICLE.center_of_mass_m[2] + 2.0 * hung + wheels) / VEHICLE.mass_kg
