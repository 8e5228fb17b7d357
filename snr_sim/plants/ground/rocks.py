"""Rocks and ledges: what a wheel climbs or a rover drives around. They do not move."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any, TypeAlias

from snr_sim.plants.ground.body_space import box_corners
from snr_sim.plants.parameter_limits import IS_ABOVE, LIMITS, MILLIMETRES, Limit, Record
from snr_sim.plants.pymunk_engine import pymunk_module
from snr_sim.plants.shapes import box, mesh

ROCK_PLACE_M = Limit(-1e4, 1e4, "m", "no field is larger", MILLIMETRES)
ROCK_M = Limit(0.0, 50.0, "m", "rocks that a rover meets are smaller", MILLIMETRES, IS_ABOVE)
ROCK_RGB = [112, 104, 98]
AXES = ("x", "y", "z")


@dataclass(frozen=True)
class Rock(Record, who="The rock's "):
    """A ball, most often half in the ground.

    Args:
        center_m: of it, world frame.
        radius_m: of it.
        friction: coefficient.
    """

    center_m: Annotated[tuple[float, float, float], ROCK_PLACE_M, AXES]
    radius_m: Annotated[float, ROCK_M]
    friction: Annotated[float, LIMITS["grip"]] = 0.8

    def geom(self, name: str) -> str:
        """Return it as a MJCF geom, without what it collides with."""
        x, y, z = self.center_m
        return (
            f'<geom name="{name}" type="sphere" pos="{x} {y} {z}" size="{self.radius_m}" friction="{self.friction} 0 0"'
        )

    def shape(self) -> dict[str, Any]:
        """Return it for the viewer: an octahedron whose corners lie on the ball, which looks like a rock."""
        (x, y, z), r = self.center_m, self.radius_m
        corners = [[x + r, y, z], [x - r, y, z], [x, y + r, z], [x, y - r, z], [x, y, z + r], [x, y, z - r]]
        faces = [[i, j, k] for i in (0, 1) for j in (2, 3) for k in (4, 5)]
        return mesh(corners, faces, ROCK_RGB)

    @property
    def top_m(self) -> float:
        """Height of its highest point."""
        return self.center_m[2] + self.radius_m

    def outline(self, floor_m: float, body: Any) -> Any:
        """Return its widest section above a floor, as a shape of pymunk on a body."""
        x, y, z = self.center_m
        under_m = max(0.0, floor_m - z)
        return pymunk_module().Circle(body, math.sqrt(max(0.0, self.radius_m**2 - under_m**2)), (x, y))


@dataclass(frozen=True)
class Ledge(Record, who="The ledge's "):
    """A box with its sides along the axes.

    Args:
        center_m: of it, world frame.
        half_size_m: along x, y, z.
        friction: coefficient.
    """

    center_m: Annotated[tuple[float, float, float], ROCK_PLACE_M, AXES]
    half_size_m: Annotated[tuple[float, float, float], ROCK_M, AXES]
    friction: Annotated[float, LIMITS["grip"]] = 0.8

    def geom(self, name: str) -> str:
        """Return it as a MJCF geom, without what it collides with."""
        (x, y, z), (a, b, c) = self.center_m, self.half_size_m
        return f'<geom name="{name}" type="box" pos="{x} {y} {z}" size="{a} {b} {c}" friction="{self.friction} 0 0"'

    def shape(self) -> dict[str, Any]:
        """Return it for the viewer."""
        return box(list(self.center_m), list(self.half_size_m), ROCK_RGB)

    @property
    def top_m(self) -> float:
        """Height of its upper side."""
        return self.center_m[2] + self.half_size_m[2]

    def outline(self, floor_m: float, body: Any) -> Any:
        """Return its section above a floor, as a shape of pymunk on a body."""
        (x, y, _), (a, b, _) = self.center_m, self.half_size_m
        return pymunk_module().Poly(body, box_corners(a, b, (x, y)))


Obstacle: TypeAlias = Rock | Ledge
