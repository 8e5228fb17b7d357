"""Fields of pages that a student's program stored, checked for type and range; an error names the field.

moment_nm = require_field(page, "turn", "moment_nm", float)
pulses = require_field(page, "pwm", "pulses_us", list[float], count=8)
"""

from __future__ import annotations

import reprlib
from typing import Any, TypeVar, cast

import numpy as np

from snr_sim.grading.lab.verdicts import SubmissionError

MAX_NUMBER = 1e12  # a larger number is not a measurement, and overflows in later arithmetic

Kind = TypeVar("Kind", float, str, bool, list[float])


def require_page(page: Any, key: str) -> dict[str, Any]:
    """Return a page's data, which must be a dict.

    Raises:
        SubmissionError: it is not a dict.
    """
    if isinstance(page, dict):
        return page
    hint = f"The page '{key}' is not a dict. Store a dict in it, with the fields that the README names."
    raise _page_error(page, hint, "a dict")


def require_field(page: Any, key: str, name: str, kind: type[Kind], count: int | None = None) -> Kind:
    """Return a field of a page.

    Args:
        page: its data.
        key: under which it was stored.
        name: of the field.
        kind: `float` (a whole number will do), `str`, `bool` or `list[float]` (a tuple or an array will do).
        count: how many are in a list; any number if not given.

    Raises:
        SubmissionError: it is missing, has another type, or is not finite or out of range.
    """
    fields = require_page(page, key)
    if name not in fields:
        hint = f"The page '{key}' has no field '{name}'. Does your program call it so, letter by letter?"
        raise _page_error(sorted(map(str, fields)), hint, f"the field '{name}'")
    found: Any = fields[name]
    expected = _type_name(kind, count)
    if kind is str or kind is bool:
        if type(found) is not kind:
            raise _page_error(found, f"'{name}' of the page '{key}' is not {expected}.", expected)
        return found
    numbers = [found] if kind is float else _as_list(found)
    if any(isinstance(number, np.generic) and not _is_number(number) for number in numbers or ()):
        hint = f"'{name}' of the page '{key}' holds a number of numpy's, not of Python's: write float(...) around it."
        raise _page_error(found, hint, expected)
    if numbers is None or count not in (None, len(numbers)) or not all(map(_is_number, numbers)):
        raise _page_error(found, f"'{name}' of the page '{key}' is not {expected}.", expected)
    if not all(-MAX_NUMBER < number < MAX_NUMBER for number in numbers):
        hint = (
            f"'{name}' of the page '{key}' is not finite, or exceeds {MAX_NUMBER:g}. Is something divided by zero, or "
            "growing without limit?"
        )
        raise _page_error(found, hint, expected)
    return cast(Kind, numbers[0] if kind is float else numbers)


def _as_list(found: Any) -> list[Any] | None:
    if isinstance(found, np.ndarray):
        found = found.tolist()
    return list(found) if isinstance(found, (list, tuple)) else None


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _type_name(kind: type[Any], count: int | None) -> str:
    simple = {float: "a number", str: "a text", bool: "True or False"}
    return simple.get(kind) or f"a list of {'' if count is None else f'{count} '}numbers"


def _page_error(found: Any, hint: str, expected: str) -> SubmissionError:
    """Return the error; its hint is shown for hidden cases, too, so it does not contain the value found."""
    return SubmissionError("A page is not as the lab asks for it.", hint, expected, reprlib.repr(found))
