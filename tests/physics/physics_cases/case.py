"""A case in which the vehicle's motion is known without a simulation.

Each case runs at 2, 5 and 10 ms. The reference is a closed form, a conserved quantity, the root of steady equations or
an independent result that shares nothing with the plant; `allowed` is how far the plant may be from it, and
`reason` says what that leaves room for.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

STEPS_S = (0.002, 0.005, 0.01)

SECOND_ORDER = "error of the midpoint rule, of second order in the step"
LEFT = "what is left of the way to it in 12 s"
ROUNDS = "what the rounds leave of the midpoint rule's equation"


@dataclass(frozen=True)
class Case:
    """One number that is known.

    Args:
        group: heading of the page it stands under.
        name: what is measured.
        expected: what it should be, or a function that computes it: an integration is not run before it is needed.
        unit: of it.
        run: gives what it is, for a step.
        allowed: largest error, relative to the reference; if that is 0, in the unit.
        reason: what `allowed` leaves room for.
        is_long: whether it takes seconds, too long for the fast lane.
    """

    group: str
    name: str
    expected: float | Callable[[], float]
    unit: str
    run: Callable[[float], float]
    allowed: float
    reason: str = SECOND_ORDER
    is_long: bool = False

    @cached_property
    def reference(self) -> float:
        """What it should be."""
        return self.expected() if callable(self.expected) else self.expected

    def error(self, ours: float) -> float:
        """Return the error as `allowed` counts it."""
        return ours / self.reference - 1.0 if self.reference else ours
