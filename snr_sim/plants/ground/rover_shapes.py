"""Shapes of a rover, of the ground and of what lies on it, for the viewer. Metres."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from snr_sim.plants.ground.height_map import HeightMap
from snr_sim.plants.ground.rocks import Obstacle
from snr_sim.plants.ground.rover_vehicle import RoverVehicle
from snr_sim.plants.shapes import box, height_field, mesh, polyline

GROUND_RGB = [184, 142, 104]
CHASSIS_RGB = [214, 214, 220]
WHEEL_RGB = [48, 48, 54]
ARM_RGB = [120, 124, 132]
SPOKE_RGB = [200, 170, 60]
GROUND_SIDE = 60  # squares along a side of the ground, at most
WHEEL_SIDES = 12
ARM_M = 0.02  # half the thickness of rockers and bogies


def rover_scene(vehicle: RoverVehicle, ground: HeightMap, obstacles: Sequence[Obstacle]) -> dict[str, Any]:
    """Return ground, obstacles and the shapes of a rover."""
    statics = {"ground": ground_shape(ground)}
    statics.update((f"obstacle_{i}", one.shape()) for i, one in enumerate(obstacles))
    return {"statics": statics, "bodies": rover_shapes(vehicle)}


def ground_shape(ground: HeightMap) -> dict[str, Any]:
    """Return the ground as heights of places that are evenly apart."""
    size = [ground.spacing_m * (count - 2) for count in (ground.columns, ground.rows)]
    first = [corner + 0.5 * ground.spacing_m for corner in ground.corner_m]
    columns, rows = (min(GROUND_SIDE, count - 2) for count in (ground.columns, ground.rows))
    spacing = [size[0] / columns, size[1] / rows]
    xs = [first[0] + spacing[0] * i for i in range(columns + 1)]
    ys = [first[1] + spacing[1] * i for i in range(rows + 1)]
    return height_field(first, spacing, [[ground.at(x, y)[0] for x in xs] for y in ys], GROUND_RGB)


def rover_shapes(vehicle: RoverVehicle) -> dict[str, list[dict[str, Any]]]:
    """Return the shapes of each body, in its own frame."""
    chassis = [box(list(vehicle.center_m), [0.5 * x for x in vehicle.size_m], CHASSIS_RGB)]
    bodies = {"chassis": chassis}
    if hung := vehicle.suspension:
        for side in ("left", "right"):
            ours = [wheel for wheel in vehicle.wheels if wheel.side == side]
            (rx, rz), (bx, bz) = hung.rocker_pivot_m, hung.bogie_pivot_m
            on_rocker, on_bogie = ([w.position_m for w in ours if w.hangs_on == part] for part in ("rocker", "bogie"))
            bodies[f"rocker_{side}"] = [_bar(x - rx, z - rz) for x, _, z in on_rocker] + [_bar(bx - rx, bz - rz)]
            bodies[f"bogie_{side}"] = [_bar(x - bx, z - bz) for x, _, z in on_bogie]
    if vehicle.arm:
        for rod in vehicle.arm.rods:
            bodies[rod.name] = [polyline([[0.0, 0.0, 0.0], [rod.length_m, 0.0, 0.0]], SPOKE_RGB, ARM_M)]
    bodies.update((f"wheel_{wheel.name}", _wheel(wheel.radius_m, wheel.width_m)) for wheel in vehicle.wheels)
    return bodies


def _bar(x_m: float, z_m: float) -> dict[str, Any]:
    return polyline([[0.0, 0.0, 0.0], [x_m, 0.0, z_m]], ARM_RGB, ARM_M)


def _wheel(radius_m: float, width_m: float) -> list[dict[str, Any]]:
    """Return a wheel about the y axis, with a bar across it that shows how it turns."""
    n, half = WHEEL_SIDES, 0.5 * width_m
    angles = [2.0 * math.pi * k / n for k in range(n)]
    rim = [[radius_m * math.cos(a), side * half, radius_m * math.sin(a)] for side in (-1.0, 1.0) for a in angles]
    tread = [[k, (k + 1) % n, n + k] for k in range(n)] + [[(k + 1) % n, n + (k + 1) % n, n + k] for k in range(n)]
    sides = [[s, s + k, s + k + 1] for s in (0, n) for k in range(1, n - 1)]
    spoke = box([0.0, 0.0, 0.0], [0.85 * radius_m, half + 0.004, 0.1 * radius_m], SPOKE_RGB)
    return [mesh(rim, tread + sides, WHEEL_RGB), spoke]
