"""Registration of the environments as soon as gymnasium is imported, if `snr_sim.learning` was imported before."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib import import_module
from importlib.machinery import ModuleSpec, PathFinder
from types import ModuleType


class _GymnasiumFinder:
    """Entry of `sys.meta_path` that finds gymnasium as usual, and registers the environments after its import."""

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        spec = PathFinder.find_spec(name, path, target) if name == "gymnasium" else None
        if spec is None or spec.loader is None:
            return None
        execute = spec.loader.exec_module

        def execute_and_register(module: ModuleType) -> None:
            execute(module)
            import_module("snr_sim.learning.gym")

        spec.loader.exec_module = execute_and_register  # type: ignore[method-assign]
        return spec


def register_later() -> None:
    """Register the environments when gymnasium is imported."""
    sys.meta_path.insert(0, _GymnasiumFinder())
