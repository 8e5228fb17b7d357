"""Checks of a user's MJCF world for the underwater vehicle: what it must not contain, because the plant computes it.

The water is the plant's (`hydrodynamics.py`), and where nothing touches, the plant moves the vehicle without MuJoCo.
So anything that would push, damp or carry the vehicle inside MuJoCo would count twice, or only during contact. It is
rejected, and the message says where it belongs. Geometry, contacts, solver and other bodies of the world are used.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from typing import Any

import numpy as np

from snr_sim.plants.mujoco_engine import MujocoWorld
from snr_sim.plants.parameter_limits import LIMITS, check_number
from snr_sim.plants.urov.pool import Pool
from snr_sim.plants.urov.vehicle import Vehicle
from snr_sim.prelude.errors import ParameterError

OURS = "the plant's own water takes the place of MuJoCo's fluid"
MUJOCO_STEP_S = 0.002  # of a text that states none
HALF = "where nothing touches, the plant moves the vehicle by its own equation, and this would be left out"


def check_mjcf(world: MujocoWorld, mjcf: str, body: str, pool: Pool, step_s: float) -> None:
    """Raise a ParameterError unless a world, made of a text, leaves water, weight and step to the plant.

    The message says what it found, why it is refused and where it belongs.
    """
    for found, fix in (*_options(world, mjcf, pool, step_s), *_forces(world, body)):
        raise ParameterError(f"The MJCF has {found}.", fix=fix)


def check_mass(vehicle: Vehicle, mass_kg: float) -> None:
    """Check that the mass a world gives the vehicle can be that of the vehicle's volume."""
    check_number("The MJCF's mass of the vehicle", mass_kg, LIMITS["mass_kg"])
    by_volume = mass_kg / vehicle.volume_m3
    check_number(f"The MJCF's mass of {mass_kg:g} kg by the vehicle's volume", by_volume, LIMITS["density_kgm3"])


def _options(world: MujocoWorld, mjcf: str, pool: Pool, step_s: float) -> Iterator[tuple[str, str]]:
    """Yield what the <option> element sets without effect, and the fix."""
    mujoco, option = world.mujoco, world.model.opt
    if option.density or option.viscosity:
        yield (
            f'density="{option.density:g}" viscosity="{option.viscosity:g}"',
            f"take them out: {OURS}, whose density is Pool(density_kgm3={pool.density_kgm3:g}).",
        )
    if np.any(option.wind):
        yield (
            f'wind="{_row(option.wind)}"',
            f"take it out: {OURS}; a current is Dive(currents=(Current(0.0, ({_row(option.wind, ', ')})),)).",
        )
    if not np.allclose(option.gravity, (0.0, 0.0, -pool.gravity_mps2), rtol=1e-9, atol=0.0):
        yield (
            f'gravity="{_row(option.gravity)}"',
            "use the same value in both: buoyancy and depth are computed with "
            f"Pool(gravity_mps2={pool.gravity_mps2:g}), straight down.",
        )
    if option.disableflags & int(mujoco.mjtDisableBit.mjDSBL_GRAVITY):
        yield '<flag gravity="disable"/>', "take it out: buoyancy would be left without a weight."
    if option.enableflags & int(mujoco.mjtEnableBit.mjENBL_SLEEP):
        yield '<flag sleep="enable"/>', "take it out: water moves a vehicle that MuJoCo believes to be asleep."
    if option.integrator != int(mujoco.mjtIntegrator.mjINT_EULER):
        name = mujoco.mjtIntegrator(option.integrator).name.removeprefix("mjINT_")
        yield (
            f'integrator="{name}"',
            'take it out, or write "Euler": the plant puts the added mass into the one step that Euler makes, and '
            "integrates the water itself, to the second order.",
        )
    wrong_s = _stated_steps_s(mjcf, world.own_step_s) - {step_s}
    if wrong_s:
        yield (
            f'timestep="{min(wrong_s):g}"',
            f"the plant takes steps of {step_s:g} s: take the timestep out, or give Urov step_s={min(wrong_s):g}.",
        )


def _stated_steps_s(mjcf: str, own_step_s: float) -> set[float]:
    """Return the timesteps that a text states; a compiled world does not show whether its default was stated."""
    try:
        options = ElementTree.fromstring(mjcf).iter("option")
        stated = {float(one.attrib["timestep"]) for one in options if "timestep" in one.attrib}
    except (ElementTree.ParseError, ValueError):  # MuJoCo has read it, by rules of its own
        stated = set()
    return stated or {own_step_s} - {MUJOCO_STEP_S}


def _forces(world: MujocoWorld, name: str) -> Iterator[tuple[str, str]]:
    """Yield what would push, damp or carry the vehicle's body inside MuJoCo, and why it may not."""
    model: Any = world.model
    body = world.body_id(name)
    start, count = int(model.body_dofadr[body]), int(model.body_dofnum[body])
    for what in ("damping", "armature", "frictionloss"):
        if np.any(getattr(model, f"dof_{what}")[start : start + count]):
            yield (
                f"a joint of '{name}' with {what}",
                f"take it out: {HALF}; drag and added mass belong in the vehicle's file.",
            )
    if count and model.jnt_stiffness[model.body_jntadr[body]]:
        yield f"a joint of '{name}' with stiffness", f"take it out: {HALF}."
    if model.body_gravcomp[body]:
        yield f"gravcomp at '{name}'", "take it out: buoyancy is volume_m3 of the vehicle, at its centre_of_buoyancy_m."
    if np.any(model.geom_fluid[:, 0]):
        yield "a geom with fluidshape", f"take it out: {OURS}."
    if np.any(model.tendon_stiffness) or np.any(model.tendon_damping):
        yield "a tendon that is a spring or a damper", f"take it out: {HALF}; a tether is Dive(tether=Tether(...))."
    if model.nu:
        yield f"{model.nu} actuators", "take them out: nothing drives them; thrusters belong in the vehicle's file."


def _row(values: Any, between: str = " ") -> str:
    return between.join(f"{value:g}" for value in values)
