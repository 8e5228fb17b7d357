"""Check of interfaces: whether an object has all members of a Protocol."""

from __future__ import annotations

from typing import Any, TypeGuard, TypeVar

InterfaceT = TypeVar("InterfaceT")


def missing_members(thing: Any, interface: type[Any]) -> list[str]:
    """Return the public members of a Protocol that an object does not have, in alphabetical order.

    Queries the object itself, so a wrapper with `__getattr__` has the members of the wrapped object. `isinstance` with
    a Protocol does so up to Python 3.11, but not from 3.12 on.

    >>> from snr_sim.prelude.device import Device
    >>> missing_members(3.5, Device)
    ['activate', 'close', 'configure', 'deactivate', 'health']
    """
    protocols = [base for base in interface.__mro__ if getattr(base, "_is_protocol", False)]
    members = {name for base in protocols for name in (*vars(base), *vars(base).get("__annotations__", ()))}
    return sorted(name for name in members if not name.startswith("_") and not hasattr(thing, name))


def implements(thing: Any, interface: type[InterfaceT]) -> TypeGuard[InterfaceT]:
    """Return whether an object has all members of a Protocol."""
    return not missing_members(thing, interface)
