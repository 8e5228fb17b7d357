"""A garbage collector that stands still while a run is read or drawn."""

from __future__ import annotations

import contextlib
import gc
from collections.abc import Iterator


@contextlib.contextmanager
def no_garbage_collection() -> Iterator[None]:
    """Switch the search for reference cycles off meanwhile: for code that makes many objects and no cycle of them.

    To look through all records of a run, again and again while they become more, took as long as to read them.
    """
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()
