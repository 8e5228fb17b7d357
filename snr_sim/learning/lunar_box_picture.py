"""A frame of the world of `LunarLanderBox` as an array of pixels."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from snr_sim.learning.lunar_box_world import CHUNKS, HEIGHT, HULL, LEG, PAD_Y, WIDTH, LunarBoxWorld
from snr_sim.view.picture_bodies import FLAME
from snr_sim.view.picture_sheet import PIXELS_PER_POINT, Part, Point, Rgb, Sheet

WIDTH_PX, HEIGHT_PX = 600, 400
BACKGROUND: Rgb = (24, 27, 38)
GROUND: Rgb = (128, 125, 120)
BODY: Rgb = (150, 140, 220)
LEG_RGB: Rgb = (104, 98, 160)
POLE: Rgb = (230, 230, 230)
FLAG: Rgb = (240, 200, 60)


def frame_of(world: LunarBoxWorld, power: tuple[float, float]) -> NDArray[np.uint8]:
    """Return the frame of a world, shape (400, 600, 3).

    The power of the main engine, 0 to 1, and of the orientation engines, -1 (left) to 1 (right), is drawn as flames.
    """
    width, height = WIDTH_PX // PIXELS_PER_POINT, HEIGHT_PX // PIXELS_PER_POINT

    def at(x: float, y: float) -> Point:
        return x / WIDTH * width, height - y / HEIGHT * height

    def of(body: Any, corners: list[tuple[float, float]], rgb: Rgb) -> Part:
        return Part(np.array([at(*body.local_to_world(corner)) for corner in corners]), rgb)

    ground = [at(WIDTH / (CHUNKS - 1) * i, y) for i, y in enumerate(world.heights)]
    parts = [
        Part(
            np.array(
                [(-2.0, height + 2), (-2.0, ground[0][1]), *ground, (width + 2, ground[-1][1]), (width + 2, height + 2)]
            ),
            GROUND,
        )
    ]
    parts += [of(leg, LEG, LEG_RGB) for leg in world.legs]
    main, side = power
    if main:
        parts.append(of(world.hull, [(-0.2, -0.33), (0.2, -0.33), (0.0, -0.5 - 1.2 * main)], FLAME[0]))
    if side:
        out = 0.55 if side > 0 else -0.55
        parts.append(of(world.hull, [(out, 0.55), (out, 0.35), (out + 0.7 * side, 0.45)], FLAME[1]))
    parts.append(of(world.hull, HULL, BODY))
    for i in (CHUNKS // 2 - 1, CHUNKS // 2 + 1):
        x = WIDTH / (CHUNKS - 1) * i
        parts.append(Part(np.array([at(x, PAD_Y), at(x, PAD_Y + 1.6)]), POLE, 1.0))
        parts.append(Part(np.array([at(x, PAD_Y + 1.6), at(x, PAD_Y + 1.2), at(x + 0.8, PAD_Y + 1.4)]), FLAG))
    sheet = Sheet(width, height, BACKGROUND)
    sheet.paint(parts)
    return sheet.pixels()
