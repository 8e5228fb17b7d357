"""Stereo camera, lidar, and balls in the pictures of cameras, against the true distances."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from snr_sim.devices.sensors.camera import Camera
from snr_sim.devices.sensors.lidar import Lidar
from snr_sim.devices.sensors.ray_casting import BACKGROUND_RGB
from snr_sim.devices.sensors.stereo import StereoCamera
from snr_sim.prelude.errors import ParameterError, UnknownNameError
from snr_sim.prelude.signals import Ball, ViewReading

AIR = Camera(width_px=61, height_px=41, field_of_view_rad=math.radians(60.0), medium="air")
AHEAD = [1.0, 0.0, 0.0, 0.0]
FLOOR = {"floor": {"kind": "box", "half_size_m": [9.0, 9.0, 0.1], "center_m": [0.0, 0.0, -1.1], "rgb": [90, 90, 90]}}
RED = (200, 20, 20)


class Still:
    """A plant that shows balls from a place."""

    time_s = 0.0

    def __init__(self, balls: list[Ball], attitude: list[float] | None = None) -> None:
        self._view = ViewReading([0.0, 0.0, 0.0], attitude or AHEAD, balls, 0.0)

    def read(self, name: str) -> ViewReading:
        return self._view

    def scene(self) -> dict[str, Any]:
        return {"statics": FLOOR, "bodies": {}}


def test_ball_covers_the_solid_angle_of_its_size() -> None:
    """Of a small ball at 2 m, on the axis: a disc of radius r / d, in pixels."""
    camera = Camera(width_px=301, height_px=301, field_of_view_rad=math.radians(30.0), medium="air")
    rgb = camera.picture({}, [0.0, 0.0, 0.0], AHEAD, balls=[Ball((2.0, 0.0, 0.0), 0.2, RED)])
    covered = int((rgb[..., 0] > rgb[..., 2]).sum())  # exact: integers
    slant = 0.2 / math.sqrt(2.0**2 - 0.2**2)  # tangent of the cone that touches it
    assert covered == pytest.approx(math.pi * (slant / camera.pixel) ** 2, rel=0.01)


def test_nearest_ball_hides_those_behind_and_is_darker_on_its_sides() -> None:
    balls = [Ball((3.0, 0.0, 0.0), 0.3, (20, 20, 200)), Ball((1.5, 0.0, 0.0), 0.3, RED)]
    for order in (balls, balls[::-1]):
        rgb = AIR.picture(FLOOR, [0.0, 0.0, 0.0], AHEAD, balls=order)
        assert rgb[20, 30, 0] > 2 * rgb[20, 30, 2].astype(int)
        rows = np.nonzero(rgb[:, 30, 0] > 2 * rgb[:, 30, 1].astype(int))[0]
        assert rgb[rows[0], 30, 0] > rgb[rows[-1], 30, 0]  # from above, and from below


def test_floor_hides_a_ball_below_it_and_the_sky_is_where_nothing_is() -> None:
    rgb = AIR.picture(FLOOR, [0.0, 0.0, 0.0], AHEAD, balls=[Ball((3.0, 0.0, -1.6), 0.3, RED)])
    assert not (rgb[..., 0] > 2 * rgb[..., 1].astype(int)).any()
    assert tuple(rgb[0, 0]) == BACKGROUND_RGB
    assert tuple(rgb[-1, 30]) == (90, 90, 90)


def test_disparity_of_a_ball_is_that_of_its_distance() -> None:
    stereo = StereoCamera(AIR, baseline_m=0.2)
    for distance_m in (1.0, 2.0):
        reading = stereo.simulated(
            Still([Ball((distance_m, 0.0, 0.0), 0.1, RED)]),
            "view",
            np.random.default_rng(0),  # type: ignore[arg-type]
        ).read()
        middles = [
            float(np.nonzero(image[20, :, 0] > 2 * image[20, :, 1].astype(int))[0].mean())
            for image in (reading.left, reading.right)
        ]
        assert middles[0] - middles[1] == pytest.approx(0.2 / distance_m / AIR.pixel, abs=1.0)
        assert reading.baseline_m == 0.2


@pytest.mark.parametrize("heading", [0.0, 0.7, -2.0])
def test_lidar_measures_the_distance_to_a_ball_and_its_reach_elsewhere(heading: float) -> None:
    lidar = Lidar(rays=91, field_of_view_rad=math.pi, reach_m=5.0, noise_m=0.0)
    bearing = 0.4
    place = (2.0 * math.cos(heading + bearing), 2.0 * math.sin(heading + bearing), 0.0)
    attitude = [math.cos(0.5 * heading), 0.0, 0.0, math.sin(0.5 * heading)]
    reading = lidar.simulated(Still([Ball(place, 0.1, RED)], attitude), "view", np.random.default_rng(0)).read()  # type: ignore[arg-type]
    hit = min(range(91), key=lambda i: reading.ranges_m[i])
    off = reading.angles_rad[hit] - bearing
    expected_m = 2.0 * math.cos(off) - math.sqrt(0.1**2 - (2.0 * math.sin(off)) ** 2)
    assert reading.ranges_m[hit] == pytest.approx(expected_m, abs=1e-9)
    assert reading.angles_rad[hit] == pytest.approx(bearing, abs=0.02)
    width = 2.0 * math.asin(0.1 / 2.0) / (math.pi / 90)
    assert sum(one < 5.0 for one in reading.ranges_m) == pytest.approx(width, abs=1.0)  # exact: integers


def test_noise_of_the_lidar_is_as_stated() -> None:
    lidar = Lidar(rays=2000, reach_m=5.0, noise_m=0.02)
    sphere = Still([Ball((3.0, 0.0, 0.0), 2.0, RED)])
    noisy = lidar.simulated(sphere, "view", np.random.default_rng(0)).read()  # type: ignore[arg-type]
    clean = Lidar(rays=2000, reach_m=5.0, noise_m=0.0).simulated(sphere, "view", np.random.default_rng(0)).read()  # type: ignore[arg-type]
    errors = [a - b for a, b in zip(noisy.ranges_m, clean.ranges_m, strict=True) if b < 4.0]
    assert len(errors) > 500
    assert np.std(errors) == pytest.approx(0.02, rel=0.1)


def test_wrong_numbers_raise() -> None:
    with pytest.raises(UnknownNameError, match="'vacuum' is not a valid medium"):
        Camera(medium="vacuum")
    with pytest.raises(ParameterError, match="baseline_m"):
        StereoCamera(AIR, baseline_m=0.0)
    with pytest.raises(ParameterError, match="1 rays"):
        Lidar(rays=1)
    for name in ("field_of_view_rad", "reach_m", "period_s"):
        with pytest.raises(ParameterError, match=name):
            Lidar(**{name: math.nan})  # type: ignore[arg-type]
