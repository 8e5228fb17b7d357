"""Where the wrist of the arm is, and which angles put it somewhere: two links in an upright plane.

Radius and height are from the shoulder, the angles those of shoulder and elbow. Source: the law of cosines, as in
Craig, Introduction to Robotics, 3rd edition, section 4.4; of its two solutions the one with the elbow up.
"""

from __future__ import annotations

import math

from snr_sim.plants import Manipulator


def wrist_m(arm: Manipulator, shoulder_rad: float, elbow_rad: float) -> tuple[float, float]:
    """Return radius and height of the wrist."""
    upper_m, fore_m, _ = arm.lengths_m
    both_rad = shoulder_rad + elbow_rad
    return (
        upper_m * math.cos(shoulder_rad) + fore_m * math.cos(both_rad),
        upper_m * math.sin(shoulder_rad) + fore_m * math.sin(both_rad),
    )


def angles_rad(arm: Manipulator, radius_m: float, height_m: float) -> tuple[float, float] | None:
    """Return the angles of shoulder and elbow that put the wrist there; None where it cannot be."""
    upper_m, fore_m, _ = arm.lengths_m
    cosine = (radius_m**2 + height_m**2 - upper_m**2 - fore_m**2) / (2.0 * upper_m * fore_m)
    if not -1.0 <= cosine <= 1.0:
        return None
    elbow = -math.acos(cosine)
    shoulder = math.atan2(height_m, radius_m) - math.atan2(fore_m * math.sin(elbow), upper_m + fore_m * math.cos(elbow))
    is_in = arm.lows_rad[1] <= shoulder <= arm.highs_rad[1] and arm.lows_rad[2] <= elbow <= arm.highs_rad[2]
    return (shoulder, elbow) if is_in else None
