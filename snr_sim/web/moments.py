"""Changes of state as pages show them, and the newest of them."""

from __future__ import annotations

from bisect import bisect_right
from sys import intern
from typing import Any

from snr_sim.behaviors.interpreter import NS_PER_S
from snr_sim.web.messages import Moment

MAX_MOMENTS = 10_000  # of a running machine; those before are in the recording


def moment_of(fields: dict[str, Any], number: int) -> Moment:
    """Return a change of state from the fields of a `Change`; `number` is that of the program."""
    # Each program has strings of its own: of a run that is edited twice a second they took half of what moments take.
    return Moment(
        fields["t_ns"] / NS_PER_S,
        intern(fields["machine"]),
        intern(fields["kind"]),
        intern(fields["name"]),
        intern(fields["source"]),
        intern(fields["target"]),
        fields["held_ns"] / NS_PER_S,
        fields["line"],
        number,
    )


class Moments:
    """The newest changes of state in order of time, counted from the first one.

    Args:
        max_kept: how many are kept at least; None: all.
    """

    def __init__(self, max_kept: int | None = MAX_MOMENTS) -> None:
        self._max_kept = max_kept
        self._kept: list[Moment] = []
        self.count: int = 0  # of all, also of those that are not kept any more

    @property
    def newest(self) -> Moment | None:
        """The newest one."""
        return self._kept[-1] if self._kept else None

    def add(self, moment: Moment) -> None:
        """Keep a change."""
        self._kept.append(moment)
        self.count += 1
        if self._max_kept is not None and len(self._kept) > 2 * self._max_kept:
            del self._kept[: -self._max_kept]

    def since(self, count: int, max_given: int) -> tuple[list[Moment], int]:
        """Return the changes after the first `count`, at most the newest `max_given`, and how many were left out."""
        new = self.count - count
        given = min(new, max_given, len(self._kept))
        return self._kept[len(self._kept) - given :], new - given

    def at(self, t_s: float) -> Moment | None:
        """Return the newest change up to a moment."""
        place = bisect_right(self._kept, t_s, key=lambda one: one.t_s)
        return self._kept[place - 1] if place else None
