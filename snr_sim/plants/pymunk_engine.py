"""The only module that imports pymunk, at the first call."""

from __future__ import annotations

from types import ModuleType

from snr_sim.prelude.errors import MissingExtraError


def pymunk_module() -> ModuleType:
    """Return pymunk; raise a MissingExtraError if it is not installed."""
    try:
        import pymunk
    except ImportError as error:
        raise MissingExtraError("pymunk", "sim") from error
    module: ModuleType = pymunk
    return module
