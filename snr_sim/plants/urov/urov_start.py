"""Checks before a plant is made and a dive begins: the start is in the pool and in nothing solid, within the tether's
reach, and its thrusters exist.

The numbers themselves are checked where they are made (`dive.py`, `tether.py`, `pool.py`). Here they are checked
against vehicle and pool: at the start, not when a thruster is due to fail an hour into the dive.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from snr_sim.plants.attitude import rotation_of
from snr_sim.plants.parameter_limits import check_valid, is_number
from snr_sim.plants.urov.dive import Dive
from snr_sim.plants.urov.pool import Pool
from snr_sim.plants.urov.tether import Tether
from snr_sim.plants.urov.vehicle import Vehicle
from snr_sim.prelude.angles import quaternion_of
from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.sums import ordered_sum

# Depth in the floor at which a dive may begin: contacts are soft, and then push the vehicle out.
MAX_INITIAL_PENETRATION_M = 0.01
TAUT = 1.001  # factor of its length that a tether may be stretched to at the start


def check_parts(vehicle: Any, pool: Any, start_of: Any, thrusters: Any, step_s: Any) -> None:
    """Raise a ParameterError if a part is of another kind, or vehicle and propulsion differ in their thrusters."""
    for what, given, is_right, expected in (
        ("vehicle", vehicle, isinstance(vehicle, Vehicle), "a Vehicle; read_vehicle makes one of a file"),
        ("pool", pool, isinstance(pool, Pool), "a Pool"),
        ("start", start_of, callable(start_of), "a function that takes a seed and returns a Dive"),
        ("propulsion", thrusters, thrusters is None or hasattr(thrusters, "count"), "a Propulsion, or None"),
    ):
        check_valid(is_right, f"The {what}", given, f"give {expected}.")
    if not is_number(step_s) or not 0.0 < step_s <= 0.05:
        raise ParameterError(f"A vehicle under water in steps of {step_s} s.", fix="0.005 s is a good step.")
    if thrusters is not None and thrusters.count != len(vehicle.thrusters):
        raise ParameterError(
            f"'{vehicle.name}' has {len(vehicle.thrusters)} thrusters, its propulsion {thrusters.count}.",
            fix="give both the same number.",
        )


def check_start(dive: Any, seed: int, vehicle: Vehicle, pool: Pool, has_thrusters: bool, step_s: float) -> None:
    """Raise a ParameterError unless `dive` is a Dive, and one that is possible with vehicle and pool."""
    check_valid(isinstance(dive, Dive), f"The start of seed {seed}", dive, "give a function that returns a Dive.")
    x, y, z = dive.position_m
    if z < -pool.depth_m or abs(x) > 0.5 * pool.length_m or abs(y) > 0.5 * pool.width_m:
        raise ParameterError(f"The dive begins at {dive.position_m} m, which is not in the pool.", fix=pool.extent())
    if dive.faults and not has_thrusters:
        raise ParameterError("Thrusters fail in this dive, but there are none.", fix="give the plant thrusters.")
    _check_floats(dive, vehicle, pool)
    for fault in dive.faults:
        fault.number_in([thruster.name for thruster in vehicle.thrusters])
    if dive.tether is not None:
        _check_reach(dive, dive.tether)
        _check_swing(dive.tether, vehicle, step_s)


def check_clearance(dive: Dive, solid: str, depth_m: float, vehicle: Vehicle, pool: Pool) -> None:
    """Raise a ParameterError if a vehicle starts deeper than `MAX_INITIAL_PENETRATION_M` in something solid."""
    if depth_m > MAX_INITIAL_PENETRATION_M:
        size = " x ".join(f"{side:g}" for side in vehicle.size_m)
        raise ParameterError(
            f"The dive begins at {dive.position_m} m with the vehicle {100.0 * depth_m:.3g} cm deep in '{solid}'.",
            fix=f"begin farther from it: the vehicle is {size} m large, {pool.extent()}",
        )


def _check_floats(dive: Dive, vehicle: Vehicle, pool: Pool) -> None:
    """Check that no load could carry all of them: its buoyancy counts as if it were always under water."""
    for time_s in dive.times_s():
        loads = dive.loads_at(time_s)
        carried = pool.density_kgm3 * ordered_sum(load.volume_m3 for load in loads)
        mass = vehicle.mass_kg + ordered_sum(load.mass_kg for load in loads)
        if carried > mass:
            raise ParameterError(
                f"At {time_s:g} s the dive's loads displace {carried:.3g} kg of water, more than all weighs: "
                f"{mass:.3g} kg.",
                fix="look at volume_m3: with it they would float on their own, high and dry.",
            )


def _check_reach(dive: Dive, tether: Tether) -> None:
    turn = np.array(rotation_of(quaternion_of(*dive.attitude_rad))).reshape(3, 3)
    end = np.array(dive.position_m) + turn @ np.array(tether.attachment_m)  # decides no run: only checked
    away_m = math.dist(end.tolist(), tether.anchor_m)
    if away_m > TAUT * tether.length_m:
        raise ParameterError(
            f"The dive begins {away_m:.4g} m from where its tether is held, which is {tether.length_m:g} m long.",
            fix="begin nearer to the tether's anchor_m, or pay out more with length_m.",
        )


def _check_swing(tether: Tether, vehicle: Vehicle, step_s: float) -> None:
    """Check that a spring does not swing within a few steps; half of what is just stable is allowed."""
    mass, damping = vehicle.mass_kg + float(vehicle.added_mass[0, 0]), tether.damping_share
    swing = step_s * math.sqrt(tether.stiffness_npm / mass)
    if swing * (damping + math.sqrt(1.0 + damping * damping)) > 1.0:
        raise ParameterError(
            f"A tether of {tether.stiffness_npm:.3g} N/m is too stiff for steps of {1e3 * step_s:g} ms: at its end the "
            f"vehicle would swing {swing / (2.0 * math.pi * step_s):.3g} times a second.",
            fix="take a smaller modulus_pa, a longer tether or a shorter step_s.",
        )
