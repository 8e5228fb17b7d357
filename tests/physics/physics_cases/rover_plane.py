"""Results of the rover in the plane that are known without a simulation; and how far it is from that in MuJoCo."""

from __future__ import annotations

import random
from functools import cache
from typing import Any

import numpy as np

from snr_sim.plants.ground.height_map import flat
from snr_sim.plants.ground.rover import Rover, RoverStart
from snr_sim.plants.ground.rover_2d import DEFLECTION, Rover2D
from snr_sim.plants.ground.terramechanics import Coulomb
from snr_sim.prelude.ground_signals import DriveCommand

from .case import Case
from .rover_runs import FRICTION, GRAVITY, MOTOR, RADIUS_M, ROVER_STEPS_S, VEHICLE, balance, go, rates, slope

ROLLING_M = RADIUS_M * (1.0 - 0.5 * DEFLECTION)
GRADUAL = "friction begins and ends within some mm/s"
OTHER = "1e-2 wanted: friction of MuJoCo's soft contacts is not opposite to their slip, most of all in gentle curves"
STICKS_S, TURNS = 2.0, 10  # a stick is moved each two seconds


def planar(step_s: float, degrees: float = 0.0, friction: float = FRICTION) -> Any:
    ground = slope(degrees) if degrees else flat()
    return Rover2D(VEHICLE, ground, lambda seed: RoverStart(), Coulomb(friction), step_s=step_s)


@cache
def turned(step_s: float, left: float, right: float) -> Rover2D:
    return go(planar(step_s), 4.0, "speed", left, right)  # type: ignore[return-value]


def in_plane() -> list[Case]:
    """Straight, in curves, on a slope, and with locked wheels."""

    def straight(step_s: float) -> float:
        rover = go(planar(step_s), 3.0, "speed", 5.0)
        return float(rover.speed_mps / rates(rover).mean())

    def expected(left: float, right: float) -> float:
        there = turned(ROVER_STEPS_S[0], left, right)
        return float(balance(VEHICLE, ROLLING_M * rates(there), np.array(there.loads_n))[2])

    def stop(step_s: float) -> float:
        rover: Any = go(planar(step_s, friction=0.2), 3.0, "speed", 12.0)
        x, speed_mps = rover.state.position_m[0], rover.speed_mps
        go(rover, 2.0, "brake", 6.0)
        return float((rover.state.position_m[0] - x) / (speed_mps**2 / (2.0 * 0.2 * GRAVITY)))

    @cache
    def climbed(step_s: float) -> tuple[float, float]:
        rover = go(planar(step_s, 10.0), 4.0, "duty", 0.6)
        return float(rover.speed_mps / ROLLING_M), rover.motors.voltage_v

    def line() -> float:
        torque_nm = VEHICLE.mass_kg * GRAVITY * np.sin(np.radians(10.0)) / 6.0 * ROLLING_M + MOTOR.friction_nm
        volts = 0.6 * climbed(ROVER_STEPS_S[0])[1] - torque_nm / MOTOR.nm_per_a * MOTOR.resistance_ohm
        return float(volts / MOTOR.v_per_radps)

    group = "In the plane"
    turns = [
        Case(
            group,
            f"in the plane: turning rate with wheels commanded to {left:g} and {right:g} rad/s",
            lambda a=left, b=right: expected(a, b),
            "rad/s",
            lambda s, a=left, b=right: float(turned(s, a, b).state.speeds[2]),
            0.01,
            GRADUAL,
        )
        for left, right in ((-6.0, 6.0), (-2.0, 6.0), (2.0, 6.0), (4.0, 6.0))
    ]
    return [
        Case(group, "in the plane: way over angle, straight", ROLLING_M, "m/rad", straight, 0.002, GRADUAL),
        *turns,
        Case(group, "in the plane: way of a stop, over that of friction 0.2", 1.0, "", stop, 0.02, GRADUAL),
        Case(
            group,
            "in the plane: rate of the wheels at a duty of 0.6, up 10 degrees",
            line,
            "rad/s",
            lambda s: climbed(s)[0],
            0.01,
            GRADUAL,
        ),
    ]


def beside_mujoco() -> list[Case]:
    """Way and turning of both rovers in 20 s of random sticks; of three tried, those that differ most."""

    @cache
    def driven(body: type[Rover] | type[Rover2D], step_s: float, seed: int) -> tuple[float, float]:
        rng, rover = random.Random(seed), body(VEHICLE, flat(), lambda seed: RoverStart(), step_s=step_s)
        way_m = turned_rad = 0.0
        for _ in range(TURNS):
            left, right = rng.uniform(-8.0, 8.0), rng.uniform(-8.0, 8.0)
            rover.write("drive", DriveCommand("speed", [left] * 3 + [right] * 3))
            for _ in range(round(STICKS_S / step_s)):
                rover.step(step_s)
                way_m += step_s * rover.speed_mps
                turned_rad += step_s * abs(rover.read("imu").rate_radps[2])
        return way_m, turned_rad

    return [
        Case(
            "In the plane",
            f"in the plane: {what} in 20 s of random sticks, seed {seed}, against MuJoCo",
            lambda i=i, seed=seed: driven(Rover, 0.002, seed)[i],
            unit,
            lambda s, i=i, seed=seed: driven(Rover2D, s, seed)[i],
            allowed,
            OTHER,
            is_long=True,
        )
        for i, what, seed, unit, allowed in ((0, "way", 3, "m", 0.04), (1, "turning", 2, "rad", 0.06))
    ]
