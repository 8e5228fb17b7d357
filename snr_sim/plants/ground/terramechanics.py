"""What ground does to a wheel: the friction that it can have at a slip, and the resistance of soil that it compacts.

On firm ground friction has one limit (Coulomb). On soft soil a wheel sinks in until the pressure bears it (Bekker), it
must slip to shear the soil (Janosi and Hanamoto), and it presses a rut ahead of it, which costs a force. Source of all
equations: Wong, Theory of Ground Vehicles, 4th edition (2008), sections 2.4 to 2.7.

    pressure at a depth       p = (kc / width + kphi) z^n
    sinkage of a rigid wheel  z = (3 W / ((3 - n) (kc + width kphi) sqrt(diameter)))^(2 / (2 n + 1))
    its resistance            R = (kc + width kphi) z^(n + 1) / (n + 1)
    its traction at a slip i  H = (area c + W tan phi) (1 - K / (i l) (1 - exp(-i l / K))),   l = sqrt(diameter z)
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, TypeAlias

from snr_sim.plants.parameter_limits import DEGREES, IS_ABOVE, LIMITS, MILLIMETRES, Limit, Record

KC = Limit(0.0, 1e6, "N/m^(n+1)", "clay has 13 000", {"kN/m^(n+1)": 1e3})
KPHI = Limit(0.0, 1e8, "N/m^(n+2)", "dry sand has 1 500 000", {"kN/m^(n+2)": 1e3}, IS_ABOVE)
EXPONENT = Limit(0.1, 2.0, "", "soils have 0.1 to 1.3")
COHESION = Limit(0.0, 1e6, "Pa", "dry sand has 1000, clay 4000", {"kPa": 1e3})
FRICTION_ANGLE = Limit(0.0, 1.0, "rad", "dry sand has 0.49, 28 degrees", DEGREES)
SHEAR_M = Limit(0.001, 0.2, "m", "sand has 0.01 to 0.025", MILLIMETRES)
Forces: TypeAlias = tuple[float, float]  # traction over load, and the force that it takes to press the rut [N]
CREEP_MPS = 1e-3  # below this speed there is no slip to speak of: 0 / 0


@dataclass(frozen=True)
class Coulomb(Record, who="The ground's "):
    """Firm ground.

    Args:
        friction: coefficient between wheel and ground, in all directions.
    """

    friction: Annotated[float, LIMITS["grip"]] = 0.8

    def forces_at(self, slip: float, load_n: float, radius_m: float, width_m: float) -> Forces:
        """Return the coefficient, which is the same at every slip and load, and no resistance."""
        return self.friction, 0.0

    def under(self, radius_m: float, width_m: float) -> Callable[[float, float], Forces]:
        """Return what gives the same, of slip and load."""
        forces = self.friction, 0.0
        return lambda slip, load_n: forces

    def sinkage_m(self, load_n: float, radius_m: float, width_m: float) -> float:
        """Return 0."""
        return 0.0


@dataclass(frozen=True)
class Bekker(Record, who="The soil's "):
    """Soft soil.

    Args:
        n, kc, kphi: exponent and moduli of pressure over sinkage; SI units, which depend on n.
        cohesion_pa, phi_rad: of its strength in shear: cohesion, and angle of internal friction.
        shear_m: deformation at which 63 % of the strength is reached, K.
    """

    n: Annotated[float, EXPONENT]
    kc: Annotated[float, KC]
    kphi: Annotated[float, KPHI]
    cohesion_pa: Annotated[float, COHESION]
    phi_rad: Annotated[float, FRICTION_ANGLE]
    shear_m: Annotated[float, SHEAR_M]

    def sinkage_m(self, load_n: float, radius_m: float, width_m: float) -> float:
        """Return how deep a wheel sinks [m], at most to its axle.

        >>> round(DRY_SAND.sinkage_m(70.0, 0.13, 0.1), 4)
        0.0165
        """
        if load_n <= 0.0:
            return 0.0
        stiffness = (3.0 - self.n) * (self.kc + width_m * self.kphi) * math.sqrt(2.0 * radius_m)
        return min(radius_m, float((3.0 * load_n / stiffness) ** (2.0 / (2.0 * self.n + 1.0))))

    def forces_at(self, slip: float, load_n: float, radius_m: float, width_m: float) -> Forces:
        """Return traction over load at a slip, and the force that it takes to press the rut [N].

        Args:
            slip: 0 rolls, 1 turns on the spot or is dragged with a locked wheel.
            load_n: on the wheel.
            radius_m, width_m: of it.
        """
        return self.under(radius_m, width_m)(slip, load_n)

    def under(self, radius_m: float, width_m: float) -> Callable[[float, float], Forces]:
        """Return what gives the same for one wheel, of slip and load: what is constant is computed once."""
        modulus, power, diameter_m = self.kc + width_m * self.kphi, self.n + 1.0, 2.0 * radius_m
        bearing, share = (3.0 - self.n) * modulus * math.sqrt(diameter_m), 2.0 / (2.0 * self.n + 1.0)
        cohesion_pa, shear_m, tan_phi = self.cohesion_pa, self.shear_m, math.tan(self.phi_rad)
        sqrt, exp = math.sqrt, math.exp

        def forces(slip: float, load_n: float) -> Forces:
            if load_n <= 0.0:
                return 0.0, 0.0
            depth_m: float = (3.0 * load_n / bearing) ** share
            depth_m = depth_m if depth_m < radius_m else radius_m
            resistance_n: float = modulus * depth_m**power / power
            length_m = sqrt(diameter_m * depth_m)
            strength = width_m * length_m * cohesion_pa / load_n + tan_phi
            sheared = slip * length_m / shear_m
            if sheared < 1e-6:
                return strength * 0.5 * sheared, resistance_n  # the first term of the series
            return strength * (1.0 - (1.0 - exp(-sheared)) / sheared), resistance_n

        return forces


Ground: TypeAlias = Coulomb | Bekker

# Wong, table 2.3: "dry sand (Land Locomotion Laboratory)" and, of table 2.4, lunar soil of the Apollo missions.
DRY_SAND = Bekker(1.1, 990.0, 1_528_430.0, 1040.0, math.radians(28.0), 0.025)
LUNAR_SOIL = Bekker(1.0, 1400.0, 820_000.0, 170.0, math.radians(35.0), 0.018)


def slip_of(rolling_mps: float, forward_mps: float, sideways_mps: float) -> float:
    """Return the slip of a wheel, 0 to 1, also of one that slides sideways.

    Args:
        rolling_mps: its rate times its radius.
        forward_mps, sideways_mps: speed of its axle over the ground.
    """
    fastest, moving = abs(rolling_mps), math.hypot(forward_mps, sideways_mps)
    if moving > fastest:
        fastest = moving
    slip = math.hypot(rolling_mps - forward_mps, sideways_mps) / (fastest + CREEP_MPS)
    return slip if slip < 1.0 else 1.0
