"""Findings of `snr doctor`, one line each."""

from __future__ import annotations

from typing import NamedTuple


class Finding(NamedTuple):
    """Result of one check: whether it passed, what was found, and the fix or an optional improvement."""

    is_ok: bool
    message: str
    fix: str = ""

    @property
    def tag(self) -> str:
        """Start of the line: MISS only if a required item is missing."""
        if not self.is_ok:
            return "MISS"
        return "note" if self.fix else "ok"
