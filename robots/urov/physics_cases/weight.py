"""Weight and buoyancy: swinging upright, rising and sinking, nose up, afloat, and lifted out."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from fossen_rk4 import rotation

from snr_sim.plants.urov.dive import Load
from snr_sim.plants.urov.urov import Urov
from snr_sim.plants.urov.vehicle import Vehicle
from snr_sim.prelude.angles import roll_pitch_yaw_rad
from snr_sim.prelude.wrench import AXES

from .case import ROUNDING, Case
from .closed_forms import pendulum_period, step_response
from .swimming import DEEP, SEA, SETS, along, go, mass_along, neutral, swim, vehicle


def period(plant: Urov, axis: int, swings: int = 1) -> float:
    """Returns the mean time of a full swing in roll (0) or pitch (1), from where its rate changes sign."""
    turns, before = [], plant.rate_radps[axis]
    while len(turns) <= 2 * swings:
        plant.step(plant.step_s)
        now = plant.rate_radps[axis]
        if before * now < 0.0:
            turns.append(plant.time_s - plant.step_s * now / (now - before))
        before = now
    return (turns[2 * swings] - turns[0]) / swings


def righting() -> Iterator[Case]:
    """Buoyancy above the centre of mass, and against the weight."""
    group = "Weight and buoyancy"
    for name in SETS:
        one = neutral(name)
        stiffness = SEA.density_kgm3 * SEA.gravity_mps2 * one.volume_m3 * one.centre_of_buoyancy_m[2]
        for axis in (0, 1):
            mass, damping = mass_along(one, 3 + axis), one.linear_damping[3 + axis]
            share = damping / (2.0 * math.sqrt(stiffness * mass))
            tilt = along(axis, math.radians(0.05))
            yield Case(
                group, f"{name}: period of a small {AXES[3 + axis]}, damping {share:.3f}",
                2.0 * math.pi * math.sqrt(mass / stiffness / (1.0 - share * share)), "s",
                lambda h, one=one, tilt=tilt, axis=axis: period(swim(one, h, attitude_rad=tilt[:3]), axis), 5e-4,
                "quadratic drag at 0.05 deg, and where the rate changes sign between two steps",
            )  # fmt: skip
        free = replace(one, linear_damping=(0.0,) * 6, quadratic_damping=(0.0,) * 6)
        swing = math.radians(120.0)
        yield Case(
            group, f"{name}: period of a roll from 120 deg, undamped",
            pendulum_period(mass_along(one, 3), stiffness, swing), "s",
            lambda h, free=free, swing=swing: period(swim(free, h, attitude_rad=(swing, 0.0, 0.0)), 0), 2e-4,
        )  # fmt: skip

        def swing_energy(step_s: float, free: Vehicle = free, stiffness: float = stiffness) -> float:
            plant = swim(free, step_s, attitude_rad=(2.0, 0.4, 0.0))
            begin = stiffness * rotation(np.array(plant.attitude))[2, 2]
            go(plant, 20.0)
            now = stiffness * rotation(np.array(plant.attitude))[2, 2]
            return (plant.kinetic_energy_j + begin - now) / (stiffness - begin)

        yield Case(
            group, f"{name}: energy gained by a swing from 115 deg in 20 s, undamped", 0.0, "of it", swing_energy, 1e-4,
            ROUNDING,
        )  # fmt: skip
        as_is = vehicle(name).trimmed(SEA.density_kgm3, SEA.gravity_mps2)
        a, b = one.linear_damping[2], one.quadratic_damping[2]
        rise = step_response(mass_along(as_is, 2), a, b, 1.5, 3.0)[1]
        yield Case(
            group, f"{name}: rise by its 1.5 N in 3 s", rise, "m",
            lambda h, as_is=as_is: go(swim(as_is, h), 3.0).position_m[2] - DEEP[2], 1e-4,
        )  # fmt: skip
        lead = Load(2.0, 2.0 * 0.000088)
        net = 1.5 - 9.81 * (lead.mass_kg - SEA.density_kgm3 * lead.volume_m3)
        sunk = -step_response(mass_along(as_is, 2) + lead.mass_kg, a, b, -net, 3.0)[1]
        yield Case(
            group, f"{name}: way in 3 s with 2 kg of lead", sunk, "m",
            lambda h, as_is=as_is, lead=lead: go(swim(as_is, h, loads=(lead,)), 3.0).position_m[2] - DEEP[2], 1e-4,
        )  # fmt: skip
        low = 0.085  # thrust line under the centre of mass, m
        nose_up = math.degrees(math.asin(2.0 * low / stiffness))

        def pitch_up(step_s: float, one: Vehicle = one, low: float = low) -> float:
            plant = go(swim(one, step_s), 40.0, (2.0, 0.0, 0.0, 0.0, -2.0 * low, 0.0))
            return math.degrees(-roll_pitch_yaw_rad(plant.attitude)[1])

        yield Case(
            group, f"{name}, neutral: nose up by 2 N ahead, {low} m below", nose_up, "deg",
            pitch_up, 5e-3, "what 40 s leave of the swing to it",
        )  # fmt: skip
        share = 1.0 - 1.5 / (SEA.density_kgm3 * SEA.gravity_mps2 * as_is.volume_m3)
        floats = (0.5 - share) * as_is.size_m[2] - as_is.centre_of_buoyancy_m[2]
        yield Case(
            group, f"{name}: height of its origin when it floats", floats, "m",
            lambda h, as_is=as_is, floats=floats: go(
                swim(as_is, h, position_m=(0.0, 0.0, floats - 0.002)), 15.0
            ).position_m[2], 5e-3, "what 15 s leave of bobbing",
        )  # fmt: skip
    one = vehicle("benzon2022")
    yield Case(
        group, "lifted out and let go: fall in 0.5 s", -0.5 * SEA.gravity_mps2 * 0.25, "m",
        lambda h: go(swim(one, h, position_m=(0.0, 0.0, 3.0)), 0.5).position_m[2] - 3.0, 1e-9, "rounding",
    )  # fmt: skip
