import math

import numpy as np
import pytest

from snr_sim.plants.urov.plausible import LIMITS, check_members, check_number, check_vector, checked_matrix, is_number
from snr_sim.prelude.errors import ParameterError


def test_what_is_wrong_and_what_is_wanted_are_both_said() -> None:
    with pytest.raises(ParameterError) as caught:
        check_number("The tether's diameter_m", 7.5, LIMITS["diameter_m"])
    assert caught.value.message == "The tether's diameter_m is 7.5: millimetres?"
    assert caught.value.fix == "give more than 0 and at most 0.05 m: a small vehicle cannot drag a thicker one."
    with pytest.raises(ParameterError, match=r"It of y is nan\.\n  Try: give a finite number\."):
        check_vector("It", (0.0, math.nan, 0.0))


def test_a_number_of_numpy_is_one_and_true_is_none() -> None:
    assert all(is_number(value) for value in (1, 1.0, np.float64(1.0), np.float32(1.0), np.int64(1)))
    assert not any(is_number(value) for value in (True, "1", None, 1j, [1.0], 10**400, np.bool_(True)))
    check_vector("It", np.zeros(3))


@pytest.mark.parametrize("value", [3.0, "abc", None, {"x": 1.0}, (1.0, 2.0)])
def test_what_is_no_row_of_numbers_is_told(value: object) -> None:
    with pytest.raises(ParameterError, match="It is "):
        check_vector("It", value)


def test_one_thing_where_a_row_of_them_is_due_is_told_with_the_comma() -> None:
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
def test_a_matrix_that_is_none_is_told_where(rows: object, message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        checked_matrix("It", rows, ("x", "y"))
    assert checked_matrix("It", [[1, 2], [2, 3]], ("x", "y")).tolist() == [[1.0, 2.0], [2.0, 3.0]]


def test_every_limit_has_its_reason_and_room() -> None:
    for name, limit in LIMITS.items():
        assert limit.why, name
        assert limit.least < limit.most, name
