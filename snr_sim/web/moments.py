"""Changes of state as pages show them, and the newest of them."""

from __future__ import annotations

from collections import deque
from itertools import islice
from typing import Any

from snr_sim.behaviors.interpreter import NS_PER_S
from snr_sim.web.message_parts import Moment

MAX_MOMENTS = 10_000  # of a running machine; those before are in the recording


def moment_of(fields: dict[str, Any], number: int) -> Moment:
    """Return a change of state from the fields of a `Change`; `number` is that of the program."""
    return Moment(
        fields["t_ns"] / NS_PER_S,
        fields["machine"],
        fields["kind"],
        fields["name"],
        fields["source"],
        fields["target"],
        fields["held_ns"] / NS_PER_S,
        fields["line"],
        number,
    )


class Moments:
    """The newest changes of state, counted from the first one.

    Args:
        max_kept: how many are kept; None: all.
    """

    def __init__(self, max_kept: int | None = MAX_MOMENTS) -> None:
        self._kept: deque[Moment] = deque(maxlen=max_kept)
        self.count: int = 0  # of all, also of those that are not kept any more

    @property
    def newest(self) -> Moment | None:
        """The newest one."""
        return self._kept[-1] if self._kept else None

    def add(self, moment: Moment) -> None:
        """Keep a change."""
        self._kept.append(moment)
        self.count += 1

    def since(self, count: int, max_given: int) -> tuple[list[Moment], int]:
        """Return the changes after the first `count`, at most the newest `max_given`, and how many were left out."""
        new = self.count - count
        given = min(new, max_given, len(self._kept))
        return list(islice(self._kept, len(self._kept) - given, None)), new - given
