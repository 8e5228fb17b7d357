"""What the water does to the vehicle where it is: weight and buoyancy of what is wet, the tether's pull, leaks.

How the vehicle moves by that is another matter (`space_mover.py`, `urov_2d.py`).
"""

from __future__ import annotations

from collections.abc import Sequence

from snr_sim.plants.urov.dive import Dive, Payload
from snr_sim.plants.urov.flotation import Flotation
from snr_sim.plants.urov.hydrodynamics import AT_REST, Hydrodynamics, product_with
from snr_sim.plants.urov.motion import Motion
from snr_sim.plants.urov.pool import Pool
from snr_sim.plants.urov.surface import Surface
from snr_sim.plants.urov.tether import TetherPull
from snr_sim.plants.urov.urov_state import Body
from snr_sim.plants.urov.vehicle import Six, Vector, Vehicle

SLOWING_ITERATIONS = 3  # with one, an error of first order in the step is left
WATER_STEP_L = 0.01  # the weight of leaked water is updated at each such increase


class WaterForces:
    """Buoyancy, surface, tether and what weighs the vehicle down. Reads `motion`."""

    def __init__(self, vehicle: Vehicle, pool: Pool, body: Body, motion: Motion) -> None:
        self.surface: Surface = Surface(vehicle)
        self.hydro: Hydrodynamics = Hydrodynamics(vehicle, body.rigid)  # for what is wet now
        self.flotation: Flotation = Flotation(vehicle, body.rigid, pool.density_kgm3, body.gravity_mps2)
        self.wet: float = 1.0  # fraction of the volume in the water, in the middle of the last step
        self.entrained_fraction: float = 1.0  # fraction whose water has been brought to the vehicle's speed
        self.impact_impulse: Sequence[float] | None = None  # for water that gets wet up to the middle of this step
        self.water_l: float = 0.0  # leaked and weighed
        self.tether: TetherPull | None = None
        self.tether_n: Vector = (0.0, 0.0, 0.0)  # its pull in the last step, world frame
        self._vehicle, self._pool, self._motion = vehicle, pool, motion
        self._added_momentum = product_with(vehicle.added_mass)  # of the water that moves with the body
        self._loads: Sequence[Payload] = ()

    def begin(self, dive: Dive) -> None:
        """Take up what a dive has for all of its time; `attach_loads` is due next."""
        self._leak = dive.leak
        self.impact_impulse = None
        mass_kg = self._vehicle.mass_kg + self._vehicle.added_mass[0, 0]
        self.tether = None if dive.tether is None else TetherPull(dive.tether, self._pool.density_kgm3, mass_kg)

    def attach_loads(self, loads: Sequence[Payload]) -> None:
        """Attach loads to the vehicle, in place of those before."""
        self._loads = loads
        self._update_weight()

    def _update_weight(self) -> None:
        self.flotation.load(self._loads, self.water_l, (0.0, 0.0, 0.0) if self._leak is None else self._leak.position_m)
        self.set_submerged_fraction(self.wet)

    def set_submerged_fraction(self, share: float) -> None:
        """Set the mass to what it is with this fraction of the volume in the water."""
        self.wet = share
        self.hydro.set_mass(self.flotation.mass, share)

    def leak(self) -> None:
        """Let water in, if the dive has a leak."""
        leak = self._leak
        if leak is None:
            return
        water_l = leak.water_l(self._motion.time_s)
        if water_l >= self.water_l + WATER_STEP_L or (water_l > self.water_l and water_l == leak.max_l):
            self.water_l = water_l
            self._update_weight()

    def add_water_forces(self, wrench: Sequence[float], nu: Six, dt_s: float) -> Sequence[float]:
        """Add the tether's force to a wrench, set what is wet, and the momentum that water takes which gets wet.

        Both depend on where the vehicle is, and are taken where it will be in the middle of the step.
        """
        motion, half = self._motion, 0.5 * dt_s
        x, y, z = motion.position
        vx, vy, vz = motion.velocity
        self.impact_impulse = None
        if z > -self.surface.reach_m:
            kx, ky, kz = motion.rotation[6:]
            p, q, r = motion.rate
            up_body = (kx + half * (ky * r - kz * q), ky + half * (kz * p - kx * r), kz + half * (kx * q - ky * p))
            before, entrained_fraction = self.wet, self.entrained_fraction
            self.float_at(z + half * vz, up_body)
            wet = self.wet
            if wet > entrained_fraction and dt_s > 0.0:
                # Water that gets wet by the body must be brought to its speed; what it leaves keeps it. So neither
                # coming up nor going down makes energy. Source: von Karman, NACA TN 321 (1929).
                share = wet - entrained_fraction
                self.impact_impulse = [share * value for value in self._added_momentum(*nu)]
            # From the middle of the step to its end as much again gets wet as in half a step before.
            self.entrained_fraction = min(1.0, wet + 0.5 * (wet - before)) if wet > before and dt_s > 0.0 else wet
        elif self.wet != 1.0:
            self.entrained_fraction = 1.0
            self.flotation.submerge()
            self.set_submerged_fraction(1.0)
        if self.tether is not None:
            wrench = self._add_tether(wrench, self.tether, (x + half * vx, y + half * vy, z + half * vz))
        return wrench

    def late_momentum(self, nu: Six) -> list[float]:
        """Return the momentum at a velocity of the water that gets wet after the middle of the step."""
        share = self.entrained_fraction - self.wet
        return [share * value for value in self._added_momentum(*nu)]

    def velocity_after_entrainment(self, nu: Six) -> Six:
        """Return the velocity at a step's end: less what the water took that got wet after its middle."""
        slowed = nu
        for _ in range(SLOWING_ITERATIONS):  # the water takes as much as brings it to the speed that is left
            slowed = self.hydro.subtract_impulse(nu, self.late_momentum(slowed))
        return slowed

    def float_at(self, z_m: float, up_body: Vector) -> None:
        """Set what is wet at a height and an attitude."""
        share, centre = self.surface.submerged_fraction(z_m, up_body)
        self.flotation.set_submerged(share, centre)
        if share != self.wet:
            self.set_submerged_fraction(share)

    def _add_tether(self, wrench: Sequence[float], tether: TetherPull, position: Vector) -> Sequence[float]:
        motion = self._motion
        bx, by, bz = tether.tether.attachment_m
        p, q, r = motion.rate
        arm = motion.in_world(bx, by, bz)
        turning = motion.in_world(q * bz - r * by, r * bx - p * bz, p * by - q * bx)
        end = (position[0] + arm[0], position[1] + arm[1], position[2] + arm[2])
        vx, vy, vz = motion.velocity
        self.tether_n = tether.force(end, (vx + turning[0], vy + turning[1], vz + turning[2]), motion.current)
        a, b, c = motion.in_body(*self.tether_n)
        x, y, z, k, m, n = wrench
        return x + a, y + b, z + c, k + by * c - bz * b, m + bz * a - bx * c, n + bx * b - by * a

    def acceleration_at_start(self) -> Six:
        """Return the acceleration that a dive begins with, of the velocity through the water, body frame."""
        motion = self._motion
        z, up_body = motion.position[2], motion.rotation[6:]
        if z > -self.surface.reach_m:
            self.float_at(z, up_body)
            self.entrained_fraction = self.wet
        nu = motion.through_water()
        wrench = self.add_water_forces(AT_REST, nu, 0.0)
        return self.hydro.advance(
            nu, up_body, wrench, self.flotation.net_n, self.flotation.static_moment_nm, AT_REST, 0.0
        )[1]


def world_acceleration(motion: Motion, change: Six) -> Vector:
    """Return the linear acceleration in the world, from how the velocity's numbers in the body's frame change."""
    u, v, w, p, q, r = motion.through_water()
    du, dv, dw = change[:3]
    return motion.in_world(du + q * w - r * v, dv + r * u - p * w, dw + p * v - q * u)
