"""Public names that are imported when they are first used, so that importing a public package costs nothing.

A package with a table of public names imports them for type checkers only, and calls `lazy_names` otherwise:

    if TYPE_CHECKING:
        from snr_sim.plants.urov.pool import Gate as Gate  # "as" exports the name for type checkers
    else:
        __all__, __getattr__, __dir__ = lazy_names(__name__, {"snr_sim.plants.urov.pool": "Gate"})
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any


def lazy_names(
    package: str, names: Mapping[str, str], renamed: Mapping[str, str] | None = None, otherwise: str = ""
) -> tuple[list[str], Callable[[str], Any], Callable[[], list[str]]]:
    """Return the `__all__`, `__getattr__` and `__dir__` of a package.

    Args:
        package: its name.
        names: public names by module, separated by spaces; `A=B` is public as A and called B in its module, and
            without any names the module itself is public.
        renamed: new names by the old ones, which still work, with a warning.
        otherwise: package whose names can be imported from this one, too, as the thesis' programs do.
    """
    found: dict[str, tuple[str, str]] = {}
    for module, text in names.items():
        if not text:
            found[module.rpartition(".")[2]] = module, ""
        for entry in text.split():
            public, _, name = entry.partition("=")
            found[public] = module, name or public

    def get(name: str) -> Any:
        if renamed and name in renamed:
            from snr_sim.prelude.renamed import warn_renamed

            warn_renamed(f"{package}.{name}", renamed[name])
            return getattr(sys.modules[package], renamed[name])
        if name not in found and otherwise and name[:2] != "__":
            return getattr(import_module(otherwise), name)
        if name not in found:
            raise AttributeError(f"module '{package}' has no attribute '{name}'")
        module, attribute = found[name]
        value: Any = import_module(module)
        if attribute:
            value = getattr(value, attribute)
        setattr(sys.modules[package], name, value)  # so Python does not call this function for the name again
        return value

    def names_of_package() -> list[str]:
        return sorted({*found, *(name for name in vars(sys.modules[package]) if name.startswith("__"))})

    return list(found), get, names_of_package
