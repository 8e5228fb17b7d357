"""Pause of the garbage collector while a run is read or drawn."""

from __future__ import annotations

import contextlib
import gc
from collections.abc import Iterator


@contextlib.contextmanager
def no_garbage_collection() -> Iterator[None]:
    """Disable the search for reference cycles in the block, for code that creates many objects without cycles.

    Scanning all records of a run repeatedly while their number grows took as long as reading them.
    """
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()
