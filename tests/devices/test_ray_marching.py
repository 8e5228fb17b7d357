"""Rays that meet a height field: a tilted plane in closed form, and hills as the triangles that viewers draw."""

import math
from typing import Any

import numpy as np
import pytest

from snr_sim.devices.sensors.lidar import Lidar
from snr_sim.devices.sensors.ray_casting import Rays, intersect_scene
from snr_sim.plants.ground.height_map import HeightMap, flat, make_hills, ramp
from snr_sim.plants.ground.rover_shapes import ground_shape
from snr_sim.plants.outputs import PoseOutput
from snr_sim.recording.scene import as_mesh
from snr_sim.view.picture_bodies import faces_of

Origin = tuple[float, float, float]


def seen(origin: Origin, directions: Any, *shapes: dict[str, Any]) -> Rays:
    x, y, z = np.array(directions, float).T
    rays = Rays(origin, (x, y, z), 1e-3)
    intersect_scene(rays, {str(i): shape for i, shape in enumerate(shapes)})
    return rays


def around(pitch: float, count: int = 90) -> list[tuple[float, float, float]]:
    return [
        (math.cos(2.0 * math.pi * i / count), math.sin(2.0 * math.pi * i / count), math.tan(pitch))
        for i in range(count)
    ]


def test_rays_meet_a_tilted_plane_where_its_equation_says() -> None:
    slopes, origin = (0.2, -0.1), (0.3, -0.7, 1.4)
    directions = [*around(-0.3), *around(0.05), *around(0.5), (0.0, 0.0, -1.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.2)]
    found = seen(origin, directions, ground_shape(ramp(slopes, 20.0))).depths
    above_m = origin[2] - (slopes[0] * origin[0] + slopes[1] * origin[1])
    expected = []
    for x, y, z in directions:
        sinks = slopes[0] * x + slopes[1] * y - z
        depth = above_m / sinks if sinks > 0.0 else math.inf
        is_in = depth < math.inf and max(abs(origin[0] + depth * x), abs(origin[1] + depth * y)) <= 10.0
        expected.append(depth if is_in else math.inf)
    assert found.tolist() == pytest.approx(expected, abs=1e-4)
    assert 90 < np.isfinite(found).sum() < len(directions), "some meet it, and some do not"


def test_field_is_shaded_and_covered_as_other_shapes_are() -> None:
    wall = {"kind": "box", "center_m": [2.0, 0.0, 0.0], "half_size_m": [0.1, 5.0, 5.0], "rgb": [1, 2, 3]}
    field = ground_shape(flat(20.0))
    rays = seen((0.0, 0.0, 1.0), [(1.0, 0.0, -1.0), (1.0, 0.0, -0.2)], field, wall)
    assert rays.depths.tolist() == pytest.approx([1.0, 1.9], abs=1e-5)
    assert rays.colors.tolist()[0] == field["rgb"], "level ground is as bright as it can be"
    assert max(rays.colors.tolist()[1]) <= 3.0, "a wall that is nearer hides it"


def test_hills_are_met_where_the_triangles_of_viewers_are() -> None:
    """Pictures draw its faces. A square of the field is curved: triangles differ by some centimetres."""
    field = ground_shape(make_hills(2, 0.5, size_m=24.0))
    origin, directions = (0.5, 1.0, 1.0), [*around(-0.12, 40), *around(-0.4, 20)]
    marched = seen(origin, directions, field).depths
    triangles = seen(origin, directions, as_mesh(field)).depths
    rows, columns = field["shape"]
    assert faces_of(as_mesh(field)).shape == (2 * (rows - 1) * (columns - 1), 3, 3)
    both = np.isfinite(marched) & np.isfinite(triangles)
    assert both.sum() >= 50
    assert (np.isfinite(marched) != np.isfinite(triangles)).sum() <= 1, "at an edge of the field"
    assert float(np.median(np.abs(marched[both] - triangles[both]))) < 0.02


def test_lidar_sees_a_rise_at_the_distance_at_which_its_plane_cuts_it() -> None:
    """Level up to x = 3, then 1 in 4: what is 0.4 m up meets it at x = 4.6."""
    along = [0.5 * i - 10.0 for i in range(41)]
    ground = HeightMap([[max(0.0, 0.25 * (x - 3.0)) for x in along] for _ in along], 0.5, (along[0], along[0]))

    class Standing:
        time_s = 0.0

        def scene(self) -> dict[str, Any]:
            return {"statics": {"ground": ground_shape(ground)}, "bodies": {}}

        def read(self, name: str) -> PoseOutput:
            return PoseOutput([0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], 0.0)

    lidar = Lidar(3, math.pi, 8.0, 0.0, 0.1, (0.0, 0.0, 0.4)).simulated(Standing(), "pose", np.random.default_rng(0))  # type: ignore[arg-type]
    lidar.configure()
    lidar.activate()
    assert lidar.read().ranges_m == pytest.approx([8.0, 4.6, 8.0], abs=1e-4)
