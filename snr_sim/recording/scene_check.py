"""Check of the scene in a trace's header. The viewer and pictures compute with its shapes; see `Plant.scene`."""

from __future__ import annotations

from typing import Annotated, Any, TypeAlias

import msgspec

from snr_sim.prelude.task import ensure_type_info

Point: TypeAlias = tuple[float, float, float]
Index: TypeAlias = Annotated[int, msgspec.Meta(ge=0, lt=2**31)]
Count: TypeAlias = Annotated[int, msgspec.Meta(ge=2, lt=2**31)]
Spacing: TypeAlias = Annotated[float, msgspec.Meta(gt=0.0)]
Level: TypeAlias = Annotated[int, msgspec.Meta(ge=0, le=255)]


class Shape(msgspec.Struct):
    """What all shapes have."""

    rgb: tuple[Level, Level, Level]
    label: str = ""


class Box(Shape, kw_only=True):
    """A box."""

    half_size_m: Point
    center_m: Point


class Polyline(Shape, kw_only=True):
    """A line."""

    points_m: Annotated[list[Point], msgspec.Meta(min_length=1)]
    radius_m: float = 0.1


class Mesh(Shape, kw_only=True):
    """A surface of triangles."""

    vertices_m: Annotated[list[Point], msgspec.Meta(min_length=1)]
    triangles: Annotated[list[tuple[Index, Index, Index]], msgspec.Meta(min_length=1)]


class HeightField(Shape, kw_only=True):
    """A height for each place of a grid."""

    corner_m: tuple[float, float]
    spacing_m: tuple[Spacing, Spacing]
    shape: tuple[Count, Count]
    heights_m: list[float]


class Tether(msgspec.Struct):
    """A line from a fixed point to one of a body."""

    anchor_m: Point
    body: str
    place_m: Point
    length_m: float


class Scene(msgspec.Struct):
    """The scene. Shapes may be of a kind of a later version, which is skipped."""

    statics: dict[str, dict[str, Any]] = {}
    bodies: dict[str, list[dict[str, Any]]] = {}
    tethers: dict[str, Tether] = {}
    is_planar: bool = False


KINDS: dict[str, type[Shape]] = {"box": Box, "polyline": Polyline, "mesh": Mesh, "heightfield": HeightField}


def check_scene(scene: dict[str, Any]) -> None:
    """Raise ValueError, which `msgspec.ValidationError` is too, if a scene is not one."""
    checked = msgspec.convert(scene, ensure_type_info(Scene))
    for shape in [*checked.statics.values(), *(one for body in checked.bodies.values() for one in body)]:
        kind = KINDS.get(str(shape.get("kind")))
        if kind is None:
            continue
        read = msgspec.convert(shape, ensure_type_info(kind))
        if isinstance(read, Mesh) and max(map(max, read.triangles)) >= len(read.vertices_m):
            raise ValueError("a triangle has a corner that is not among the vertices")
        if isinstance(read, HeightField) and read.shape[0] * read.shape[1] != len(read.heights_m):
            raise ValueError("a height field has not as many heights as its shape says")
