"""Declared types of pages: `@page("radar")` above a msgspec Struct. Optional: every page holds plain data.

The page itself holds a dict with the Struct's fields, so traces, links and other components need not know the class.
`get_data(Radar)` and `@handles(Radar)` return the dict as a `Radar`; storing a `Radar` checks its fields.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any, TypeVar

import msgspec

from snr_sim.prelude.errors import ConfigError, TaskError
from snr_sim.prelude.page import DataKey
from snr_sim.prelude.structs import ensure_type_info

StructClass = TypeVar("StructClass", bound=type[msgspec.Struct])
Data = TypeVar("Data")
_KEY = "__snr_page_key__"  # attribute of a declared class
_PLAIN = (bool, int, float, str, list, tuple, dict)  # of an attribute that was meant to be a field


def page(key: DataKey) -> Callable[[StructClass], StructClass]:
    """Declare a msgspec Struct as the data of the page with this key.

    Args:
        key: of the page.

    Raises:
        ConfigError: the key is not text, or the class is not a Struct.

    >>> @page("radar")
    ... class Radar(msgspec.Struct):
    ...     altitude_m: float
    ...     velocity_mps: float
    >>> from_page(Radar, {"altitude_m": 120, "velocity_mps": -8.5, "stamp_s": 2.0}).altitude_m
    120.0
    """
    given_key: object = key
    if not isinstance(given_key, str):
        raise ConfigError(f"@page is given {key!r} instead of the key of a page.", fix='write @page("radar").')

    def declare(kind: StructClass) -> StructClass:
        given: object = kind  # any class, whatever the annotation says
        if not isinstance(given, msgspec.StructMeta):
            name = getattr(kind, "__name__", repr(kind))
            raise ConfigError(
                f'@page("{key}") is on {name}, which is not a msgspec.Struct.', fix=f"class {name}(msgspec.Struct):"
            )
        for name, value in list(vars(kind).items()):
            if (
                isinstance(value, _PLAIN)
                and name not in kind.__annotations__
                and not (name.isupper() or name[0] == "_")
            ):
                raise ConfigError(
                    f'@page("{key}") is on {kind.__name__}, whose {name} has no type, so it is not a field.',
                    fix=f"{name}: {type(value).__name__} = {value!r}",
                )
        setattr(kind, _KEY, key)
        return kind

    return declare


def declared_key(kind: object) -> DataKey:
    """Return the key of the page that a class declares; raise a ConfigError if it declares none."""
    key = getattr(kind, _KEY, None) if isinstance(kind, type) else None
    if not isinstance(key, str):
        name = getattr(kind, "__name__", repr(kind))
        raise ConfigError(
            f"{name} is neither the key of a page nor a class that declares one.",
            fix=f'pass the key as text, such as "radar", or write @page("radar") above class {name}(msgspec.Struct).',
        )
    return key


def from_page(kind: type[Data], data: object) -> Data:
    """Return the data of a page as an object of its declared class; the caller may change it.

    Raises:
        TaskError: the data do not fit the class.
    """
    try:
        return msgspec.convert(data, ensure_type_info(kind), from_attributes=True)
    except msgspec.ValidationError:
        pass  # it may hold numpy's numbers, which msgspec does not take for numbers
    try:
        return msgspec.convert(_plain(data), ensure_type_info(kind), from_attributes=True)
    except msgspec.ValidationError as error:
        key = declared_key(kind)
        raise TaskError(
            f"Page '{key}' does not fit {kind.__name__}: {_reason(error)}.",
            fix=f'get_data("{key}") returns what the page holds; compare it with the fields of {kind.__name__}.',
        ) from error


def to_page(key: DataKey, data: msgspec.Struct) -> dict[str, Any]:
    """Return the fields of an object of a declared class as a dict, checked against the types of its fields.

    Raises:
        TaskError: the class is declared for another page, or a field does not fit its type.
    """
    kind = type(data)
    own_key = declared_key(kind)
    if own_key != key:
        raise TaskError(
            f"Page '{key}' is given a {kind.__name__}, which is declared as page '{own_key}'.",
            fix=f"store_data(\"{own_key}\", ...), or another class for page '{key}'.",
        )
    try:
        checked = msgspec.convert(_plain(data), ensure_type_info(kind))
    except msgspec.ValidationError as error:
        raise TaskError(f"Page '{key}' is given a {kind.__name__} that is not valid: {_reason(error)}.") from error
    fields: dict[str, Any] = _plain(checked)
    return fields


def is_declared(data: object) -> bool:
    """Return whether data are an object of a class that `page` declares."""
    return hasattr(type(data), _KEY)  # asks the class only: an object may raise when it is inspected


def _reason(error: msgspec.ValidationError) -> str:
    """Return msgspec's message with the path to the field in Python's words.

    >>> _reason(msgspec.ValidationError("Expected `float`, got `str` - at `$.start.altitude_m`"))
    'Expected `float`, got `str` in field `start.altitude_m`'
    """
    return str(error).replace(" - at `$.", " in field `")


def _plain(value: Any) -> Any:
    """Return a value with each Struct in it as a dict, and each number of numpy as Python's."""
    if isinstance(value, msgspec.Struct):
        return {
            encoded: _plain(getattr(value, name))
            for name, encoded in zip(value.__struct_fields__, value.__struct_encode_fields__, strict=True)
        }
    if type(value) is list:
        return [_plain(item) for item in value]
    if type(value) is dict:
        return {key: _plain(item) for key, item in value.items()}
    numpy = sys.modules.get("numpy")
    return value.item() if numpy is not None and isinstance(value, numpy.generic) else value
