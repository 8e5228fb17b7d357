"""A neutrally buoyant tether: what it pulls at the vehicle, by its length and by the water that flows past it.

It runs straight from where it is held to the vehicle. That is the cheap model: a real one bows, and a slack one hangs
behind. Beyond its length it pulls as a spring, with the stiffness of its own stretch and a little damping, and never
pushes. The water's drag on it is that on a cylinder, across and along, and the end at the vehicle carries the share
that a straight line between two pins would put on it: half of it in an even current, a quarter for the vehicle's
own motion (Simpson's rule over the line gives both exactly).

Source: von Benzon et al. 2022, JMSE 10:1898: diameter, Young's modulus, drag coefficients. 20 m in a cross current of
0.3 m/s: 8.1 N, half of it at the vehicle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

from snr_sim.plants.parameter_limits import LIMITS, Record
from snr_sim.plants.urov.vehicle import Vector


@dataclass(frozen=True)
class Tether(Record, who="The tether's "):
    """One tether.

    Args:
        anchor_m: where it is held, world frame.
        length_m: how much is paid out.
        attachment_m: where it is fixed to the vehicle, body frame.
        modulus_pa: Young's modulus.
        across, along: drag coefficients for flow across it and along it.
        damping_share: damping ratio of its stretch, by the vehicle's mass; our choice.
    """

    anchor_m: Annotated[Vector, LIMITS["position_m"]]
    length_m: Annotated[float, LIMITS["length_m"]] = 35.0
    attachment_m: Annotated[Vector, LIMITS["body_position_m"]] = (-0.2, 0.0, 0.0)
    diameter_m: Annotated[float, LIMITS["diameter_m"]] = 0.0075
    modulus_pa: Annotated[float, LIMITS["modulus_pa"]] = 6.437e7
    across: Annotated[float, LIMITS["across"]] = 1.2
    along: Annotated[float, LIMITS["along"]] = 0.01
    damping_share: Annotated[float, LIMITS["damping_share"]] = 0.1

    @property
    def stiffness_npm(self) -> float:
        """Force per metre of stretch."""
        return self.modulus_pa * 0.25 * math.pi * self.diameter_m**2 / self.length_m


class TetherPull:
    """The pull of one tether at its vehicle, by whose mass its stretch is damped."""

    def __init__(self, tether: Tether, density_kgm3: float, mass_kg: float) -> None:
        self.tether: Tether = tether
        self._stiffness = tether.stiffness_npm
        self._damping = 2.0 * tether.damping_share * math.sqrt(self._stiffness * mass_kg)
        self._across = 0.5 * density_kgm3 * tether.across * tether.diameter_m
        self._along = 0.5 * density_kgm3 * tether.along * tether.diameter_m * math.pi

    def force(self, end_m: Vector, velocity: Vector, current: Vector) -> Vector:
        """Return the force on the vehicle [N], world frame.

        Args:
            end_m: where the tether meets the vehicle, world frame.
            velocity: of that point, world frame.
            current: of the water, world frame.
        """
        ax, ay, az = self.tether.anchor_m
        dx, dy, dz = end_m[0] - ax, end_m[1] - ay, end_m[2] - az
        span = math.sqrt(dx * dx + dy * dy + dz * dz)
        if span < 1e-6:
            return 0.0, 0.0, 0.0
        tx, ty, tz = dx / span, dy / span, dz / span
        vx, vy, vz = velocity
        fx, fy, fz = 0.0, 0.0, 0.0
        # Drag in the middle of the line counts 1/3, at the vehicle 1/6.
        for place, share in ((0.5, span / 3.0), (1.0, span / 6.0)):
            ux, uy, uz = current[0] - place * vx, current[1] - place * vy, current[2] - place * vz
            slip = ux * tx + uy * ty + uz * tz
            nx, ny, nz = ux - slip * tx, uy - slip * ty, uz - slip * tz
            across = share * self._across * math.sqrt(nx * nx + ny * ny + nz * nz)
            along = share * self._along * abs(slip) * slip
            fx += across * nx + along * tx
            fy += across * ny + along * ty
            fz += across * nz + along * tz
        stretch = span - self.tether.length_m
        if stretch > 0.0:
            opening = vx * tx + vy * ty + vz * tz
            pull = max(0.0, self._stiffness * stretch + self._damping * opening)
            fx, fy, fz = fx - pull * tx, fy - pull * ty, fz - pull * tz
        return fx, fy, fz
