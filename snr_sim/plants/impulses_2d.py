"""Contact impulses on a body in the plane x-z: also on one whose mass differs by direction, as pymunk's cannot.

pymunk detects contact points, normals and depths; this module computes the impulses. Each contact in turn applies the
impulse that stops the body there, never a pulling one, with friction up to its limit, until all converge (sequential
impulses). Every step starts from zero impulses, so a body at rest can be restored bitwise.

For a body seen from above, y takes the place of z, and a turn about the vertical has the opposite sign.

Source: Catto, Iterative Dynamics with Temporal Coherence (2005); with a full matrix in place of one mass, and without
the coherence.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from snr_sim.prelude.sums import dot_product, ordered_sum

ITERATIONS = 30
ALLOWED_PENETRATION_M = 0.0005  # allowed depth of a contact; the excess is reduced by this fraction in a step
BAUMGARTE_FACTOR = 0.1
MAX_CORRECTION_MPS = 0.2


class Contact(NamedTuple):
    """One contact point of a body, world frame."""

    out_x: float  # unit vector away from what it touches
    out_z: float
    arm_x: float  # from the body's origin to the point [m]
    arm_z: float
    depth_m: float  # how deep it is in


def contacts_of(hit: Any, x_m: float, z_m: float) -> Iterator[Contact]:
    """Yield the contacts of a body, whose origin is at a position, from what pymunk's `shape_query` found."""
    out_x, out_z = -hit.contact_point_set.normal
    for point in hit.contact_point_set.points:
        # Not `point.distance`, whose sign depends on the kinds of the two shapes (pymunk 7.3).
        (at_x, at_z), (solid_x, solid_z) = point.point_a, point.point_b
        depth_m = (solid_x - at_x) * out_x + (solid_z - at_z) * out_z
        yield Contact(out_x, out_z, at_x - x_m, at_z - z_m, depth_m)


def resolve_contacts(
    velocity: tuple[float, float, float],
    contacts: Sequence[Contact],
    mobility: Sequence[Sequence[float]],
    friction: float,
    dt_s: float,
) -> tuple[tuple[float, float, float], tuple[float, float]]:
    """Return the velocity after all contacts, and their total impulse [N s], world frame.

    Args:
        velocity: without contacts: along x and z [m/s], rate about y [rad/s].
        contacts: where it touches.
        mobility: 3 x 3, what an impulse does to the velocity.
        friction: coefficient.
        dt_s: length of the step.
    """
    rows = []
    for contact in contacts:
        out_x, out_z, arm_x, arm_z = contact[:4]
        # A point at `arm` moves by (q arm_z, -q arm_x) when the body turns about y.
        for x, z in ((out_x, out_z), (-out_z, out_x)):
            direction = (x, z, x * arm_z - z * arm_x)
            response = [dot_product(row, direction) for row in mobility]
            rows.append((direction, response, 1.0 / dot_product(direction, response)))
    target_mps = [
        min(MAX_CORRECTION_MPS, BAUMGARTE_FACTOR * max(0.0, contact.depth_m - ALLOWED_PENETRATION_M) / dt_s)
        for contact in contacts
    ]
    impulses = [0.0] * len(rows)
    vx, vz, q = velocity
    for _ in range(ITERATIONS):
        for i, ((x, z, turn), (ax, az, aq), per_speed) in enumerate(rows):
            speed = x * vx + z * vz + turn * q
            if i % 2 == 0:
                new = max(0.0, impulses[i] + (target_mps[i // 2] - speed) * per_speed)
            else:
                limit = friction * impulses[i - 1]
                new = min(limit, max(-limit, impulses[i] - speed * per_speed))
            more = new - impulses[i]
            impulses[i] = new
            vx, vz, q = vx + more * ax, vz + more * az, q + more * aq
    along_x = ordered_sum(impulse * row[0][0] for impulse, row in zip(impulses, rows, strict=True))
    along_z = ordered_sum(impulse * row[0][1] for impulse, row in zip(impulses, rows, strict=True))
    return (vx, vz, q), (along_x, along_z)
