"""Settings of a component in the short form `Gentle.factory(name="gentle", hover=0.3)`: which ones a class has."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator, Mapping
from typing import Any

from snr_sim.prelude.errors import ConfigError, suggest

_GIVEN = 4  # self, factory, parent, name: the parameters of every component's __init__


def split_settings(kind: type, settings: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the settings that are parameters of a class's `__init__`, and those that are its attributes.

    An attribute is declared in the class's body, with or without a value: `hover = 0.3` or `hover: float`.

    Raises:
        ConfigError: the class has no such setting, or a parameter without default is not given.
    """
    parameters = list(inspect.signature(kind.__init__).parameters.values())[_GIVEN:]  # type: ignore[misc]
    named = {one.name: one for one in parameters if one.kind in (one.POSITIONAL_OR_KEYWORD, one.KEYWORD_ONLY)}
    takes_all = any(one.kind is one.VAR_KEYWORD for one in parameters)
    missing = [name for name, one in named.items() if one.default is one.empty and name not in settings]
    if missing:
        raise ConfigError(
            f"{kind.__name__}.factory() needs {', '.join(missing)}: a parameter of its __init__ without a default.",
            fix=f"{kind.__name__}.factory({missing[0]}=...).",
        )
    for_init = {key: value for key, value in settings.items() if key in named}
    for_object = {key: value for key, value in settings.items() if key not in named}
    attributes = set(_attributes(kind))
    for key in list(for_object):
        if key in attributes:
            continue
        if not takes_all:
            known = sorted(attributes | named.keys())
            raise ConfigError(
                f"{kind.__name__} has no setting '{key}'.",
                fix=f"{suggest(key, known) if known else ''} A setting is declared in the class: {key} = ...".strip(),
            )
        for_init[key] = for_object.pop(key)
    return for_init, for_object


def _attributes(kind: type) -> Iterator[str]:
    """Yield the public attributes that a class and its bases declare; methods and properties are not settings."""
    for base in kind.__mro__:
        for name, value in vars(base).items():
            if not (name.startswith("_") or callable(value) or hasattr(value, "__get__")):
                yield name
        yield from (name for name in vars(base).get("__annotations__", ()) if not name.startswith("_"))


def default_name(kind: type) -> str:
    """Return the name of a component whose factory names none: its class's, in lower case with underscores.

    >>> default_name(type("DepthHold", (), {}))
    'depth_hold'
    """
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", kind.__name__).lower()
