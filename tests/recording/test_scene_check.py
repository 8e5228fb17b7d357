"""Scenes of traces that were changed: the viewer and pictures compute with them."""

from __future__ import annotations

from typing import Any

import pytest

from snr_sim.recording.scene_check import check_scene

TRIANGLE = {
    "kind": "mesh",
    "vertices_m": [[0, 0, 0], [1, 0, 0], [0, 1, 0]],
    "triangles": [[0, 1, 2]],
    "rgb": [0, 0, 255],
}
BOX = {"kind": "box", "half_size_m": [1, 1, 1], "center_m": [0.5, 0, 0], "rgb": [1, 2, 3], "label": "gate"}
FIELD = {
    "kind": "heightfield",
    "corner_m": [0, 0],
    "spacing_m": [1, 0.5],
    "shape": [2, 3],
    "heights_m": [0, 1, 2, 3, 4, 5],
    "rgb": [9, 9, 9],
}
LINE = {"kind": "polyline", "points_m": [[0, 0, 0]], "rgb": [1, 2, 3], "radius_m": 0.1}


def test_scene_of_known_and_later_kinds_is_accepted() -> None:
    check_scene({})
    check_scene(
        {"statics": {"a": TRIANGLE, "b": BOX, "c": {"kind": "sphere"}, "f": FIELD}, "bodies": {"d": [LINE]}, "later": 1}
    )


@pytest.mark.parametrize(
    "shape",
    [
        {**TRIANGLE, "triangles": [[0, 1, 3]]},
        {**TRIANGLE, "triangles": [[0, 1, -1]]},
        {**TRIANGLE, "triangles": [[0, 1, 1e9]]},
        {**TRIANGLE, "triangles": [[0, 1, 2**70]]},
        {**TRIANGLE, "triangles": [[0, 1, 2], [0, 1]]},
        {**TRIANGLE, "triangles": []},
        {**TRIANGLE, "vertices_m": [[0, 0, 0], [1, 0], [0, 1, 0]]},
        {**BOX, "half_size_m": [1, 1]},
        {**BOX, "center_m": "x"},
        {**BOX, "rgb": [0, 0, 256]},
        {**BOX, "label": 1},
        {**FIELD, "shape": [3, 3]},
        {**FIELD, "shape": [1, 6]},
        {**FIELD, "spacing_m": [1, 0]},
        {**FIELD, "heights_m": [0, 1, 2, 3, 4, None]},
        {"kind": "polyline", "rgb": [0, 0, 0]},
        1,
    ],
    ids=str,
)
def test_damaged_shape_is_an_error(shape: Any) -> None:
    for scene in ({"statics": {"a": shape}}, {"bodies": {"b": [shape]}}):
        with pytest.raises(ValueError, match=r"[a-z]"):
            check_scene(scene)
