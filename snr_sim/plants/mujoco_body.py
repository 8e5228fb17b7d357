"""One free body in a MuJoCo world with more mass than MuJoCo's model has: the added mass of water, or a payload.

MuJoCo's step is split. After `detect_contacts` its own mass matrix M and forces are known; `move` adds to M,
factorises it again, applies the force that gives the requested acceleration, and leaves the rest to MuJoCo: contacts,
with the true mass.

MuJoCo's velocities of a free body are in the world frame for the linear part (of its origin) and in the body frame for
the angular part.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from snr_sim.plants.matrices import mujoco_mass_matrix
from snr_sim.plants.mujoco_engine import MujocoWorld
from snr_sim.plants.urov.vehicle import Matrix
from snr_sim.prelude.errors import ParameterError

FREE_JOINT = 0  # MuJoCo's mjJNT_FREE
# Times what friction can do to the dry body is asked of a contact that slides: at 1 friction is too weak, for a turning
# body is easier to move than its mass says; far above 4 what slides hops.
GRIP = 4.0
MIN_PRESSED_FRACTION = 0.1  # fraction of its weight by which a body counts as pressed at the first touch


class MujocoBody:
    """The body, found once in MuJoCo's arrays: each access there costs as much as a step's arithmetic.

    Raises a ParameterError if it does not move freely, has moving parts, or MuJoCo keeps only the diagonal of its mass
    matrix: then added mass that is not diagonal in the world would be lost without a word.
    """

    def __init__(self, world: MujocoWorld, name: str) -> None:
        model, data = world.model, world.data
        self._world, self._name = world, name
        self.engine: str = world.engine
        self._body = body = world.body_id(name)
        joint = int(model.body_jntadr[body])
        if int(model.body_parentid[body]) != 0 or joint < 0 or int(model.jnt_type[joint]) != FREE_JOINT:
            raise ParameterError(f"The body '{name}' does not move freely in the world.", fix="give it a <freejoint/>.")
        in_tree = [i for i in range(model.nbody) if model.body_rootid[i] == model.body_rootid[body]]
        if sum(int(model.body_dofnum[i]) for i in in_tree) != 6:
            raise ParameterError(f"The body '{name}' has parts that move.", fix="fix them to it.")
        first, dof = int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint])
        start, end = int(model.M_rowadr[dof]), int(model.M_rowadr[dof + 5] + model.M_rownnz[dof + 5])
        if end - start != 21:
            raise ParameterError(
                f"MuJoCo keeps only the diagonal of the mass matrix of '{name}', to which water adds more.",
                fix=f'write <body name="{name}" simple="false">.',
            )
        dofs = slice(dof, dof + 6)
        self._qpos, self._qvel = data.qpos[first : first + 7], data.qvel[dofs]
        self._applied, self._bias = data.qfrc_applied[dofs], data.qfrc_bias[dofs]
        self._touch = data.qfrc_constraint[dofs]
        self._mass = data.M[start:end]  # lower triangle, row by row
        self._lower = np.array([6 * i + j for i in range(6) for j in range(i + 1)])
        self._rotation = data.xmat[body]  # from the body's axes to the world's, row by row
        self._target, self._force = np.zeros(model.nv), np.zeros(model.nv)
        self._target_here, self._force_here = self._target[dofs], self._force[dofs]
        mujoco = world.mujoco
        self._step1, self._step2 = mujoco.mj_step1, mujoco.mj_step2
        self._factor, self._multiply = mujoco.mj_factorM, mujoco.mj_mulM
        self._model, self._data = model, data
        self._own_s = float(model.opt.timestep)
        self.has_others: bool = model.nv > 6  # whether there are other bodies that move
        self._kind = mujoco.mjtState.mjSTATE_INTEGRATION
        self._size = int(mujoco.mj_stateSize(model, self._kind))
        self._owners = model.geom_bodyid.tolist()  # of each geom
        self._geom = np.zeros((1, 1), dtype=np.int32)
        self.gravity_mps2: float = -float(model.opt.gravity[2])  # downwards
        self.rigid: Matrix = self._mass_at_rest()  # 6 x 6, of the dry body, in its axes about its origin
        self._weight_n = float(self.rigid[0, 0]) * abs(self.gravity_mps2)

    def _mass_at_rest(self) -> Matrix:
        """Return MuJoCo's mass matrix where its axes are the body's: without rotation."""
        self._qpos[3:] = 1.0, 0.0, 0.0, 0.0
        self.detect_contacts()
        flat = np.zeros(36)
        flat[self._lower] = self._mass
        flat[np.abs(flat) < 1e-12 * flat.max()] = 0.0  # what rounding left of a principal axis
        lower: Matrix = flat.reshape(6, 6)
        return lower + lower.T - np.diag(np.diag(lower))

    def put(self, pose: Sequence[float], velocity: Sequence[float]) -> None:
        """Set x, y, z [m] and quaternion w, x, y, z; velocity: linear in the world, angular in the body's frame."""
        self._qpos[:] = pose
        self._qvel[:] = velocity

    def clear(self) -> None:
        """Put the whole world back to its start."""
        self._world.mujoco.mj_resetData(self._model, self._data)

    def pose(self) -> list[float]:
        """Return x, y, z [m] and the quaternion w, x, y, z."""
        pose: list[float] = self._qpos.tolist()
        return pose

    def velocity(self) -> list[float]:
        """Return linear velocity in the world, then angular in the body's frame."""
        velocity: list[float] = self._qvel.tolist()
        return velocity

    def detect_contacts(self) -> bool:
        """Have MuJoCo find what touches, and its own mass matrix and forces; return whether anything touches.

        If not, and the body is alone, `put` can end the step as well as `move`, for a tenth of the time.
        """
        self._step1(self._model, self._data)
        return bool(self._data.nefc)

    def move(self, more: Matrix, acceleration: Sequence[float], step_s: float) -> None:
        """End the step that `detect_contacts` began.

        Args:
            more: 6 x 6 mass that MuJoCo's model does not have, in the body's axes.
            acceleration: that the body has if nothing touches, in MuJoCo's frames.
            step_s: step to advance by; contacts use the world's own step.
        """
        model, data = self._model, self._data
        self._mass += mujoco_mass_matrix(more, self._rotation.tolist())
        self._factor(model, data)
        self._target_here[:] = acceleration
        self._multiply(model, data, self._force, self._target)
        np.add(self._force_here, self._bias, out=self._applied)
        own_s = self._own_s
        if step_s == own_s:
            self._step2(model, data)
            return
        model.opt.timestep = step_s
        self._step2(model, data)
        model.opt.timestep = own_s

    def limit_grip(self, pressed_n: float) -> None:
        """Limit the friction that contacts of a sliding body request; call it between `detect_contacts` and `move`.

        MuJoCo asks a contact to stop what slides within its time constant, and finds friction and pressure in one: what
        it cannot have as friction it gives as pressure. A vehicle that slid at 1 m/s was thrown up by each contact; the
        pressure went from 0 to five times its mean. Source: MuJoCo's manual, Computation, on the elliptic cone: where
        friction is at its limit, pressure grows with the friction that is missing.

        Args:
            pressed_n: what contacts pushed in the last step.
        """
        data = self._data
        if not data.ncon or not self._model.opt.cone:
            return
        contact, asked, inverse_mass = data.contact, data.efc_aref.tolist(), data.efc_diagA.tolist()
        pressed_n = max(pressed_n, MIN_PRESSED_FRACTION * self._weight_n)
        lists = contact.efc_address.tolist(), contact.dim.tolist(), contact.geom.tolist(), contact.friction.tolist()
        for first, dim, (one, other), friction in zip(*lists, strict=True):  # so few are quicker without numpy
            if first < 0 or dim < 3 or self._body not in (self._owners[one], self._owners[other]):
                continue
            u, v = asked[first + 1], asked[first + 2]  # after the row of its pressure
            size, limit = math.hypot(u, v), GRIP * friction[0] * pressed_n * inverse_mass[first]
            if size > limit:
                data.efc_aref[first + 1 : first + 3] = u * limit / size, v * limit / size

    def touch(self) -> list[float]:
        """Return what contacts pushed in the last step: force in the world [N], moment in the body's frame [N m]."""
        touch: list[float] = self._touch.tolist()
        return touch

    def height_over_ground_m(self, point: Sequence[float]) -> float:
        """Return the distance straight down from a point to anything but the body; negative if there is nothing."""
        start, down = np.array(point), np.array([0.0, 0.0, -1.0])
        ray = self._world.mujoco.mj_ray
        return float(ray(self._model, self._data, start, down, None, 1, self._body, self._geom[0]))

    def deepest(self) -> tuple[str, float]:
        """Return what the body penetrates deepest, and how deep [m]; 0 if nothing. Call it after `detect_contacts`."""
        model, data = self._model, self._data
        solid, depth_m = "", 0.0
        for contact in data.contact[: data.ncon]:
            ours = [int(model.geom_bodyid[geom]) == self._body for geom in contact.geom]
            if any(ours) and -contact.dist > depth_m:
                geom = int(contact.geom[ours.index(True) - 1])
                owner = model.body(int(model.geom_bodyid[geom])).name
                solid, depth_m = model.geom(geom).name or owner or f"geom {geom}", -float(contact.dist)
        return solid, depth_m

    def snapshot(self) -> Any:
        """Return all of MuJoCo's state, also of other bodies."""
        buffer = np.zeros(self._size)
        self._world.mujoco.mj_getState(self._model, self._data, buffer, self._kind)
        return buffer

    def restore(self, snapshot: Any) -> None:
        """Put back what `snapshot` returned."""
        self._world.mujoco.mj_setState(self._model, self._data, snapshot, self._kind)
        self.detect_contacts()  # so that a ray meets everything where it is
