"""Numbers of a small tracked vehicle with a blade, of the soil that it pushes, and where it starts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from snr_sim.plants.ground.explorer import DRIVE_MPS, LENGTH_M
from snr_sim.plants.ground.room import AXES, PLACE_M, Point
from snr_sim.plants.parameter_limits import GRAMS, IS_ABOVE, LIMITS, MILLIMETRES, Limit, Record, check_vector
from snr_sim.prelude.errors import ParameterError

MAX_STONES = 200


@dataclass(frozen=True)
class Dozer(Record, who="The dozer's "):
    """A vehicle seen from above. Body frame: x forward, y left, origin in the centre of mass, between the tracks.

    Args:
        mass_kg, inertia_kgm2: about the vertical through the centre of mass.
        size_m: length and width of body, tracks and blade, a rectangle around the origin; the blade is its front.
        height_m: of the body, for the viewer.
        track_m: between the middles of the tracks.
        track_length_m: of a track on the ground.
        full_speed_mps: of a track.
        lag_s: of a track's speed, first order.
        max_pull_n: of the motor of a track.
        grip_along, grip_across: friction coefficients of tracks on the floor.
        wall_friction: that of the body at walls.
        blade_s: time that the blade takes to go down, or up.

    Raises:
        ParameterError: a number is out of range.
    """

    mass_kg: Annotated[float, Limit(0.1, 1000.0, "kg", "a model has some kilograms", GRAMS)]
    inertia_kgm2: Annotated[float, Limit(0.0, 1000.0, "kg m2", "", {}, IS_ABOVE)]
    size_m: Annotated[Point, LENGTH_M, ("length", "width")]
    height_m: Annotated[float, LENGTH_M]
    track_m: Annotated[float, LENGTH_M]
    track_length_m: Annotated[float, LENGTH_M]
    full_speed_mps: Annotated[float, DRIVE_MPS]
    lag_s: Annotated[float, LIMITS["lag_s"]]
    max_pull_n: Annotated[float, Limit(0.0, 1e5, "N", "a model pulls less than its weight", {}, IS_ABOVE)]
    grip_along: Annotated[float, LIMITS["grip"]]
    grip_across: Annotated[float, LIMITS["grip"]]
    wall_friction: Annotated[float, LIMITS["grip"]]
    blade_s: Annotated[float, LIMITS["lag_s"]]


@dataclass(frozen=True)
class Heap(Record, who="The heap's "):
    """Stones on the floor, all of one size, and the edge of the pit that they are to be pushed into.

    Args:
        places_m: x and y of each stone.
        rgbs: color of each.
        edge_m: x of the edge; what is east of it has fallen into the pit.
        radius_m, stone_kg: of a stone.
        friction: coefficient of stones on the floor.

    Raises:
        ParameterError: a number is out of range, or there are too many stones, or another number of colors.
    """

    places_m: tuple[Point, ...]
    rgbs: tuple[tuple[int, int, int], ...]
    edge_m: Annotated[float, PLACE_M]
    radius_m: Annotated[float, Limit(0.0, 0.5, "m", "a model moves stones of some centimetres", MILLIMETRES, IS_ABOVE)]
    stone_kg: Annotated[float, Limit(0.0, 10.0, "kg", "a model cannot push more", GRAMS, IS_ABOVE)]
    friction: Annotated[float, LIMITS["grip"]]

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 1 <= len(self.places_m) <= MAX_STONES or len(self.rgbs) != len(self.places_m):
            raise ParameterError(
                f"The heap has {len(self.places_m)} stones and {len(self.rgbs)} colors.",
                fix=f"give 1 to {MAX_STONES} stones, each with a color.",
            )
        for place in self.places_m:
            check_vector("A stone's place", place, PLACE_M, AXES)
