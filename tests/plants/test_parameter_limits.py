import math
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
import pytest
from numpy.typing import NDArray

from snr_sim.plants.parameter_limits import (
    FINITE,
    LIMITS,
    check_members,
    check_number,
    check_record,
    check_vector,
    checked_matrix,
    is_number,
)
from snr_sim.prelude.errors import ParameterError


def test_error_contains_value_and_expected_range() -> None:
    with pytest.raises(ParameterError) as caught:
        check_number("The tether's diameter_m", 7.5, LIMITS["diameter_m"])
    assert caught.value.message == "The tether's diameter_m is 7.5: millimetres?"
    assert caught.value.fix == "give more than 0 and at most 0.05 m: a small vehicle cannot drag a thicker one."
    with pytest.raises(ParameterError, match=r"It of y is nan\.\n  Try: give a finite number\."):
        check_vector("It", (0.0, math.nan, 0.0))


def test_is_number_accepts_numpy_and_rejects_bool() -> None:
    assert all(is_number(value) for value in (1, 1.0, np.float64(1.0), np.float32(1.0), np.int64(1)))
    assert not any(is_number(value) for value in (True, "1", None, 1j, [1.0], 10**400, np.bool_(True)))
    check_vector("It", np.zeros(3))


@pytest.mark.parametrize("value", [3.0, "abc", None, {"x": 1.0}, (1.0, 2.0)])
def test_non_vector_raises(value: object) -> None:
    with pytest.raises(ParameterError, match="It is "):
        check_vector("It", value)


def test_single_member_instead_of_tuple_raises_with_comma_hint() -> None:
    with pytest.raises(ParameterError, match="It is one float, not a row of them") as caught:
        check_members("It", 1.0, float)
    assert "comma" in caught.value.fix
    for odd in (None, "ab", [1.0, "ab"]):
        with pytest.raises(ParameterError, match="where a float is due"):
            check_members("It", odd, float)
    check_members("It", [1.0, 2.0], float)


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (3.0, r"It is 3\.0"),
        ([[1.0, 0.0]], r"It is \[\[1\.0, 0\.0\]\]"),
        ([[1.0, 0.0], [0.0]], r"It \(row of y\) is \[0\.0\]: 1 numbers, not 2"),
        ([[1.0, 0.0], [math.nan, 1.0]], r"It \(row of y\) of x is nan"),
        ([[1.0, 0.2], [0.1, 1.0]], r"It has 0\.2 at x, y, but 0\.1 at y, x"),
    ],
)
def test_invalid_matrix_raises_with_entry(rows: object, message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        checked_matrix("It", rows, ("x", "y"))
    assert checked_matrix("It", [[1, 2], [2, 3]], ("x", "y")).tolist() == [[1.0, 2.0], [2.0, 3.0]]


def test_every_limit_has_reason_and_range() -> None:
    for name, limit in LIMITS.items():
        assert limit.reason, name
        assert limit.min_value < limit.max_value, name


@dataclass(frozen=True)
class Part:
    share: Annotated[float, LIMITS["share"]] = 0.5

    def __post_init__(self) -> None:
        check_record(self, "The part's ")


@dataclass(frozen=True)
class Whole:
    cells: Annotated[int, LIMITS["cells"]] = 4
    cutoff_v: Annotated[float | None, LIMITS["cutoff_cell_v"]] = None
    sticks: Annotated[tuple[float, float], LIMITS["share"], ("surge", "yaw")] = (0.0, 0.0)
    inertia: Annotated[NDArray[np.float64], FINITE, ("x", "y")] = ((1.0, 0.0), (0.0, 1.0))  # type: ignore[assignment]
    part: Annotated[Part | None, "Part(0.5), or None."] = None
    parts: Annotated[tuple[Part, ...], "Part(0.5)"] = ()
    other: Any = "not checked"
    parts_too: tuple[Part, ...] = ()

    def __post_init__(self) -> None:
        check_record(self, "It has ")


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"cells": 4.5}, r"It has cells is 4\.5, which is not an integer"),
        ({"cells": 99}, "It has cells is 99"),
        ({"cutoff_v": 10.0}, r"It has cutoff_v is 10\.0: of four cells\?"),
        ({"sticks": (0.0, 2.0)}, r"It has sticks of yaw is 2\.0"),
        ({"inertia": ((1.0, 0.2), (0.1, 1.0))}, r"It has inertia has 0\.2 at x, y"),
        ({"part": 0.5}, r"It has part is 0\.5\.\n  Try: Part\(0\.5\), or None"),
        ({"parts": Part()}, "It has parts is one Part, not a row of them"),
    ],
)
def test_record_outside_annotations_raises(given: dict[str, Any], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        Whole(**given)


def test_record_keeps_plain_numbers_and_unannotated_fields() -> None:
    made = Whole(cutoff_v=np.float32(2.5), sticks=[1, np.int64(0)], parts=[Part()], parts_too=[3], other=None)  # type: ignore[arg-type]
    assert type(made.cutoff_v) is float
    assert made.sticks == (1.0, 0.0)
    assert [type(one) for one in made.sticks] == [float, float]
    assert made.inertia.tolist() == [[1.0, 0.0], [0.0, 1.0]]
    assert made.parts == (Part(),)
    assert made.parts_too == [3]
