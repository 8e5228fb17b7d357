"""One frame of a plant's scene as an array of pixels, drawn on the canvas that the pictures of runs are drawn on."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from snr_sim.recording.scene import points_of, turned
from snr_sim.view.picture_bodies import FLAME, JET, draw_flames, draw_shapes, strongest_of
from snr_sim.view.picture_canvas import PIXELS_PER_POINT, Canvas, Point, Rgb, mixed
from snr_sim.view.picture_layout import Place, feet_and_size
from snr_sim.view.picture_water import SURFACE, WATER
from snr_sim.view.picture_world import ground_cuts, within

WIDTH_PX, HEIGHT_PX = 320, 240
SKY: Rgb = (24, 27, 38)
LEAST_SHOWN_M = 8.0  # of height; a body is drawn at least so large that it can be seen
LEAST_BODY = 0.12  # share of the frame's height


class Frame:
    """Draws frames of one scene: seen from the south, as high as it takes to have the ground and the body in it.

    Args:
        scene: of the plant.
    """

    def __init__(self, scene: dict[str, Any]) -> None:
        self._bodies = scene["bodies"]
        self._cuts = ground_cuts(scene["statics"])
        surface = scene["statics"].get("surface")
        # Of water, if there is any.
        self._surface_m = None if surface is None else float(points_of(surface)[:, 2].max())
        self._feet_m, self._size_m = feet_and_size(self._bodies)
        self._strongest_n = 1e-9  # of what has pushed so far: flames are drawn beside it

    def draw(self, truth: dict[str, Any]) -> NDArray[np.uint8]:
        """Returns the frame of a true state, shape (240, 320, 3)."""
        width, height = WIDTH_PX // PIXELS_PER_POINT, HEIGHT_PX // PIXELS_PER_POINT
        canvas = Canvas(width, height, SKY)
        poses = truth["poses"]
        main = next(iter(poses.values()))
        feet = turned(main, [0.0, 0.0, self._feet_m])
        low_m = min(
            [feet[2], *(z for _, cut in self._cuts for ends in cut for x, z in ends if abs(x - feet[0]) < 50.0)]
        )
        highest_m = max(feet[2] + self._size_m, self._surface_m if self._surface_m is not None else feet[2])
        shown_m = max(LEAST_SHOWN_M, 1.35 * (highest_m - low_m), 2.5 * self._size_m)
        scale = height / shown_m

        def at(x: float, z: float) -> Point:
            return width / 2 + (x - feet[0]) * scale, height - (z - low_m + 0.12 * shown_m) * scale

        if self._surface_m is not None:
            _, y0 = at(0.0, self._surface_m)
            canvas.rectangle(0, y0, width, height, fill=WATER)
            canvas.line([(0, y0), (width, y0)], SURFACE, 1.0)
        half_m = 0.5 * width / scale
        for i, (color, cut) in enumerate(self._cuts):
            for start, end in within(cut, feet[0] - half_m, feet[0] + half_m):
                (x0, y0), (x1, y1) = at(*start), at(*end)
                if i == 0:
                    canvas.polygon([(x0, y0), (x1, y1), (x1, height), (x0, height)], mixed(SKY, color, 0.55))
                canvas.line([(x0, y0), (x1, y1)], mixed(color, (255, 255, 255), 0.15), 1.0 if i == 0 else 2.0)
        body_scale = max(scale, LEAST_BODY * height / self._size_m)
        place = Place(at(feet[0], feet[2]), feet, body_scale)
        self._strongest_n = max(self._strongest_n, strongest_of([truth["arrows"]]))
        points_per_newton = 0.8 * self._size_m * body_scale / self._strongest_n
        draw_flames(canvas, place, truth["arrows"], points_per_newton, FLAME if self._surface_m is None else JET)
        draw_shapes(canvas, place, [(shape, poses[body]) for body in poses for shape in self._bodies[body]])
        pixels: NDArray[np.uint8] = canvas.pixels()
        return pixels
