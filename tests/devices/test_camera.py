import math
from dataclasses import replace
from typing import Any

import msgspec
import numpy as np
import pytest

from snr_sim.devices.sensors.camera import DIRECTIONS, Camera, CameraReading, PixelRays, rotate_vector
from snr_sim.devices.sensors.ray_casting import Rays, intersect_scene
from snr_sim.plants.outputs import PoseOutput
from snr_sim.plants.urov.dive import Dive
from snr_sim.plants.urov.pool import Gate, Pool
from snr_sim.plants.urov.urov_2d import Urov2D
from snr_sim.prelude.errors import ParameterError, SnrError, UnknownNameError
from snr_sim.prelude.signals import Ball
from snr_sim.prelude.values import decode_value, encode_value
from snr_sim.testing.contracts import check_sensor
from snr_sim.testing.fakes import FakePlant
from tests.plants.vehicles import HEAVY

UPRIGHT = [1.0, 0.0, 0.0, 0.0]
ABOVE = [0.0, 0.0, 2.0]  # in air: no absorption on the way down except by the veil
SQUARE = Camera("down", 80, 80, math.radians(90.0))  # 1 m away it sees 2 m x 2 m, a pixel is 25 mm


def box(center_m: list[float], half_size_m: list[float], rgb: tuple[int, int, int] = (255, 0, 0)) -> dict[str, Any]:
    return {"kind": "box", "half_size_m": half_size_m, "center_m": center_m, "rgb": list(rgb)}


def floor(z_m: float) -> dict[str, Any]:
    corners = [[x, y, z_m] for x, y in ((50.0, 50.0), (-50.0, 50.0), (-50.0, -50.0), (50.0, -50.0))]
    return {"kind": "mesh", "vertices_m": corners, "triangles": [[0, 1, 2], [0, 2, 3]], "rgb": [100, 100, 100]}


def reddish(rgb: Any) -> Any:
    return rgb[..., 0] > rgb[..., 1].astype(int) + 40


class SeenPlant(FakePlant):
    """A vehicle above a box."""

    def scene(self) -> dict[str, Any]:
        return {"statics": {"box": box([0.0, 0.0, -3.0], [0.2, 0.2, 0.2])}, "bodies": {}}


def opened(camera: Camera) -> Any:
    plant = SeenPlant({"pose": PoseOutput([0.0, 0.0, -1.0], UPRIGHT, 0.0)})
    return plant, camera.simulated(plant, "pose", np.random.default_rng(1))


def test_camera_passes_sensor_contract() -> None:
    check_sensor(lambda: opened(Camera("down"))[1])


@pytest.mark.parametrize(("away_m", "half_m"), [(2.0, 0.5), (2.0, 0.3), (4.0, 0.5), (1.0, 0.25)])
def test_camera_box_covers_expected_pixels(away_m: float, half_m: float) -> None:
    top = 2.0 - away_m
    scene = {"box": box([0.0, 0.0, top - 0.1], [half_m, half_m, 0.1]), "floor": floor(top - 0.2)}
    without = SQUARE.picture({"floor": scene["floor"]}, ABOVE, UPRIGHT)
    seen = (SQUARE.picture(scene, ABOVE, UPRIGHT) != without).any(axis=2)
    side_px = 2.0 * half_m / (away_m * SQUARE.pixel)  # 20, 12, 10, 20: whole numbers, so each edge lies between pixels
    assert seen.sum() == round(side_px) ** 2
    for axis in (0, 1):
        edges = np.flatnonzero(seen.any(axis=axis))[[0, -1]]
        assert edges.tolist() == [40 - round(side_px / 2), 39 + round(side_px / 2)]


def test_camera_down_image_follows_vehicle_heading() -> None:
    scene = {"box": box([1.0, 0.5, 0.0], [0.1, 0.1, 0.01])}
    where = np.argwhere(reddish(SQUARE.picture(scene, ABOVE, UPRIGHT)))
    assert where.mean(axis=0).tolist() == pytest.approx([39.5 - 20.0, 39.5 - 10.0], abs=0.6)
    turned = [math.cos(math.pi / 4), 0.0, 0.0, math.sin(math.pi / 4)]  # heads north: the box is to starboard, ahead
    where = np.argwhere(reddish(SQUARE.picture(scene, ABOVE, turned)))
    assert where.mean(axis=0).tolist() == pytest.approx([39.5 - 10.0, 39.5 + 20.0], abs=0.6)


