"""Former place of pages, which are in `prelude/task.py`: files that students have import it until release 0.3."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from snr_sim.prelude import task
from snr_sim.prelude.renamed import warn_renamed

if not TYPE_CHECKING:  # a type checker would accept any name

    def __getattr__(name: str) -> Any:
        found = getattr(task, name)
        warn_renamed(f"snr_sim.prelude.page.{name}", f"snr_sim.prelude.task.{name}")
        return found
