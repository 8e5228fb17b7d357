import math
from collections import Counter
from itertools import pairwise
from typing import Any

import pytest

from snr_sim.plants.urov.pool import POST_M, Gate, Pool
from snr_sim.plants.urov.urov_shapes import pool_shapes, vehicle_shapes
from snr_sim.plants.urov.vehicle_file import read_vehicle
from tests.plants.vehicles import VEHICLES


def volume(mesh: dict[str, Any]) -> float:
    """Positive if all its sides face outwards."""
    total = 0.0
    for i, j, k in mesh["triangles"]:
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = (mesh["vertices_m"][n] for n in (i, j, k))
        total += ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
    return total / 6.0


@pytest.mark.parametrize("name", ["benzon2022", "classic"])
def test_thruster_shape_is_closed_duct_at_its_position(name: str) -> None:
    vehicle = read_vehicle(VEHICLES / f"{name}.toml")
    meshes = [shape for shape in vehicle_shapes(vehicle) if shape["kind"] == "mesh"]
    ducts = meshes[-len(vehicle.thrusters) :]
    for mesh in meshes:
        edges = Counter(edge for triangle in mesh["triangles"] for edge in pairwise([*triangle, triangle[0]]))
        assert all(count == 1 and edges[b, a] == 1 for (a, b), count in edges.items())
        assert volume(mesh) > 0.0
    for duct, thruster in zip(ducts, vehicle.thrusters, strict=True):
        middle = [sum(axis) / len(duct["vertices_m"]) for axis in zip(*duct["vertices_m"], strict=True)]
        assert middle == pytest.approx(thruster.position_m, abs=1e-4)


def test_gate_and_floor_shapes_equal_physics() -> None:
    pool = Pool(gates=(Gate("red", (2.0, 1.0, -1.5), width_m=1.2),))
    shapes = pool_shapes(pool)
    gate = shapes["red"]
    assert gate["radius_m"] == POST_M
    assert math.dist(gate["points_m"][0], gate["points_m"][3]) == pytest.approx(1.2)
    assert gate["label"] == "red"
    floor = next(shape for name, shape in shapes.items() if "floor" in name and shape["kind"] == "mesh")
    assert {z for _, _, z in floor["vertices_m"]} == {-pool.depth_m}
    assert volume(floor) < 0.0  # seen from the origin above it, its upper side faces in


def test_floor_lines_are_one_metre_apart_from_wall_to_wall() -> None:
    pool = Pool(length_m=6.0, width_m=3.0, depth_m=2.0)
    shapes = pool_shapes(pool)
    north, east = shapes["lines_north"]["points_m"], shapes["lines_east"]["points_m"]
    assert {x for x, _, _ in north} == {-3.0, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0}
    assert {y for _, y, _ in north} == {-1.5, 1.5}
    assert {y for _, y, _ in east} == {-1.0, 0.0, 1.0}
    assert all((a[0] == b[0]) != (a[1] == b[1]) for line in (north, east) for a, b in pairwise(line))
