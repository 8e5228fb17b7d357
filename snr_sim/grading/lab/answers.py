"""What a student's program has stored or returned, checked for its type and range; an error names the field.

moment_nm = require_field(page, "turn", "moment_nm", float)
pulses = require_field(page, "pwm", "pulses_us", list[float], count=8)
"""

from __future__ import annotations

import reprlib
from contextlib import suppress
from typing import Any, TypeVar, cast

import msgspec

from snr_sim.grading.lab.verdicts import SubmissionError
from snr_sim.grading.remote import protocol
from snr_sim.prelude.task import ensure_type_info
from snr_sim.prelude.values import may_have_tags

MAX_NUMBER = 1e12  # a larger number is not a measurement, and overflows in later arithmetic

Kind = TypeVar("Kind", float, str, bool, list[float])


def require_page(page: Any, key: str) -> dict[str, Any]:
    """Return a page's data, which must be a dict; raise SubmissionError if it is not a dict."""
    if isinstance(page, dict):
        return page
    hint = f"The page '{key}' is not a dict. Store a dict in it, with the fields that the README names."
    raise _page_error(page, hint, "a dict")


def require_field(page: Any, key: str, name: str, kind: type[Kind], count: int | None = None) -> Kind:
    """Return a field of the data of the page that was stored under a key.

    Args:
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
    listed = found.tolist() if _kind_of_numpy(found) == "ndarray" else found
    numbers = [found] if kind is float else list(listed) if isinstance(listed, (list, tuple)) else None
    if any(_kind_of_numpy(number) not in ("", "ndarray") and not _is_number(number) for number in numbers or ()):
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
    return cast("Kind", numbers[0] if kind is float else numbers)


def _kind_of_numpy(value: Any) -> str:
    return type(value).__name__ if type(value).__module__ == "numpy" else ""  # numpy is slow to import


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _page_error(found: Any, hint: str, expected: str) -> SubmissionError:
    """Return the error; its hint is shown for hidden cases, too, so it does not contain the value found."""
    return SubmissionError("A page is not as the lab asks for it.", hint, expected, reprlib.repr(found))


def checked(what: str, raw: msgspec.Raw, returns: Any, finite: bool) -> Any:
    """Return the value in an answer, of the form that was asked for."""
    if returns is str:  # the most frequent type, and a text contains nothing that needs further checks
        with suppress(msgspec.DecodeError, UnicodeDecodeError):
            return _decode_text(raw)
    value = protocol.plain_value(raw)
    if may_have_tags(bytes(raw)):  # only then can there be more than plain JSON
        _check_plain(what, value, finite)
    if returns is Any:
        return value
    try:
        return msgspec.convert(value, ensure_type_info(returns), strict=True)
    except msgspec.ValidationError as error:
        raise SubmissionError(
            f"{what} returned {reprlib.repr(value)}.",
            f"Return what the lab asks for: {_type_name(returns)}.",
            expected=_type_name(returns),
            actual=str(error).replace("`$", "`"),
        ) from None


def _check_plain(what: str, value: Any, finite: bool) -> None:
    kind = type(value)
    if kind is float and finite and not -float("inf") < value < float("inf"):
        raise SubmissionError(
            f"{what} returned {value!r} among its numbers.",
            "Return finite numbers: what is divided by zero, or never set?",
            expected="finite numbers",
            actual=repr(value),
        )
    if kind is list:
        for item in value:
            _check_plain(what, item, finite)
    elif kind is dict and all(type(key) is str for key in value):
        for item in value.values():
            _check_plain(what, item, finite)
    elif value is not None and kind not in (bool, int, float, str):
        raise protocol.ProtocolError(f"{protocol.BROKEN}: its answer is not a plain value.")


_TYPE_NAMES = {
    float: "a number",
    int: "a whole number",
    str: "a text",
    bool: "True or False",
    list[float]: "a list of numbers",
    list[int]: "a list of whole numbers",
    list[str]: "a list of texts",
}


def _type_name(returns: Any, count: int | None = None) -> str:
    if count is not None:
        return f"a list of {count} numbers"
    if returns in _TYPE_NAMES:
        return _TYPE_NAMES[returns]
    return returns.__name__ if isinstance(returns, type) and not hasattr(returns, "__args__") else str(returns)


_decode_text = msgspec.json.Decoder(str).decode