def test_camera_ahead_excludes_objects_behind() -> None:
    ahead = Camera("ahead", 80, 80, math.radians(90.0))
    above = np.argwhere(reddish(ahead.picture({"box": box([2.0, 0.5, 3.0], [0.01, 0.1, 0.1])}, ABOVE, UPRIGHT)))
    assert above.mean(axis=0).tolist() == pytest.approx([39.5 - 20.0, 39.5 - 10.0], abs=0.6)
    assert not reddish(ahead.picture({"box": box([-2.0, 0.0, 2.0], [0.1, 0.1, 0.1])}, ABOVE, UPRIGHT)).any()


def test_camera_nearer_object_hides_farther_in_any_order() -> None:
    near, far = box([0.0, 0.0, 1.0], [3.0, 3.0, 0.1], (0, 255, 0)), box([0.0, 0.0, 0.0], [3.0, 3.0, 0.1])
    for scene in ({"near": near, "far": far}, {"far": far, "near": near}):
        rgb = SQUARE.picture(scene, ABOVE, UPRIGHT)
        assert not reddish(rgb).any()
        assert (rgb[..., 1] > 200).all()


def test_camera_bar_is_at_least_one_pixel_wide() -> None:
    bar = {"kind": "polyline", "points_m": [[-9.0, 0.0, 0.0], [9.0, 0.0, 0.0]], "rgb": [255, 0, 0]}
    for radius_m, wide_px in ((0.25, 10), (0.001, 1)):
        position_m = [0.0, 0.0 if wide_px > 1 else 0.5 * 2.0 * SQUARE.pixel, 2.0]  # the thin one in a pixel's middle
        seen = reddish(SQUARE.picture({"bar": bar | {"radius_m": radius_m}}, position_m, UPRIGHT))
        assert set(seen.sum(axis=1)) == {wide_px}


def test_camera_thin_bar_between_rows_is_visible() -> None:
    bar = {"kind": "polyline", "points_m": [[3.0, -9.0, 2.0], [3.0, 9.0, 2.0]], "radius_m": 0.001, "rgb": [255, 0, 0]}
    seen = reddish(Camera("ahead").picture({"bar": bar}, ABOVE, UPRIGHT))
    assert seen[23:25].any(axis=0).all()
    assert not seen[:23].any()
    assert not seen[25:].any()


def test_camera_deep_water_attenuates_red_most() -> None:
    shown = []
    for depth_m in (0.5, 2.0, 4.0):
        scene = {"box": box([0.0, 0.0, -depth_m - 0.6], [2.0, 2.0, 0.1], (200, 200, 200))}
        shown.append(SQUARE.picture(scene, [0.0, 0.0, -depth_m], UPRIGHT)[40, 40].astype(float))
    for before, after in ((shown[0], shown[1]), (shown[1], shown[2])):
        lost = 1.0 - after / before
        assert lost[0] > lost[1] > lost[2] > 0.0
    # Light travels through 1.5 m more water on the way down; the veil, which adds some, is as thick.
    assert shown[1][0] / shown[0][0] == pytest.approx(math.exp(-0.340 * 1.5), rel=0.03)


def test_camera_returns_one_image_per_period() -> None:
    plant, sensor = opened(Camera("down"))
    stamps = []
    for _ in range(10):
        stamps.append(sensor.read().stamp_s)
        plant.step(0.05)
    assert stamps == pytest.approx([0.0] * 4 + [0.2] * 4 + [0.4] * 2)


def test_camera_image_is_read_only_and_survives_recording() -> None:
    reading: CameraReading = opened(Camera("down"))[1].read()
    assert (reading.rgb.shape, reading.rgb.dtype) == ((48, 64, 3), np.uint8)
    with pytest.raises(ValueError, match="read-only"):
        reading.rgb[0, 0, 0] = 1
    data = msgspec.structs.asdict(reading)
    back = decode_value(encode_value(data))
    assert (back["rgb"].dtype, back["rgb"].tobytes()) == (np.uint8, reading.rgb.tobytes())


