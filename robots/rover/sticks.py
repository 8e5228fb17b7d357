"""From sticks to shares of what each side of the rover can do.

    tank     a stick for each side:  left, right --> curve --> sides
    arcade   one stick:              ahead, turn --> curve --> mixed --> sides

The curve is that of roveberrypy, which this rover follows: sign(y) (17^|y| - 1) / 16, and nothing in the dead zone.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from snr_sim.errors import CommandError

DEAD_ZONE = 0.1  # sticks at rest are not at 0
STEEPNESS = 17.0


class Sides(NamedTuple):
    """Share of the limit for each side, -1 to 1; ahead is positive."""

    left: float
    right: float


def curve(stick: float) -> float:
    """Return the share of the limit that a stick asks for: little at first, all at the end, and never more.

    >>> curve(0.09), curve(1.0), curve(-1.5), round(curve(0.5), 3)
    (0.0, 1.0, -1.0, 0.195)

    Raises:
        CommandError: it is NaN.
    """
    if math.isnan(stick):
        raise CommandError("A stick is NaN.", fix="look for a division by zero in what reads it.")
    size = min(1.0, abs(stick))
    return 0.0 if size < DEAD_ZONE else math.copysign((STEEPNESS**size - 1.0) / (STEEPNESS - 1.0), stick)


def tank(left: float | None, right: float | None) -> Sides | None:
    """Return the sides for two sticks; None, not a command, if one of them has no value."""
    return None if left is None or right is None else Sides(curve(left), curve(right))


def arcade(ahead: float | None, turn: float | None) -> Sides | None:
    """Return the sides for one stick, turning to the left positive; None if an axis has no value.

    A side that would get more than all gets all, and the other as much less as keeps the curve.

    >>> arcade(1.0, 1.0), arcade(0.0, -1.0)
    (Sides(left=0.0, right=1.0), Sides(left=1.0, right=-1.0))
    """
    if ahead is None or turn is None:
        return None
    forward, about = curve(ahead), curve(turn)
    largest = max(1.0, abs(forward) + abs(about))
    return Sides((forward - about) / largest, (forward + about) / largest)
