"""What acts on the underwater vehicle: by the clock faults, current, loads and leak, in each step thrusters, surface,
tether.

How it moves by that is another matter (`urov.py`).
"""

from __future__ import annotations

import bisect
import math
from collections.abc import Sequence

import numpy as np

from snr_sim.plants.urov.dive import Dive, Leak, Load
from snr_sim.plants.urov.flotation import Flotation
from snr_sim.plants.urov.hydrodynamics import Product
from snr_sim.plants.urov.surface import Surface
from snr_sim.plants.urov.tether import TetherPull
from snr_sim.plants.urov.urov_measured import UrovMeasured
from snr_sim.plants.urov.vehicle import Matrix, Six, Vector

STOP_US = 1500.0
SLOWING_ROUNDS = 3  # with one, an error of first order in the step is left
WATER_STEP_L = 0.01  # leaked water is weighed anew when it has become so much more


class UrovForces(UrovMeasured):
    """The state of an underwater vehicle, and what acts on it.

    Attributes:
        dive: of this run.
    """

    dive: Dive
    _matrix: Matrix
    _added_momentum: Product  # of the water that moves with the body, given six velocities
    _surface: Surface
    _flotation: Flotation
    _moments_s: list[float]
    _next_s: float
    _happened: int
    _loads: list[Load]
    _slam: Sequence[float] | None  # momentum for the water that gets wet up to the middle of this step
    _more: Matrix
    _wrench: Six
    _pulses: list[float | None]
    _pulses_until_s: float

    # -- what happens by the clock -------------------------------------------------------------------------------------

    def _happen(self) -> None:
        """Lets happen what the dive has until now."""
        now_s = self.time_s + 1e-9
        before, self._happened = self._happened, bisect.bisect_right(self._moments_s, now_s)
        if self._happened > before:
            moments = set(self._moments_s[before : self._happened])
            for fault in self.dive.faults:
                if fault.at_s in moments and self.thrusters is not None:
                    self.thrusters.fail(fault.number_in(self._names), fault.fault, fault.share)
            self._take_up(self._moments_s[self._happened - 1])

    def _take_up(self, time_s: float) -> None:
        """Sets current and loads to what they are from a moment on."""
        self._current = self.dive.current_at(time_s)
        self._loads = self.dive.loads_at(time_s)
        following = self._moments_s[self._happened :]
        self._next_s = following[0] - 1e-9 if following else math.inf
        self._weigh()

    def _weigh(self) -> None:
        """Weighs vehicle, loads and leaked water."""
        leak = self.dive.leak
        self._flotation.load(self._loads, self._water_l, (0.0, 0.0, 0.0) if leak is None else leak.place_m)
        self._set_wet(self._wet)

    def _set_wet(self, share: float) -> None:
        """Sets the mass to what it is with this share of the volume in the water."""
        self._hydro.set_mass(self._flotation.mass, share)
        self._more = self._hydro.mass - self._body.rigid  # what MuJoCo does not know of

    def _leak(self, leak: Leak) -> None:
        """Lets water in."""
        water_l = leak.water_l(self.time_s)
        if water_l >= self._water_l + WATER_STEP_L or (water_l > self._water_l and water_l == leak.most_l):
            self._water_l = water_l
            self._weigh()

    # -- forces -------------------------------------------------------------------------------------------------------

    def _thrust(self) -> Sequence[float]:
        """Returns the wrench of the thrusters, less what draws air, or the one that was asked for."""
        if self.thrusters is None:
            return self._wrench
        if self._steps * self.step_s >= self._pulses_until_s:
            self._pulses, self._pulses_until_s = [STOP_US] * len(self._pulses), math.inf  # nobody has renewed them
        self.thrusters.step(self.step_s, self._pulses)
        if self._place[2] <= -self._surface.reach_m:
            return self.thrusters.mixed(self._matrix)
        forces = np.array(self.thrusters.mean_forces_n) * self._surface.drawing(self._place[2], self._rotation[6:])
        wrench: list[float] = np.add.reduce(self._matrix * forces, axis=1).tolist()
        return wrench

    def _around(self, push: Sequence[float], nu: Six, dt_s: float) -> Sequence[float]:
        """Adds the tether's share to a wrench, sets what is wet, and the momentum that water takes which gets wet.

        Both depend on where the vehicle is, and are taken where it will be in the middle of the step.
        """
        half = 0.5 * dt_s
        x, y, z = self._place
        vx, vy, vz = self._velocity
        self._slam = None
        if z > -self._surface.reach_m:
            kx, ky, kz = self._rotation[6:]
            p, q, r = self._rate
            up = (kx + half * (ky * r - kz * q), ky + half * (kz * p - kx * r), kz + half * (kx * q - ky * p))
            before, taken = self._wet, self._taken
            self._float(z + half * vz, up)
            wet = self._wet
            if wet > taken and dt_s > 0.0:
                # Water that gets wet by the body must be brought to its speed; what it leaves keeps it. So neither
                # coming up nor going down makes energy. Source: von Karman, NACA TN 321 (1929).
                share = wet - taken
                self._slam = [share * value for value in self._added_momentum(*nu)]
            # From the middle of the step to its end as much again gets wet as in half a step before.
            self._taken = min(1.0, wet + 0.5 * (wet - before)) if wet > before and dt_s > 0.0 else wet
        elif self._wet != 1.0:
            self._wet = self._taken = 1.0
            self._flotation.submerge()
            self._set_wet(1.0)
        if self._tether is not None:
            push = self._pulled(push, self._tether, (x + half * vx, y + half * vy, z + half * vz))
        return push

    def _slowed(self, nu: Six) -> Six:
        """Returns the velocity at a step's end: less what the water took that got wet after its middle."""
        share = self._taken - self._wet
        slowed = nu
        for _ in range(SLOWING_ROUNDS):  # the water takes as much as brings it to the speed that is left
            slowed = self._hydro.less(nu, [share * value for value in self._added_momentum(*slowed)])
        return slowed

    def _float(self, z_m: float, up: Vector) -> None:
        """Sets what is wet at a height and an attitude."""
        share, centre = self._surface.wetted(z_m, up)
        self._flotation.wet(share, centre)
        if share != self._wet:
            self._wet = share
            self._set_wet(share)

    def _pulled(self, push: Sequence[float], tether: TetherPull, place: Vector) -> Sequence[float]:
        """Adds the tether's pull to a wrench."""
        bx, by, bz = tether.tether.place_m
        p, q, r = self._rate
        arm = self._in_world(bx, by, bz)
        turning = self._in_world(q * bz - r * by, r * bx - p * bz, p * by - q * bx)
        end = (place[0] + arm[0], place[1] + arm[1], place[2] + arm[2])
        vx, vy, vz = self._velocity
        fx, fy, fz = tether.force(end, (vx + turning[0], vy + turning[1], vz + turning[2]), self._current)
        r11, r12, r13, r21, r22, r23, r31, r32, r33 = self._rotation
        a, b, c = r11 * fx + r21 * fy + r31 * fz, r12 * fx + r22 * fy + r32 * fz, r13 * fx + r23 * fy + r33 * fz
        x, y, z, k, m, n = push
        self._tether_n = (fx, fy, fz)
        return x + a, y + b, z + c, k + by * c - bz * b, m + bz * a - bx * c, n + bx * b - by * a
