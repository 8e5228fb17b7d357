"""Conversion of a page's data to a command; an invalid one raises an error that explains it."""

from __future__ import annotations

import math
from typing import Any, get_args, get_origin

import msgspec

from snr_sim.prelude.errors import CommandError, suggest
from snr_sim.prelude.structs import ensure_type_info

Limits = dict[str, tuple[float, float]]

_SHOWN_LENGTH = 80


def command_of(data: Any, command_type: type[Any], limits: Limits) -> Any:
    """Return the command in a page.

    Args:
        data: of the page: the command itself, or a dict of its fields.
        command_type: struct of the actuator's commands.
        limits: lowest and highest value of its fields.

    Raises:
        CommandError: it is not such a command; names the field, its value and what it must be.
    """
    if type(data) is command_type:
        return data
    try:
        return msgspec.convert(data, ensure_type_info(command_type))
    except msgspec.ValidationError:
        pass
    try:
        return msgspec.convert(_plain(data), ensure_type_info(command_type))
    except msgspec.ValidationError as error:
        raise _command_error(data, command_type, limits) from error


def check_finite(name: str, value: float, limits: tuple[float, float]) -> None:
    """Check a number of a command for NaN and infinity.

    Raises:
        CommandError: it is NaN or infinite.
    """
    if not math.isfinite(value):
        raise CommandError(
            f"{name} must be finite, not {value!r}.",
            fix=f"send a number from {limits[0]:g} to {limits[1]:g}; "
            "look for a division by zero or an overflow before it.",
        )


def _plain(value: Any) -> Any:
    """Return a value with numpy's numbers and arrays converted to Python's."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    return value.tolist() if hasattr(value, "tolist") else value


def _command_error(data: Any, command_type: type[Any], limits: Limits) -> CommandError:
    fields = msgspec.structs.fields(command_type)
    names = [field.name for field in fields]
    example = ", ".join(f'"{field.name}": {_default(field)}' for field in fields)
    fix = f"store a dict with these fields: {{{example}}}."
    if not isinstance(data, dict):
        return CommandError(f"it is {describe_value(data)}, but must be a dict.", fix)
    for name in data:
        if name not in names:
            return CommandError(
                f"it has the field {name!r}, which this actuator does not know.", suggest(str(name), names)
            )
    for field in fields:
        if field.name not in data:
            if field.required:
                return CommandError(f"it has no field '{field.name}'.", fix)
            continue
        found = _wrong_value(field.name, data[field.name], field.type)
        if found is not None:
            location, value = found
            must_be = _requirement(
                field.type if location == field.name else get_args(field.type)[0], limits.get(field.name)
            )
            return CommandError(f"{location} is {describe_value(value)}, but must be {must_be}.", fix)
    return CommandError(f"it is {describe_value(data)}.", fix)


def _wrong_value(location: str, value: Any, kind: Any) -> tuple[str, Any] | None:
    """Return position and value of the first wrong type in a field; None if it is valid."""
    if get_origin(kind) is list and isinstance(value, (list, tuple)):
        inside = (_wrong_value(f"{location}[{i}]", one, get_args(kind)[0]) for i, one in enumerate(value))
        return next((found for found in inside if found is not None), None)
    try:
        msgspec.convert(_plain(value), ensure_type_info(kind))
    except msgspec.ValidationError:
        return location, value
    return None


def _requirement(kind: Any, limits: tuple[float, float] | None) -> str:
    if get_origin(kind) is list:
        inside = _requirement(get_args(kind)[0], limits)
        return f"a list, each {inside}"
    if kind not in (int, float):
        return f"a {getattr(kind, '__name__', kind)}"
    number = "a whole number" if kind is int else "a number"
    return number if limits is None else f"{number} from {limits[0]:.4g} to {limits[1]:.4g}"


def _default(field: Any) -> str:
    return "..." if field.default is msgspec.NODEFAULT else repr(field.default)


def describe_value(value: Any) -> str:
    """Return the type and value of a value as text for a student.

    >>> describe_value("full"), describe_value([0.5]), describe_value(None)
    ("the text 'full'", 'the list [0.5]', 'None')
    """
    try:
        shown = repr(value)
    except ValueError:  # Python does not print integers of more than 4300 digits
        shown = "... with more than 4300 digits"
    if len(shown) > _SHOWN_LENGTH:
        shown = shown[: _SHOWN_LENGTH - 3] + "..."
    if isinstance(value, str):
        return f"the text {shown}"
    if value is None or isinstance(value, bool):
        return shown
    if isinstance(value, (int, float)):
        return f"the number {shown}"
    if isinstance(value, (list, tuple, dict, set)):
        return f"the {type(value).__name__} {shown}"
    return f"{shown}, which is of the type {type(value).__name__}"
