"""Where wheels touch the ground: the plane under each, its load, and what soil of that place does to it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from operator import itemgetter
from struct import Struct
from typing import Any

import numpy as np

from snr_sim.plants.ground.height_map import LEVEL, HeightMap, Plane
from snr_sim.plants.ground.rover_vehicle import RoverVehicle
from snr_sim.plants.ground.terramechanics import Coulomb, Ground, slip_of
from snr_sim.plants.mujoco_engine import MujocoWorld

PLACE_STEPS = 20  # until the nearest point of the ground is found, from none
SOIL_STEPS = 10  # the kind of ground under a wheel is looked up each 0.02 s
BELLY_STEPS, BELLY_MAX_STEPS = 5, 50  # the belly's plane is laid so often, and less often where the ground is far
BELLY_MORE_MPS = 1.0  # what the belly can gain in speed until then, 0.1 s: as in free fall
CREEP_MPS = 0.01  # below this speed the resistance of soil falls to 0 with it: where nothing moves there is none

AWAY_M = 1000.0
SoilAt = Callable[[float, float], Ground]


class WheelContacts:
    """The contacts of all wheels, and of the belly, with ground and rocks.

    Attributes:
        hit_n: the largest pressure of a rock on anything so far.
        hits: how often something began to touch a rock.
        planes: the ground under each wheel.
    """

    def __init__(self, vehicle: RoverVehicle, world: MujocoWorld, ground: HeightMap, soil_at: SoilAt) -> None:
        model, data, count = world.model, world.data, len(vehicle.wheels)
        self._vehicle, self._data, self._ground, self._soil_at = vehicle, data, ground, soil_at
        bodies = [int(model.body(f"wheel_{wheel.name}").id) for wheel in vehicle.wheels]
        self._bodies, self._count = np.array(bodies), count
        self._radii_m = [wheel.radius_m for wheel in vehicle.wheels]
        self._places, self._offsets = data.xpos.reshape(-1), [slice(3 * body, 3 * body + 3) for body in bodies]
        self._dofs = [int(model.joint(f"wheel_{wheel.name}").dofadr[0]) for wheel in vehicle.wheels]
        # Packing numbers into an array takes half the time of assigning a list to it.
        self._write_places, self._write_turns = Struct(f"{3 * count}d").pack_into, Struct(f"{4 * count}d").pack_into
        self._plane_pos, self._plane_quat = data.mocap_pos[:count], data.mocap_quat[:count]
        self._belly_pos, self._belly_quat = data.mocap_pos[count], data.mocap_quat[count]
        self._pairs = model.pair_friction[:count, :2]
        self._velocities = data.sensordata[: 3 * count].reshape(count, 3)
        self._axles = data.sensordata[3 * count : 6 * count].reshape(count, 3)
        self._forces, self._drags = data.xfrc_applied, np.zeros((count, 6))
        self._write_drags = Struct(f"{6 * count}d").pack_into
        self._chassis = int(model.body("chassis").id)
        (length, width, height), (x, y, z) = vehicle.size_m, vehicle.center_m
        self._belly = [
            (x + 0.5 * a * length, y + 0.5 * b * width, z - 0.5 * height) for a in (-1, 0, 1) for b in (-1, 0, 1)
        ]
        self._belly_reach_m = max(math.dist((0.0, 0.0, 0.0), point) for point in self._belly)
        self._step_s = float(model.opt.timestep)

    def reset(self) -> None:
        """Find the ground under each wheel, where the wheels are now."""
        self._loads: list[float] | None = None
        self.hit_n: float = 0.0
        self.hits: int = 0
        self._touching: frozenset[int] = frozenset()
        self.planes: list[Plane] = [LEVEL] * self._count
        self._soils: list[Ground] = []
        self._is_firm = False
        for _ in range(PLACE_STEPS):
            self.lay_planes()
        self._forces[self._bodies] = 0.0
        self._look_up_soil()
        self._set_friction([scale * forces(0.0, 0.0)[0] for scale, forces in self._on_soil])
        self._lay_belly()
        self._belly_free = 0

    def lay_planes(self) -> None:
        """Lay the plane of each wheel at the ground nearest to it."""
        places_m = self._places.tolist()
        self.planes = planes = self._ground.planes_under([places_m[at] for at in self._offsets], self.planes)
        positions: list[float] = []
        quaternions: list[float] = []
        for x, y, z, nx, ny, nz in planes:
            positions += (x, y, z)
            quaternions += quaternion_to(nx, ny, nz)
        self._write_places(self._plane_pos, 0, *positions)
        self._write_turns(self._plane_quat, 0, *quaternions)

    def before_step(self, steps: int) -> None:
        """Prepare the contacts of the step with this number."""
        self.lay_planes()
        if steps % SOIL_STEPS == 0:
            self._look_up_soil()
        self._belly_free -= 1
        if self._belly_free <= 0 and steps % BELLY_STEPS == 0:
            self._lay_belly()

    def after_step(self, velocities: Sequence[float]) -> None:
        """Take over loads and touched rocks of a step; set friction and resistance of soft soil for the next.

        Args:
            velocities: MuJoCo's, before the step.
        """
        if self._data.ncon > self._count:
            self._note_rocks()
        elif self._touching:
            self._touching = frozenset()
        self._loads = None
        if not self._is_firm:
            self._apply_soil([velocities[dof] for dof in self._dofs])

    def _look_up_soil(self) -> None:
        """Find the kind of ground under each wheel; firm ground has one friction, whatever the wheel does."""
        before, soil_at = self._soils, self._soil_at
        self._soils = soils = [soil_at(plane[0], plane[1]) for plane in self.planes]
        if soils == before:
            return
        self._note_soils()
        self._is_firm = all(isinstance(soil, Coulomb) for soil in soils)
        if self._is_firm:
            self._forces[self._bodies] = 0.0
            self._set_friction([scale * forces(0.0, 0.0)[0] for scale, forces in self._on_soil])

    def _note_soils(self) -> None:
        """Note what gives the forces of the soil under each wheel."""
        self._on_soil = [
            (wheel.friction_scale, soil.under(wheel.radius_m, wheel.width_m))
            for wheel, soil in zip(self._vehicle.wheels, self._soils, strict=True)
        ]

    def _set_friction(self, values: list[float]) -> None:
        self._frictions = values
        self._pairs[:] = [(value, value) for value in values]

    def _apply_soil(self, rates: Sequence[float]) -> None:
        """Set friction and resistance of each wheel from load and slip."""
        frictions: list[float] = []
        resistances: list[float] = []
        loads, radii, places_m = self.read_loads(), self._radii_m, self._places.tolist()
        centers = [places_m[at] for at in self._offsets]
        moving = zip(centers, self._velocities.tolist(), self._axles.tolist(), rates, strict=True)
        for radius_m, (scale, forces), load, (px, py, pz, nx, ny, nz), (
            (x, y, z),
            (vx, vy, vz),
            (ax, ay, az),
            rate,
        ) in zip(radii, self._on_soil, loads, self.planes, moving, strict=True):
            above_m = (x - px) * nx + (y - py) * ny + (z - pz) * nz
            fx, fy, fz = ay * nz - az * ny, az * nx - ax * nz, ax * ny - ay * nx  # ahead, along the ground
            forward, across = vx * fx + vy * fy + vz * fz, vx * ax + vy * ay + vz * az
            friction, back_n = forces(slip_of(rate * 0.5 * (radius_m + above_m), forward, across), load)
            frictions.append(scale * friction)
            back_n /= math.sqrt(forward * forward + across * across + CREEP_MPS * CREEP_MPS)
            up = vx * nx + vy * ny + vz * nz
            resistances += -back_n * (vx - up * nx), -back_n * (vy - up * ny), -back_n * (vz - up * nz), 0.0, 0.0, 0.0
        self._set_friction(frictions)
        self._write_drags(self._drags.data, 0, *resistances)
        self._forces[self._bodies] = self._drags

    def read_loads(self) -> list[float]:
        """Return the pressure of the ground on each wheel in the last step [N]."""
        if self._loads is not None:
            return self._loads
        loads, contact, forces = [0.0] * self._count, self._data.contact, self._data.efc_force.tolist()
        for geom, row in zip(contact.geom[:, 0].tolist(), contact.efc_address.tolist(), strict=True):
            if geom < self._count and row >= 0:  # the planes are the first of all
                loads[geom] = forces[row]
        self._loads = loads
        return loads

    def _note_rocks(self) -> None:
        """Count contacts with rocks, which come after the planes and the belly's."""
        contact, forces = self._data.contact, self._data.efc_force.tolist()
        touching = set()
        for (one, other), row in zip(contact.geom.tolist(), contact.efc_address.tolist(), strict=True):
            if row >= 0 and min(one, other) > self._count:
                touching.add(one * 1000 + other)
                self.hit_n = max(self.hit_n, forces[row])
        self.hits += len(touching - self._touching)
        self._touching = frozenset(touching)

    def _lay_belly(self) -> None:
        """Lay the belly's plane under that of its points which is nearest to the ground; find when it is due again."""
        data, at = self._data, self._ground.at
        (x, y, z), rotation = data.xpos[self._chassis].tolist(), data.xmat[self._chassis].tolist()
        a, b, c, d, e, f, g, h, i = rotation
        points = [
            (x + a * u + b * v + c * w, y + d * u + e * v + f * w, z + g * u + h * v + i * w) for u, v, w in self._belly
        ]
        heights = ((pz - at(px, py)[0], px, py) for px, py, pz in points)
        above_m, lowest_x, lowest_y = min(heights, key=itemgetter(0))
        px, py, pz, nx, ny, nz = self._ground.plane_at(lowest_x, lowest_y)
        self._belly_pos[:] = px, py, pz
        self._belly_quat[:] = quaternion_to(nx, ny, nz)
        above_m = min(above_m, *((qx - px) * nx + (qy - py) * ny + (qz - pz) * nz for qx, qy, qz in points))
        vx, vy, vz, *turns = data.qvel[:6].tolist()
        fastest_mps = math.hypot(vx, vy, vz) + math.hypot(*turns) * self._belly_reach_m + BELLY_MORE_MPS
        # Twice, on a steep slope; `min` has its first argument of NaN.
        self._belly_free = int(min(float(BELLY_MAX_STEPS), above_m / (2.0 * fastest_mps * self._step_s)))
        if self._belly_free > BELLY_STEPS:
            self._belly_pos[2] -= AWAY_M  # a plane that was laid long ago must not touch

    def snapshot(self) -> tuple[Any, ...]:
        """Return all of its state that MuJoCo's does not hold."""
        known = tuple(self.planes), tuple(self._soils), self._is_firm, tuple(self._frictions)
        return (*known, tuple(self.read_loads()), self.hit_n, self.hits, self._touching, self._belly_free)

    def restore(self, snapshot: tuple[Any, ...]) -> None:
        """Put back what `snapshot` returned."""
        planes, soils, self._is_firm, frictions, loads, self.hit_n, self.hits, *rest = snapshot
        self._touching, self._belly_free = rest
        self.planes, self._soils, self._loads = list(planes), list(soils), list(loads)
        self._note_soils()
        self._set_friction(list(frictions))


def quaternion_to(nx: float, ny: float, nz: float) -> tuple[float, float, float, float]:
    """Return the shortest turn that brings z to a unit vector that points up."""
    size = 1.0 / math.sqrt(2.0 + 2.0 * nz)
    return (1.0 + nz) * size, -ny * size, nx * size, 0.0
