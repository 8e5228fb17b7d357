"""Geometry of the scene of a flight or a drive over the ground."""

import math

import pytest

from snr_sim.plants.shapes import box
from snr_sim.view.picture_scene import lowest_m

LEVEL = [0.0, 0.0, 0.0, 1.0]


def test_lowest_point_is_that_of_all_bodies_in_their_poses() -> None:
    bodies = {
        "chassis": [box([0.0, 0.0, 0.3], [0.4, 0.2, 0.1], [0, 0, 0])],
        "wheel": [box([0.0, 0.0, 0.0], [0.1, 0.1, 0.1], [0, 0, 0])],
    }
    assert lowest_m(bodies, {"chassis": [5.0, 2.0, 1.0, *LEVEL], "wheel": [5.4, 2.0, 1.15, *LEVEL]}) == pytest.approx(
        0.05
    )
    assert lowest_m({"chassis": bodies["chassis"]}, {"chassis": [5.0, 2.0, 1.0, *LEVEL]}) == pytest.approx(0.2)


def test_lowest_point_is_in_the_frame_of_a_body_that_lies_on_its_side() -> None:
    side = [math.sin(math.pi / 4.0), 0.0, 0.0, math.cos(math.pi / 4.0)]  # a quarter turn about x: up is to the right
    bodies = {
        "chassis": [box([0.0, 0.0, 0.3], [0.4, 0.2, 0.1], [0, 0, 0])],
        "wheel": [box([0.0] * 3, [0.1] * 3, [0, 0, 0])],
    }
    # The wheel is 0.5 m below the chassis in its frame, whose z axis points to -y of the world.
    assert lowest_m(bodies, {"chassis": [0.0, 0.0, 1.0, *side], "wheel": [0.0, 0.5, 1.0, *side]}) == pytest.approx(-0.6)
