"""Where the rover's power goes: motors that stand still, and the energy of a minute of hills."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from snr_sim.plants.ground.height_map import make_hills
from snr_sim.plants.ground.rocks import Ledge
from snr_sim.plants.ground.rover import Rover

from .case import Case
from .rover_runs import COUNT, GRAVITY, MOTOR, REGULARISED, VEHICLE, go, made, motors, rolling_radii_m

# Without friction of axles, which could hold a wheel, and without electronics, which would hide what motors draw.
BARE = replace(VEHICLE, motor=replace(MOTOR, friction_nm=0.0), electronics_a=0.0)


def stalled() -> list[Case]:
    """At rest there is no back-EMF: current is voltage * duty / resistance or its limit, and all power is heat."""
    bar = Ledge((0.75, 0.0, 0.28), (0.3, 0.2, 0.03))  # meets the chassis, between the wheels
    push_a = 3.0

    @cache
    def begun(step_s: float, duty: float) -> tuple[float, float, float]:
        """Return current and power of a motor in the first step, and the voltage before it."""
        rover = go(made(step_s, vehicle=BARE), 1.0, "brake", 6.0)
        supply_v = rover.read("power").voltage_v
        go(rover, step_s, "duty", duty)
        return motors(rover)[0].current_a, rover.read("power").current_a * supply_v / COUNT, supply_v

    def expected_a(duty: float) -> float:
        return min(MOTOR.limit_a, duty * begun(0.001, duty)[2] / MOTOR.resistance_ohm)

    @cache
    def pushed(step_s: float) -> tuple[float, float]:
        """Return the force on a bar, and that of the motors' torques at the rims."""
        rover = go(made(step_s, vehicle=BARE, ledges=(bar,)), 6.0, "current", push_a)
        return ahead_n(rover), float((MOTOR.nm_per_a * push_a / rolling_radii_m(rover)).sum())

    cases = []
    for duty in (0.01, 0.5):
        cases += [
            Case(
                "Motors",
                f"duty {duty:g} at rest: {what}",
                expected,
                unit,
                lambda s, d=duty, i=i: begun(s, d)[i],
                0.005,
                "wheels begin to turn",
            )
            for i, (what, unit, expected) in enumerate(
                (
                    ("current", "A", lambda d=duty: expected_a(d)),
                    ("power", "W", lambda d=duty: expected_a(d) ** 2 * MOTOR.resistance_ohm),
                )
            )
        ]
    push = Case(
        "Motors",
        f"{push_a:g} A, stopped by a bar: force on the bar",
        lambda: pushed(0.001)[1],
        "N",
        lambda s: pushed(s)[0],
        0.005,
        REGULARISED,
    )
    return [*cases, push]


def ahead_n(rover: Rover) -> float:
    """Return the force along x of all contacts with obstacles."""
    world, total = rover._world, 0.0
    force = np.zeros(6)
    for i in range(world.data.ncon):
        contact = world.data.contact[i]
        names = [world.model.geom(int(geom)).name for geom in contact.geom]
        if any(name.startswith("obstacle") for name in names):
            world.mujoco.mj_contactForce(world.model, world.data, i, force)
            total += abs(float(force[:3] @ contact.frame.reshape(3, 3)[:, 0]))
    return total


def energy() -> list[Case]:
    """The energy of a minute of hills is height, motion, and heat of motors, gears, axles, tyres and ground."""

    def spent(step_s: float) -> float:
        """Return the battery's energy over that of where it went; heat of contacts and axles by MuJoCo's forces."""
        rover = made(step_s, make_hills(3, 0.5, 8.0), vehicle=replace(VEHICLE, electronics_a=0.0))
        data, dofs = rover._world.data, rover._dofs
        first_j, before = mechanical_j(rover), np.array(data.qvel[dofs])
        heat_j = 0.0
        go(rover, 0.0, "speed", 4.0, 6.0)
        for _ in range(round(60.0 / step_s)):
            rover.step(step_s)
            current_a = data.actuator_force / MOTOR.nm_per_a
            back_w = current_a * before * MOTOR.v_per_radps  # of the rotor, before the gear
            motor_w = current_a * current_a * MOTOR.resistance_ohm + back_w
            heat_j += step_s * float(np.maximum(motor_w, 0.0).sum() - MOTOR.efficiency * back_w.sum())
            heat_j -= step_s * float(data.efc_force @ data.efc_vel)
            before = np.array(data.qvel[dofs])
        return float(rover.motors.battery.energy_j / (mechanical_j(rover) - first_j + heat_j))

    return [
        Case(
            "Hills",
            "60 s: energy of the battery over that of height, motion and heat",
            1.0,
            "",
            spent,
            0.005,
            "work is summed once a step",
            is_long=True,
        )
    ]


def mechanical_j(rover: Rover) -> float:
    """Return potential and kinetic energy."""
    world = rover._world
    model, data = world.model, world.data
    momentum = np.zeros(model.nv)
    world.mujoco.mj_kinematics(model, data)
    world.mujoco.mj_mulM(model, data, momentum, data.qvel)
    return float(GRAVITY * (model.body_mass * data.xipos[:, 2]).sum() + 0.5 * momentum @ data.qvel)
