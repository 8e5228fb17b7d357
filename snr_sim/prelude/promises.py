"""Whether an object keeps a promise: a Protocol of this kit, whose members it must have."""

from __future__ import annotations

from typing import Any, TypeGuard, TypeVar

PromiseT = TypeVar("PromiseT")


def lacks(thing: Any, promise: type[Any]) -> list[str]:
    """Return the public members of a promise that an object does not have, in alphabetical order.

    Asks the object itself, so a wrapper that passes on what it is asked for (`__getattr__`) has the members of what it
    wraps. `isinstance` with a Protocol says so too up to Python 3.11, and no more from 3.12 on.

    >>> from snr_sim.prelude.device import Device
    >>> lacks(3.5, Device)
    ['activate', 'close', 'configure', 'deactivate', 'health']
    """
    protocols = [base for base in promise.__mro__ if getattr(base, "_is_protocol", False)]
    members = {name for base in protocols for name in (*vars(base), *vars(base).get("__annotations__", ()))}
    return sorted(name for name in members if not name.startswith("_") and not hasattr(thing, name))


def keeps(thing: Any, promise: type[PromiseT]) -> TypeGuard[PromiseT]:
    """Return whether an object has all members of a promise."""
    return not lacks(thing, promise)
