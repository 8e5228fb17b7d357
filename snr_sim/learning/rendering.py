"""One frame of a plant's scene as an array of pixels, drawn on the sheet that the pictures of runs are drawn on."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from snr_sim.recording.columns import Floats
from snr_sim.recording.scene import points_of, world_from_body
from snr_sim.view.picture_bodies import FLAME, JET, body_parts, flame_parts, strongest_of
from snr_sim.view.picture_layout import SheetPosition, feet_and_size
from snr_sim.view.picture_scene import ground_cuts, ground_parts
from snr_sim.view.picture_sheet import PIXELS_PER_POINT, Part, Rgb, Sheet
from snr_sim.view.picture_water import SURFACE, WATER, rectangle

WIDTH_PX, HEIGHT_PX = 320, 240
BACKGROUND: Rgb = (24, 27, 38)
MIN_SHOWN_M = 8.0  # of height; a body is drawn at least so large that it can be seen
MIN_BODY_FRACTION = 0.12  # fraction of the frame's height


class Frame:
    """Draws frames of a plant's scene: from the south, as high as it takes to have the ground and the body in it."""

    def __init__(self, scene: dict[str, Any]) -> None:
        self._bodies = scene["bodies"]
        self._cuts = ground_cuts(scene["statics"])
        self._ground = np.concatenate([np.empty((0, 2)), *(cut.reshape(-1, 2) for _, cut in self._cuts)])
        surface = scene["statics"].get("surface")
        # Of water, if there is any.
        self._surface_m = None if surface is None else float(points_of(surface)[:, 2].max())
        self._feet_m, self._size_m = feet_and_size(self._bodies)
        self._strongest_n = 1e-9  # greatest thrust so far: flames are drawn relative to it

    def draw(self, truth: dict[str, Any]) -> NDArray[np.uint8]:
        """Return the frame of a true state, shape (240, 320, 3)."""
        width, height = WIDTH_PX // PIXELS_PER_POINT, HEIGHT_PX // PIXELS_PER_POINT
        poses = truth["poses"]
        feet = world_from_body(next(iter(poses.values())), [0.0, 0.0, self._feet_m])
        near = self._ground[abs(self._ground[:, 0] - feet[0]) < 50.0, 1]
        low_m = min(feet[2], near.min(initial=np.inf))
        highest_m = max(feet[2] + self._size_m, self._surface_m if self._surface_m is not None else feet[2])
        shown_m = max(MIN_SHOWN_M, 1.35 * (highest_m - low_m), 2.5 * self._size_m)
        scale = height / shown_m

        def at(x: Floats | float, z: Floats | float) -> Floats:
            return np.stack([width / 2 + (x - feet[0]) * scale, height - (z - low_m + 0.12 * shown_m) * scale], -1)

        parts = []
        if self._surface_m is not None:
            y0 = at(feet[0], self._surface_m)[1]
            parts += [
                Part(rectangle(-2, y0, width + 2, height + 2), WATER),
                Part(np.array([(-2, y0), (width + 2, y0)]), SURFACE, 1.0),
            ]
        across = feet[0] + 0.5 * width / scale * np.linspace(-1.02, 1.02, WIDTH_PX)
        parts += ground_parts(self._cuts, at, across, height + 2, BACKGROUND, 1.0)
        body_scale = max(scale, MIN_BODY_FRACTION * height / self._size_m)
        place = SheetPosition(at(feet[0], feet[2]), feet, body_scale)
        self._strongest_n = max(self._strongest_n, strongest_of([truth["vectors"]]))
        points_per_newton = 0.8 * self._size_m * body_scale / self._strongest_n
        colors = FLAME if self._surface_m is None else JET
        parts += flame_parts(place, truth["vectors"], points_per_newton, colors)
        parts += body_parts(place, [(shape, poses[body]) for body in poses for shape in self._bodies[body]])
        sheet = Sheet(width, height, BACKGROUND)
        sheet.paint(parts)
        return sheet.pixels()
