"""Shapes of the lunar module: stages, legs, bell and jets as meshes, in metres from its centre of mass.

Only the viewer sees these. Where a shape has a part in the physics too (feet, nozzle, hull), its position is a constant
here and the plants take it from here, so that the picture cannot show another module than the one that flies.
"""

from __future__ import annotations

import math
from typing import Any

from snr_sim.plants.shapes import box, mesh, polyline

# The module stands 7 m tall and 9.4 m across opposite feet. Seen square to a side, two feet are 6.6 m apart. The
# centre of mass, half way between the stages when the descent tanks are nearly empty, is an estimate.
PADS_BELOW_M = 3.6
PADS_APART_M = 6.6
NOZZLE_BELOW_M = 3.1  # an estimate: it leaves half a metre of clearance under the bell
JETS_OUT_M = 1.68  # arm of the attitude jets; an estimate
# Outline in the x-z plane that must not touch the ground: bell, descent stage, ascent stage. Convex.
HULL_M = ((-0.75, -3.1), (0.75, -3.1), (2.1, -2.0), (2.1, -0.4), (1.5, 3.1), (-1.5, 3.1), (-2.1, -0.4), (-2.1, -2.0))
# The foot pads (x, y) of each leg; near and far as seen from -y, with left to -x.
PADS_M = {
    "left_near_leg": (-0.5 * PADS_APART_M, -0.5 * PADS_APART_M),
    "left_far_leg": (-0.5 * PADS_APART_M, 0.5 * PADS_APART_M),
    "right_near_leg": (0.5 * PADS_APART_M, -0.5 * PADS_APART_M),
    "right_far_leg": (0.5 * PADS_APART_M, 0.5 * PADS_APART_M),
}

GOLD = [212, 160, 58]
FOIL = [171, 118, 45]
SILVER = [186, 190, 196]
GREY = [128, 132, 140]
DARK = [58, 60, 66]

Ring = list[list[float]]


def module_shapes() -> dict[str, list[dict[str, Any]]]:
    """Return the shapes of the hull and of the legs, which slide along it when they give way."""
    left_near, left_far, right_near, right_far = (_leg(x, y) for x, y in PADS_M.values())
    return {
        "module": _descent_stage() + _ascent_stage(),
        "left_legs": left_near + left_far,
        "right_legs": right_near + right_far,
    }


def legged_module_shapes() -> dict[str, list[dict[str, Any]]]:
    """Return the shapes of the hull and of each leg by itself: see `PADS_M`."""
    return {"module": _descent_stage() + _ascent_stage(), **{name: _leg(x, y) for name, (x, y) in PADS_M.items()}}


def hull_corners() -> Ring:
    """Return the corners of a hull with eight sides; seen from -y it has the outline `HULL_M`."""
    return [corner for x, z in HULL_M if x > 0.0 for corner in _ring(x, z, 8)]


def _descent_stage() -> list[dict[str, Any]]:
    bell = [_ring(0.35, -1.9, 12), _ring(0.55, -2.5, 12), _ring(0.75, -NOZZLE_BELOW_M, 12)]
    return [
        _shell([_ring(2.25, -0.45, 8), _ring(2.25, -2.0, 8)], GOLD),
        _shell([_ring(2.3, -0.40, 8), _ring(2.3, -0.62, 8)], FOIL),
        _shell([_ring(2.3, -1.82, 8), _ring(2.3, -2.05, 8)], FOIL),
        _shell(bell, DARK),
    ]


def _ascent_stage() -> list[dict[str, Any]]:
    cabin = [_ring(1.05, 2.55, 8), _ring(1.75, 2.0, 8), _ring(1.85, 0.5, 8), _ring(1.5, -0.4, 8)]
    shapes = [
        _shell(cabin, SILVER),
        _shell([_ring(0.5, 3.1, 12), _ring(0.55, 2.5, 12)], GREY),
        box([1.74, 0.62, 1.2], [0.06, 0.3, 0.28], DARK),
        box([1.74, -0.62, 1.2], [0.06, 0.3, 0.28], DARK),
        box([1.72, 0.0, 0.3], [0.08, 0.4, 0.42], GREY),
        polyline([[0.0, 0.0, 3.1], [0.0, 0.0, 4.2]], DARK, 0.03),
        _shell([_ring(0.42, 4.25, 10), _ring(0.12, 4.0, 10)], SILVER),
    ]
    for x in (-JETS_OUT_M, JETS_OUT_M):
        for y in (-JETS_OUT_M, JETS_OUT_M):
            shapes += [
                box([x, y, 1.0], [0.11, 0.11, 0.3], DARK),
                box([x, y, 1.0], [0.28, 0.28, 0.07], GREY),
            ]
    return shapes


def _leg(x: float, y: float) -> list[dict[str, Any]]:
    """Return strut, braces and pad of one leg; its upper ends are inside the stage, so it can slide without a gap."""
    foot = [x, y, -PADS_BELOW_M + 0.15]
    root_out, root_in = 0.52, 0.36
    return [
        polyline([[root_out * x, root_out * y, -0.5], foot], GOLD, 0.11),
        polyline([[root_in * x, 0.66 * y, -1.95], [0.85 * x, 0.85 * y, -2.6]], FOIL, 0.06),
        polyline([[0.66 * x, root_in * y, -1.95], [0.85 * x, 0.85 * y, -2.6]], FOIL, 0.06),
        _shell(
            [_ring(0.16, -PADS_BELOW_M + 0.22, 10, x, y), _ring(0.46, -PADS_BELOW_M + 0.1, 10, x, y),
             _ring(0.38, -PADS_BELOW_M, 10, x, y)],
            SILVER,
        ),
    ]  # fmt: skip


def _ring(radius: float, z: float, corners: int, x: float = 0.0, y: float = 0.0) -> Ring:
    """Return the corners of a regular polygon, a flat side to +x."""
    turn = math.pi / corners
    angles = [turn + 2.0 * math.pi * i / corners for i in range(corners)]
    reach = radius / math.cos(turn)
    return [[round(x + reach * math.cos(a), 4), round(y + reach * math.sin(a), 4), z] for a in angles]


def _shell(rings: list[Ring], rgb: list[int]) -> dict[str, Any]:
    """Return a closed mesh through rings of equally many corners, from top to bottom."""
    n = len(rings[0])
    vertices = [corner for ring in rings for corner in ring]
    triangles = []
    for r in range(len(rings) - 1):
        for i in range(n):
            a, b = r * n + i, r * n + (i + 1) % n
            triangles += [[a, a + n, b], [b, a + n, b + n]]
    base = (len(rings) - 1) * n
    for i in range(1, n - 1):
        triangles += [[0, i, i + 1], [base, base + i + 1, base + i]]
    return mesh(vertices, triangles, rgb)
