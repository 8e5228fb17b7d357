"""Names that were renamed: the old one works for one minor release, with a warning that names the new one."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Mapping
from typing import Any


def warn_renamed(old: str, new: str, stacklevel: int = 3) -> None:
    """Warn that a name was renamed, at the line of the caller's caller."""
    warnings.warn(f"{old} is now called {new}; the old name goes with release 0.3.", DeprecationWarning, stacklevel)


def old_names(module: str, renamed: Mapping[str, str]) -> Callable[[str], Any]:
    """Return a module's `__getattr__` that finds what was renamed, given new names by the old ones."""

    def find(name: str) -> Any:
        if name not in renamed:
            raise AttributeError(f"module '{module}' has no attribute '{name}'")
        warn_renamed(f"{module}.{name}", renamed[name])
        return getattr(sys.modules[module], renamed[name])

    return find
