"""Guarded edits: which program an edit replaced, and whether the new one has failed since."""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

from snr_sim.behaviors.context import NS_PER_S
from snr_sim.behaviors.interpreter import RunProblem
from snr_sim.behaviors.program import Program


class GuardedEdit(NamedTuple):
    """An edit that may be undone: the program before it, until when, and the problems that were known then."""

    before: Program
    until_ns: int
    known: frozenset[tuple[str, str]]


class EditGuard:
    """The edits of a machine that may be undone, the newest last.

    Args:
        guard_s: how long after an edit.
    """

    def __init__(self, guard_s: float) -> None:
        self._guard_ns = round(guard_s * NS_PER_S)
        self._edits: list[GuardedEdit] = []
        self.is_waiting: bool = False  # the program before is on its way

    def add(self, before: Program, known: Collection[RunProblem], now_ns: int) -> None:
        """Guard an edit.

        Args:
            before: the program that it replaced.
            known: problems of that program: they are not of the edit.
            now_ns: when.
        """
        problems = frozenset((one.block, one.message) for one in known)
        self._edits.append(GuardedEdit(before, now_ns + self._guard_ns, problems))

    def remove(self) -> None:
        """Forget the newest edit, which has been undone."""
        del self._edits[-1:]

    def newest(self, now_ns: int) -> GuardedEdit | None:
        """Return the edit that is to be undone if the program fails now; None if there is none, or if it is being."""
        self._edits = [one for one in self._edits if now_ns <= one.until_ns]
        return self._edits[-1] if self._edits and not self.is_waiting else None

    def failure(self, problems: Collection[RunProblem], now_ns: int) -> str:
        """Return which problem is new since the newest edit; empty if there is none."""
        edit = self.newest(now_ns) if problems else None
        new = [] if edit is None else [one for one in problems if (one.block, one.message) not in edit.known]
        return f"line {new[-1].line}: [{new[-1].block}] failed: {new[-1].message}" if new else ""
