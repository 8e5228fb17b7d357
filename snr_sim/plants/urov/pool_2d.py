"""A cut through the pool along x, under pymunk: it moves the vehicle in the plane and detects contacts.

What stands across the cut is there as far as the cut meets it: floor, the walls to the east and west, and each gate's
bars as two round spots. pymunk's own contacts stay unused (`impulses_2d.py` gives the reason): the vehicle's outline is
held against the pool by queries.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TypeAlias

from snr_sim.plants.impulses_2d import Contact, contacts_of
from snr_sim.plants.pymunk_engine import pymunk_module
from snr_sim.plants.urov.flotation import point_mass
from snr_sim.plants.urov.pool import POST_M, Gate, Pool
from snr_sim.plants.urov.vehicle import Matrix, Vehicle

THICK_M = 5.0  # of floor and walls, so that deep penetrations are pushed out in the right direction
HIGH_M = 1000.0  # walls rise over the water without end, as MuJoCo's planes do

PlanePose: TypeAlias = tuple[float, float, float]  # x, z [m], and pitch [rad] or, moving, their rates


class Pool2D:
    """A vehicle in the cut at its own y."""

    def __init__(self, pool: Pool, vehicle: Vehicle) -> None:
        pymunk = pymunk_module()
        self.engine: str = f"pymunk {pymunk.version}"
        self.gravity_mps2: float = pool.gravity_mps2  # downwards
        self.rigid: Matrix = point_mass(vehicle.mass_kg, vehicle.centre_of_mass_m)  # of the dry vehicle, body frame
        self.rigid[3:, 3:] += vehicle.inertia_kgm2
        self._pymunk, self._pool = pymunk, pool
        length, _, self._height_m = vehicle.size_m
        self._body = pymunk.Body(vehicle.mass_kg, float(vehicle.inertia_kgm2[1, 1]))
        self._frame = pymunk.Poly.create_box(self._body, (length, self._height_m))
        self._reach_m = 0.5 * math.hypot(length, self._height_m) + POST_M
        self._build(0.0)

    def _build(self, y_m: float) -> None:
        pymunk, pool = self._pymunk, self._pool
        self._y_m = y_m
        self._space = space = pymunk.Space()
        half, floor, top = 0.5 * pool.length_m, -pool.depth_m, HIGH_M
        far = half + THICK_M
        solid = {
            "floor": [(-far, floor - THICK_M), (far, floor - THICK_M), (far, floor), (-far, floor)],
            "wall_east": [(half, floor), (far, floor), (far, top), (half, top)],
            "wall_west": [(-far, floor), (-half, floor), (-half, top), (-far, top)],
        }
        bars = [(gate.name, bar) for gate in pool.gates for bar in _bars(gate, y_m)]
        self._bars = [bar for _, bar in bars]
        self._solids = {pymunk.Poly(space.static_body, corners): name for name, corners in solid.items()}
        self._solids |= {pymunk.Circle(space.static_body, POST_M, bar): name for name, bar in bars}
        space.add(self._body, *self._solids)

    def clear(self) -> None:
        """Put the vehicle at rest in the middle of the surface."""
        self.set_pose(0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))

    def put(self, pose: Sequence[float], velocity: Sequence[float]) -> None:
        """Set the vehicle's pose, as `MujocoBody.put` does; only what lies in the plane counts."""
        x, y, z, qw, _, qy, _ = pose
        self.set_pose(y, (x, z, 2.0 * math.atan2(qy, qw)), (velocity[0], velocity[2], velocity[4]))

    def set_pose(self, y_m: float, pose: PlanePose, motion: PlanePose) -> None:
        """Set the vehicle's pose, bitwise."""
        if y_m != self._y_m:
            self._space.remove(self._body)
            self._build(y_m)
        body = self._body
        # pymunk turns the other way: from x to z, which is nose up.
        body.position, body.angle = (pose[0], pose[1]), -pose[2]
        body.velocity, body.angular_velocity = (motion[0], motion[1]), -motion[2]

    def plane_pose(self) -> PlanePose:
        """Return x, z and pitch."""
        body = self._body
        x, z = body.position
        return x, z, -body.angle

    def snapshot(self) -> tuple[float, PlanePose, PlanePose]:
        """Return y, x, z and pitch, and the rates of the last three."""
        body = self._body
        vx, vz = body.velocity
        return self._y_m, self.plane_pose(), (vx, vz, -body.angular_velocity)

    def restore(self, snapshot: tuple[float, PlanePose, PlanePose]) -> None:
        """Put back what `snapshot` returned."""
        self.set_pose(*snapshot)

    def drift(self, dt_s: float) -> None:
        """Move on at the velocity it has."""
        self._space.step(dt_s)

    def move_at(self, motion: PlanePose) -> None:
        """Give it another velocity."""
        body = self._body
        body.velocity, body.angular_velocity = (motion[0], motion[1]), -motion[2]

    def contacts(self) -> list[Contact]:
        """Return where the frame touches something."""
        x, z, _ = self.plane_pose()
        pool, reach = self._pool, self._reach_m
        is_far = z - reach > -pool.depth_m and abs(x) + reach < 0.5 * pool.length_m
        if is_far and all(math.hypot(x - bar_x, z - bar_z) > reach for bar_x, bar_z in self._bars):
            return []
        return [contact for _, contact in self._hits()]

    def deepest(self) -> tuple[str, float]:
        """Return what the vehicle penetrates deepest, and how deep [m]; 0 if nothing."""
        solid, depth_m = "", 0.0
        for name, contact in self._hits():
            if contact.depth_m > depth_m:
                solid, depth_m = name, contact.depth_m
        return solid, depth_m

    def _hits(self) -> Iterator[tuple[str, Contact]]:
        x, z, _ = self.plane_pose()
        self._frame.cache_bb()
        for hit in self._space.shape_query(self._frame):
            name = self._solids[hit.shape]
            if not any(hit.contact_point_set.normal):  # a bar in the centre of the frame has no direction: use up
                yield name, Contact(0.0, 1.0, 0.0, 0.0, 0.5 * self._height_m + POST_M)
                continue
            for contact in contacts_of(hit, x, z):
                yield name, contact

    def height_over_ground_m(self, point: Sequence[float]) -> float:
        """Return the distance straight down from a point to anything; negative if there is nothing."""
        x, _, z = point
        low = z - 2.0 * self._pool.depth_m - 10.0
        hit = self._space.segment_query_first((x, z), (x, low), 0.0, self._pymunk.ShapeFilter())
        return -1.0 if hit is None else float(z - hit.point[1])


def _bars(gate: Gate, y_m: float) -> list[tuple[float, float]]:
    """Return where the cut at a y meets the upper and the lower bar of a gate: x and z."""
    x, y, z = gate.position_m
    along = -math.sin(gate.heading_rad), math.cos(gate.heading_rad)
    if abs(y_m - y) > 0.5 * gate.width_m * abs(along[1]) or abs(along[1]) < 1e-9:
        return []
    at = x + (y_m - y) / along[1] * along[0]
    return [(at, z + 0.5 * gate.height_m), (at, z - 0.5 * gate.height_m)]
