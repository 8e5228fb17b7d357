"""What `snr doctor` finds: one line each."""

from __future__ import annotations

from typing import NamedTuple


class Finding(NamedTuple):
    """One thing looked at: whether it is well, what was found, and what to do if not, or if one wants more."""

    is_well: bool
    what: str
    fix: str = ""

    @property
    def tag(self) -> str:
        """How the line begins: MISS only if something that is needed is not there."""
        if not self.is_well:
            return "MISS"
        return "note" if self.fix else "ok"
