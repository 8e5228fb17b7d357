"""Comparison of recorded with replayed values: exact, unless a tolerance names the path."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any

import msgspec

from snr_sim.prelude.errors import ParameterError, ValueEncodingError
from snr_sim.prelude.values import TAG, decode_value

_decode = msgspec.json.Decoder().decode
_encode = msgspec.json.Encoder().encode


@dataclass(frozen=True)
class Tolerance:
    """Allowed difference between numbers whose path matches a pattern."""

    pattern: str  # of paths such as 'engine.throttle' or 'inertial.position_m[0]'; * and ? as in file names
    # Differences within either are ignored. Infinity accepts everything, also other types.
    absolute: float = 0.0
    relative: float = 0.0

    @staticmethod
    def parse(text: str) -> Tolerance:
        """Return the tolerance written as PATTERN=ABSOLUTE, PATTERN=RELATIVE%, or PATTERN=ignore.

        Raises:
            ParameterError: the text has none of these forms.

        >>> Tolerance.parse("engine.*=1e-6")
        Tolerance(pattern='engine.*', absolute=1e-06, relative=0.0)
        """
        pattern, _, bound = text.rpartition("=")
        try:
            number = float("inf" if bound == "ignore" else bound.removesuffix("%"))
        except ValueError:
            number = float("nan")
        if pattern and number >= 0.0:
            is_relative = bound.endswith("%")
            return Tolerance(pattern, relative=number / 100.0) if is_relative else Tolerance(pattern, absolute=number)
        raise ParameterError(
            f"--tolerance {text} is not valid.",
            fix="engine.throttle=1e-6, or 'radar.*=0.1%', or engine.stamp_s=ignore.",
        )


@dataclass(frozen=True)
class Difference:
    """A path at which two values differ."""

    field: str
    recorded: Any
    replayed: Any


_ABSENT = "(absent)"
_OF_PAGES = ("store_page", "process_data")
_PROGRAM = re.compile(r"^(__main__|snr_sim_program_\w+)\.")


def first_difference(
    name: str, kind: str, recorded: bytes, replayed: bytes, tolerances: Sequence[Tolerance] = ()
) -> Difference | None:
    """Return the first place where the values of two tasks differ by more than allowed, or None.

    Args:
        name: of the task: the beginning of every path.
        kind: the task's type; of a page the path leads into its data: 'engine.throttle'.
        recorded, replayed: the values as JSON, as in traces.
        tolerances: each applies to the paths that match its pattern.
    """
    if recorded == replayed:
        return None
    found = _differences(name, *(_roots(kind, raw) for raw in (recorded, replayed)))
    return next((one for one in found if not any(_passes(tolerance, one) for tolerance in tolerances)), None)


def only_reordered(recorded: Sequence[bytes], replayed: Sequence[bytes]) -> bool:
    """Return whether two lists of values differ only in the order of the values, or of the items of lists in them."""
    if list(recorded) == list(replayed):
        return False
    then, now = (repr(_unordered([_decode(raw) for raw in raws])) for raws in (recorded, replayed))
    return then == now  # by repr, 1 is not 1.0 and not true


def _unordered(value: Any) -> Any:
    if isinstance(value, list):
        return sorted(map(_unordered, value), key=repr)
    if isinstance(value, dict):
        return {key: _unordered(value[key]) for key in sorted(value)}
    return value


def _roots(kind: str, raw: bytes) -> Any:
    values = _decode(raw)
    if kind in _OF_PAGES and len(values) == 1 and isinstance(values[0], dict) and values[0].get(TAG) == "page":
        page = values[0]
        about = {key: item for key, item in page.items() if key not in ("data", TAG)}
        return _Page(page.get("data"), about)
    return values


@dataclass(frozen=True)
class _Page:
    data: Any
    about: dict[str, Any]


def _differences(path: str, recorded: Any, replayed: Any) -> Iterator[Difference]:
    """Yield every leaf that differs, in the order of the recorded value."""
    if isinstance(recorded, _Page) and isinstance(replayed, _Page):
        yield from _differences(path, recorded.data, replayed.data)
        for key in recorded.about:
            yield from _differences(f"{path}:{key}", recorded.about[key], replayed.about.get(key, _ABSENT))
        return
    if _mark(recorded) != _mark(replayed):
        yield Difference(path, _format_value(recorded), _format_value(replayed))
        return
    recorded, replayed = _without_mark(recorded), _without_mark(replayed)
    if isinstance(recorded, dict) and isinstance(replayed, dict):
        for key in [*recorded, *(key for key in replayed if key not in recorded)]:
            inner = f"{path}.{key}"
            yield from _differences(inner, recorded.get(key, _ABSENT), replayed.get(key, _ABSENT))
    elif isinstance(recorded, list) and isinstance(replayed, list):
        for i in range(max(len(recorded), len(replayed))):
            pair = (values[i] if i < len(values) else _ABSENT for values in (recorded, replayed))
            yield from _differences(f"{path}[{i}]", *pair)
    elif type(recorded) is not type(replayed) or repr(recorded) != repr(replayed):  # by repr, -0.0 is not 0.0
        yield Difference(path, recorded, replayed)


def _mark(value: Any) -> Any:
    """Return the type of a value that JSON alone does not express: a tuple, an array of floats, a class."""
    if not (isinstance(value, dict) and TAG in value):
        return None
    mark = value[TAG]
    if mark == "float":
        return None
    kind = value.get("type")
    if isinstance(kind, str):
        kind = _PROGRAM.sub("", kind)  # a program is a module whose name differs in a replay
    return (mark, value.get("dtype"), value.get("shape"), kind)


def _without_mark(value: Any) -> Any:
    """Return the content of a tagged value as plain JSON."""
    if not (isinstance(value, dict) and TAG in value):
        return value
    if value[TAG] in ("float", "array", "int", "bytes"):
        plain = decode_value(_encode(value))
        return plain.tolist() if value[TAG] == "array" else plain
    if value[TAG] == "object":
        return value["fields"]
    return {key: item for key, item in value.items() if key != TAG} if "v" not in value else value["v"]


def _format_value(value: Any) -> Any:
    """Return a value in Python syntax, where possible."""
    try:
        return decode_value(_encode(value))
    except ValueEncodingError:
        return value


def _passes(tolerance: Tolerance, difference: Difference) -> bool:
    # A path contains [0], which fnmatch reads as a character set, so the bracket is escaped.
    if not fnmatchcase(difference.field, tolerance.pattern.replace("[", "[[]")):
        return False
    if tolerance.absolute == float("inf"):
        return True
    recorded, replayed = difference.recorded, difference.replayed
    if not all(isinstance(value, (int, float)) and not isinstance(value, bool) for value in (recorded, replayed)):
        return False
    apart = abs(recorded - replayed)
    return bool(apart <= tolerance.absolute or apart <= tolerance.relative * max(abs(recorded), abs(replayed)))
