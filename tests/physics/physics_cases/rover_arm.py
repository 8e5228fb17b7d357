"""The arm of a rover: moments of gravity that its servos hold, and the work of lifting it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cache

from snr_sim.plants.ground.manipulator import Manipulator
from snr_sim.prelude.ground_signals import ArmCommand

from .case import Case
from .rover_runs import GRAVITY, VEHICLE, go, made

ARM = Manipulator()
POSE = (0.5, 0.4, -0.9, 0.3, 0.2, 0.0)
LOW, HIGH = (0.0, 0.2, -0.4, 0.2, 0.0, 0.0), (0.0, 1.0, -0.4, 0.2, 0.0, 0.0)
LEANS = "it leans on its tyres by some thousandths of a radian"
IMPLICIT = "damping of servos is implicit, of first order in the step"
LIFT_S = 1.2


def joints_m(angles: Sequence[float]) -> list[float]:
    """Return how far ahead of the shoulder it is to the shoulder, the elbow and the wrist."""
    upper, fore, _ = ARM.lengths_m
    elbow = upper * math.cos(angles[1])
    return [0.0, elbow, elbow + fore * math.cos(angles[1] + angles[2])]


def masses_at(angles: Sequence[float]) -> list[tuple[float, float, float]]:
    """Return mass, radius and height of upper arm, forearm, wrist, hand and finger, the grip closed [kg, m]."""
    (upper, fore, hand), (upper_kg, fore_kg, hand_kg) = ARM.lengths_m, ARM.masses_kg
    pitches = [angles[1], angles[1] + angles[2], angles[1] + angles[2] + angles[3]]
    (a, b), (c, d), (e, f) = ((math.cos(pitch), math.sin(pitch)) for pitch in pitches)
    x, z = upper * a + fore * c, upper * b + fore * d
    return [
        (upper_kg, 0.5 * upper * a, 0.5 * upper * b),
        (fore_kg, upper * a + 0.5 * fore * c, upper * b + 0.5 * fore * d),
        (0.1, x + 0.005 * e, z + 0.005 * f),
        (hand_kg, x + 0.5 * hand * e, z + 0.5 * hand * f),
        (0.1, x + 0.75 * hand * e, z + 0.75 * hand * f),
    ]


def potential_j(angles: Sequence[float]) -> float:
    return GRAVITY * math.fsum(kg * z for kg, _, z in masses_at(angles))


def arm() -> list[Case]:
    """Weight times distance of all that is beyond a joint; the battery gives what lifting takes, and no more."""

    @cache
    def torques_nm(step_s: float) -> list[float]:
        torques: list[float] = (
            go(made(step_s, vehicle=replace(VEHICLE, arm=replace(ARM, rest_rad=POSE))), 0.1).read("arm").torques_nm
        )
        return torques

    def work_j(step_s: float) -> float:
        """Return what the battery gave while the shoulder lifted all, less what electronics took."""
        rover = made(step_s, vehicle=replace(VEHICLE, arm=replace(ARM, rest_rad=LOW)))
        began_j, volts = rover.motors.battery.energy_j, rover.motors.voltage_v
        rover.write("arm", ArmCommand(list(HIGH)))
        go(rover, LIFT_S)
        return rover.motors.battery.energy_j - began_j - VEHICLE.electronics_a * volts * LIFT_S

    cases = []
    for i, (name, at_m) in enumerate(zip(("shoulder", "elbow", "wrist"), joints_m(POSE), strict=True)):
        moment_nm = GRAVITY * math.fsum(kg * (x - at_m) for kg, x, _ in masses_at(POSE)[i:])
        cases.append(
            Case("The arm", f"torque of the {name}", moment_nm, "N m", lambda s, i=i: torques_nm(s)[1 + i], 5e-3, LEANS)
        )
    lifted_j = potential_j(HIGH) - potential_j(LOW)
    return [
        *cases,
        Case("The arm", "work of the battery that lifts it", lifted_j, "J", work_j, 1e-1, IMPLICIT),
    ]
