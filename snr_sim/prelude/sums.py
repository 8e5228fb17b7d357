"""Sums whose rounding is the same under every version of Python.

Python 3.12 changed `sum` of floats: it compensates rounding errors, so its last bits differ from those of 3.11. A
run amplifies them, and a recording of one version then replays with differences under the other.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import reduce
from operator import add, mul
from typing import Any


def ordered_sum(values: Iterable[float]) -> float:
    """Return the sum, added from left to right and rounded after each addition, as `sum` did up to Python 3.11.

    >>> ordered_sum([0.1] * 10)
    0.9999999999999999
    """
    return reduce(add, values, 0.0)


def number_sum(values: Iterable[Any]) -> Any:
    """Return the same sum of numbers of any type: that of integers is an integer, as from `sum`.

    >>> number_sum([1, 2]), number_sum([0.1] * 10)
    (3, 0.9999999999999999)
    """
    return reduce(add, values, 0)


def dot_product(one: Iterable[float], other: Iterable[float]) -> float:
    """Return the sum of the products of two sequences, added from left to right; the longer one is cut.

    >>> dot_product([1.0, 2.0], [3.0, 4.0])
    11.0
    """
    return reduce(add, map(mul, one, other), 0.0)