@pytest.mark.parametrize(
    ("numbers", "error"),
    [
        ({"direction": "donw"}, UnknownNameError),
        ({"width_px": 0}, ParameterError),
        ({"height_px": 5000}, ParameterError),
        ({"field_of_view_rad": math.pi}, ParameterError),
        ({"period_s": 0.0}, ParameterError),
    ],
)
def test_camera_invalid_number_raises_error(numbers: dict[str, Any], error: type[SnrError]) -> None:
    with pytest.raises(error, match=r"[Cc]amera"):
        Camera(**numbers)


def test_camera_in_2d_plant_shows_gate() -> None:
    pool = Pool(gates=(Gate("red", (2.0, 0.0, -2.0)),))
    plant = Urov2D(HEAVY, pool, lambda seed: Dive(position_m=(0.0, 0.0, -2.0)))
    without = Urov2D(HEAVY, Pool(), lambda seed: Dive(position_m=(0.0, 0.0, -2.0)))
    rng = np.random.default_rng(1)
    with_gate, empty = (Camera("ahead").simulated(one, "pose", rng).read().rgb for one in (plant, without))
    is_gate = (with_gate != empty).any(axis=2)
    assert is_gate[:, :32].any()
    assert is_gate[:, 32:].any()
    assert not is_gate[20:28, 28:36].any()  # it looks through the middle


def test_camera_murky_water_and_cloud_reduce_contrast() -> None:
    scene = {"box": box([0.0, 0.0, -1.0], [0.5, 0.5, 0.1]), "floor": floor(-2.0)}
    position_m = [0.0, 0.0, 0.5]

    def contrast(camera: Camera, time_s: float = 0.0) -> int:
        red = camera.picture(scene, position_m, UPRIGHT, time_s)[..., 0].astype(int)
        return int(red.max() - red.min())

    clear = contrast(SQUARE)
    assert 0 < contrast(replace(SQUARE, backscatter_per_m=1.0)) < clear / 2
    clouded = replace(SQUARE, clouds=((2.0, 3.0, 9.0),))
    assert [contrast(clouded, time_s) for time_s in (1.9, 2.0, 2.9, 3.0)] == [clear, 0, 0, clear]


def test_camera_negative_backscatter_raises_error() -> None:
    for camera in ({"backscatter_per_m": -1.0}, {"clouds": ((0.0, 1.0, math.nan),)}):
        with pytest.raises(ParameterError, match="backscatter_per_m"):
            Camera(**camera)  # type: ignore[arg-type]


@pytest.mark.parametrize("seed", range(20))
def test_pixels_that_a_shape_is_computed_for_are_all_that_show_it(seed: int) -> None:
    """`Rays` without an order computes each shape for all rays; attitudes and positions are random."""
    rng = np.random.default_rng(seed)
    bar = {
        "kind": "polyline",
        "points_m": rng.uniform(-2.0, 2.0, (5, 3)).tolist(),
        "radius_m": 0.03,
        "rgb": [0, 255, 0],
    }
    scene = {"floor": floor(-1.5), "box": box([1.0, 0.5, -1.0], [0.3, 0.4, 0.5]), "bar": bar}
    attitude = rng.normal(size=4)
    unit = (attitude / math.sqrt(float((attitude * attitude).sum()))).tolist()
    axes = [rotate_vector(unit, vector) for vector in DIRECTIONS["ahead"]]
    x, y, z = rng.uniform(-1.0, 1.0, 3).tolist()
    balls = [Ball((a, b, c), 0.2, (0, 0, 255)) for a, b, c in rng.uniform(-2.0, 2.0, (20, 3)).tolist()]
    pixels = PixelRays((x, y, z), axes, (50, 30), 0.04)
    plain = Rays((x, y, z), pixels.directions, pixels.pixel)
    for rays in (pixels, plain):
        with np.errstate(divide="ignore", invalid="ignore"):
            intersect_scene(rays, scene, balls)
    assert np.isfinite(plain.depths).any()
    np.testing.assert_allclose(pixels.depths, plain.depths, rtol=1e-9)
    np.testing.assert_allclose(pixels.colors, plain.colors, rtol=1e-9)
