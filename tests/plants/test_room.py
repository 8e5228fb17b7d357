"""A room: its floor, its walls, and people in it."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from snr_sim.plants.ground.room import CELL_M, Room, Walker, cells_along, is_inside
from snr_sim.prelude.errors import ParameterError

SQUARE = ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0))
L_SHAPE = ((0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 1.0), (1.0, 2.0), (0.0, 2.0))


@pytest.mark.parametrize(("outline", "area_m2"), [(SQUARE, 4.0), (L_SHAPE, 3.0)])
def test_floor_is_as_large_as_outline(outline: tuple[tuple[float, float], ...], area_m2: float) -> None:
    assert len(Room(outline).floor_cells) * CELL_M**2 == pytest.approx(area_m2)


def test_furniture_stands_on_floor() -> None:
    box = ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5))
    room = Room(SQUARE, (box,))
    assert len(room.floor_cells) * CELL_M**2 == pytest.approx(3.0)
    assert not room.is_floor(0.0, 0.0)
    assert room.is_floor(0.8, 0.8)
    assert not room.is_floor(1.2, 0.0)
    assert len(room.edges_m()) == 8


@pytest.mark.hypothesis
@given(x=st.floats(-3.0, 3.0), y=st.floats(-3.0, 3.0))
def test_inside_of_a_circle_is_inside_of_its_polygon(x: float, y: float) -> None:
    """Against the closed form: a regular polygon of n sides lies between two circles."""
    sides = 40
    outline = tuple((2.0 * math.cos(a), 2.0 * math.sin(a)) for a in (2.0 * math.pi * i / sides for i in range(sides)))
    radius = math.hypot(x, y)
    if radius < 2.0 * math.cos(math.pi / sides) - 1e-9:
        assert is_inside(outline, x, y)
    if radius > 2.0 + 1e-9:
        assert not is_inside(outline, x, y)


def test_every_point_of_floor_is_in_its_square() -> None:
    assert cells_along((0.05, -0.05), (1.0, 0.0), 0.0) == {(0, -1)}
    room = Room(SQUARE)
    assert all(room.is_floor((i + 0.5) * CELL_M, (j + 0.5) * CELL_M) for i, j in room.floor_cells)


@pytest.mark.parametrize(("along_m", "x"), [(0.0, 0.0), (1.0, 1.0), (4.0, 4.0), (5.0, 3.0), (8.0, 0.0)])
def test_walker_goes_there_and_back(along_m: float, x: float) -> None:
    assert Walker((0.0, 1.0), (4.0, 1.0)).place_m(along_m) == (pytest.approx(x), 1.0)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Room(((0.0, 0.0), (1.0, 0.0))), "three corners"),
        (lambda: Room(((0.0, 0.0), (1.0, 0.0), (2.0, 0.0))), "no floor"),
        (lambda: Room(((0.0, 0.0), (1.0, math.nan), (1.0, 1.0))), "corner of the room"),
        (lambda: Room(((0.0, 0.0), (49.0, 0.0), (49.0, 49.0))), "400 m2"),
        (lambda: Room(((0.0, 0.0), (3200.0, 0.0), (3200.0, 2400.0))), "millimetres"),
        (lambda: Walker((1.0, 1.0), (1.0, 1.0)), "the same point"),
        (lambda: Walker((0.0, 0.0), (1.0, 1.0), speed_mps=10.0), "people walk at"),
    ],
)
def test_room_that_cannot_be_is_refused(make: object, message: str) -> None:
    with pytest.raises(ParameterError) as caught:
        make()  # type: ignore[operator]
    assert message in str(caught.value)
