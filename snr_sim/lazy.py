"""Public names that are imported when they are first used, so that importing a public package costs nothing.

A public package imports its names for type checkers only, one in each line, and `lazy_names` reads these lines:

    if TYPE_CHECKING:
        from snr_sim.plants.urov.pool import Gate as Gate  # "as" exports the name for type checkers
    else:
        __all__, __getattr__, __dir__ = lazy_names(__name__)
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any


def lazy_names(
    package: str, renamed: Mapping[str, str] | None = None, otherwise: str = ""
) -> tuple[list[str], Callable[[str], Any], Callable[[], list[str]]]:
    """Return the `__all__`, `__getattr__` and `__dir__` of a package.

    Args:
        package: its name.
        renamed: new names by the old ones, which still work, with a warning.
        otherwise: package whose names can be imported from this one, too, as the thesis' programs do.
    """
    found = _imported_names(package)

    def get(name: str) -> Any:
        if renamed and name in renamed:
            from snr_sim.prelude.renamed import warn_renamed

            warn_renamed(f"{package}.{name}", renamed[name])
            return getattr(sys.modules[package], renamed[name])
        if name not in found and otherwise and name[:2] != "__":
            return getattr(import_module(otherwise), name)
        if name not in found:
            raise AttributeError(f"module '{package}' has no attribute '{name}'")
        home, attribute = found[name]
        names = vars(import_module(home))
        value = names[attribute] if attribute in names else import_module(f"{home}.{attribute}")
        setattr(sys.modules[package], name, value)  # so Python does not call this function for the name again
        return value

    def names_of_package() -> list[str]:
        return sorted({*found, *(name for name in vars(sys.modules[package]) if name.startswith("__"))})

    return list(found), get, names_of_package


def _imported_names(package: str) -> dict[str, tuple[str, str]]:
    """Return module and name there of each public name: of `from A import B as C`, and `C: TypeAlias = B` after it."""
    module: Any = sys.modules[package]
    found: dict[str, tuple[str, str]] = {}
    # The loader's bytes: decoding as Python does would import `tokenize`, which takes longer than all of this.
    for line in module.__spec__.loader.get_data(module.__file__).decode().splitlines():
        words = line.split()
        if line.startswith("    from ") and words[4:5] == ["as"]:
            found[words[5]] = words[1], words[3]
        elif words[1:2] == ["TypeAlias"]:
            found[words[0].rstrip(":")] = found.pop(words[3])
    return found
