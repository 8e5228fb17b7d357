"""Threads that student code started and did not end: Python keeps the program alive until they return."""

from __future__ import annotations

import sys
import threading
from collections.abc import Collection

from snr_sim.core.source_location import current_location

_POOLS = "concurrent.futures.thread"  # Python ends a pool's idle threads itself


def notes_on_threads(before: Collection[threading.Thread] = ()) -> list[str]:
    """Return a note on each thread, except those from `before` the run, that keeps the program alive; with its line."""
    frames, notes = sys._current_frames(), []
    for thread in threading.enumerate():
        if thread.daemon or thread is threading.main_thread() or thread in before or thread.ident is None:
            continue
        location = current_location(frames.get(thread.ident))
        if location is None and getattr(getattr(thread, "_target", None), "__module__", "") == _POOLS:
            continue
        where = "" if location is None else f" ({location})"
        notes.append(
            f"Thread '{thread.name}'{where} still runs, and keeps the program alive until it returns. "
            "Start it with daemon=True, and end it in halt()."
        )
    return notes
