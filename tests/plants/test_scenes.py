"""Scenes of the landers: the formats that plant.py defines for the viewer and the recorder."""

import json
import math
from typing import Any

import pytest

from snr_sim.plants.lander.descent import Engine
from snr_sim.plants.lander.lander import Lander
from snr_sim.plants.lander.lander_1d import Lander1D, VerticalStart
from snr_sim.plants.lander.lander_2d import Lander2D
from snr_sim.plants.lander.lander_3d import Lander3D
from snr_sim.plants.lander.module import LunarModule, PlaneStart
from snr_sim.plants.lander.terrain import make_terrain
from snr_sim.prelude.signals import EngineCommand


@pytest.fixture(params=["lander_1d", Lander2D, Lander3D])
def plant(request: pytest.FixtureRequest, apollo: LunarModule) -> Lander1D | Lander:
    if request.param == "lander_1d":
        return Lander1D(lambda seed: VerticalStart(100.0, 0.0, 8000.0, 500.0), Engine(45040.0, 3049.9))
    start = PlaneStart((5.0, 90.0), (1.0, -2.0), 7500.0, 500.0, attitude_rad=0.2)
    body: type[Lander2D | Lander3D] = request.param
    return body(apollo, lambda seed: (start, make_terrain(seed, 5.0)))


def shapes(scene: dict[str, Any]) -> list[dict[str, Any]]:
    return [*scene["statics"].values(), *(shape for body in scene["bodies"].values() for shape in body)]


def test_scene_is_json_of_documented_kinds(plant: Lander1D | Lander) -> None:
    scene = plant.scene()
    assert json.loads(json.dumps(scene)) == scene
    for shape in shapes(scene):
        assert len(shape["rgb"]) == 3
        assert all(0 <= value <= 255 for value in shape["rgb"])
        if shape["kind"] == "mesh":
            corners = {i for triangle in shape["triangles"] for i in triangle}
            assert corners == set(range(len(shape["vertices_m"])))
        elif shape["kind"] == "polyline":
            assert len(shape["points_m"]) > 1
            assert shape["radius_m"] > 0.0
        else:
            assert shape["kind"] == "box"
            assert len(shape["half_size_m"]) == len(shape["center_m"]) == 3


def test_module_meshes_are_closed_and_face_outwards(plant: Lander1D | Lander) -> None:
    meshes = [s for body in plant.scene()["bodies"].values() for s in body if s["kind"] == "mesh"]
    assert meshes
    for mesh in meshes:
        corners = mesh["vertices_m"]
        volume = 0.0
        for i, j, k in mesh["triangles"]:
            (ax, ay, az), (bx, by, bz), (cx, cy, cz) = corners[i], corners[j], corners[k]
            volume += ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
        assert volume > 0.0


def test_truth_is_json_with_bodies_of_scene(plant: Lander1D | Lander) -> None:
    plant.write("engine", EngineCommand(0.5, 0.0, 0.4))
    for _ in range(20):
        plant.step(plant.step_s or 0.1)
    truth = plant.truth()
    assert json.loads(json.dumps(truth)) == truth
    assert set(truth["poses"]) == set(plant.scene()["bodies"])
    assert {"altitude_m", "vertical_mps", "lateral_mps", "throttle", "fuel_kg", "attitude_deg"} <= set(truth["values"])
    for pose in truth["poses"].values():
        assert math.hypot(*pose[3:]) == pytest.approx(1.0)
    assert truth["vectors"]["thrust"][5] > 1000.0


@pytest.mark.parametrize("body", [Lander2D, Lander3D])
def test_thrust_vector_is_along_module_and_jets_are_a_pair(
    apollo: LunarModule, body: type[Lander2D | Lander3D]
) -> None:
    start = PlaneStart((0.0, 90.0), (0.0, 0.0), 7500.0, 500.0, attitude_rad=0.3)
    plant = body(apollo, lambda seed: (start, make_terrain(seed, 5.0)))
    plant.write("engine", EngineCommand(0.5, 0.0, 0.4))
    for _ in range(200):
        plant.step(0.005)
    arrows, (_, _, _, _, qy, _, qw) = plant.truth()["vectors"], plant.truth()["poses"]["module"]
    tilt = -2.0 * math.atan2(qy, qw)  # about -y
    thrust = arrows["thrust"]
    assert math.atan2(-thrust[3], thrust[5]) == pytest.approx(tilt)
    left, right = arrows["jet_left"], arrows["jet_right"]
    assert [a + b for a, b in zip(left[3:], right[3:], strict=True)] == [0.0, 0.0, 0.0]
    assert right[5] > 0.0  # a positive couple lifts the right side
