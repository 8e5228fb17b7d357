"""Landing gear: limits of a touchdown and of the attitude at rest. The judge of every lander."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any, TypedDict

from snr_sim.plants.parameter_limits import LIMITS, Record


class Touchdown(TypedDict):
    """How a module met the ground, at the first contact.

    Degrees, because this leaves the library: it goes into results that people read.
    """

    vertical_mps: float  # positive down
    lateral_mps: float  # positive towards +x
    attitude_deg: float
    rate_degps: float


@dataclass(frozen=True)
class GearLimits(Record, who="The gear's "):
    """What the legs take, and how the module may stand on them. A fast touchdown leaves less room for sliding sideways.

    Args:
        vertical_mps: largest vertical speed without any lateral one.
        vertical_sliding_mps: largest vertical speed at the largest lateral one; in between the limit is a line.
        lateral_mps: largest lateral speed.
        attitude_rad: largest tilt at the first contact.
        rate_radps: largest rate of tilting.
        rest_rad: largest tilt of a module at rest.

    Source of the defaults: design limits of the lunar module's gear (10 ft/s; 7 ft/s with 4 ft/s; 6 deg; 2 deg/s;
    slopes of up to 12 deg, along which it then rests), as given for NASA TN D-6850.
    """

    vertical_mps: Annotated[float, LIMITS["gear_mps"]] = 3.05
    vertical_sliding_mps: Annotated[float, LIMITS["gear_mps"]] = 2.13
    lateral_mps: Annotated[float, LIMITS["gear_mps"]] = 1.22
    attitude_rad: Annotated[float, LIMITS["gear_rad"]] = math.radians(6.0)
    rate_radps: Annotated[float, LIMITS["gear_radps"]] = math.radians(2.0)
    rest_rad: Annotated[float, LIMITS["gear_rad"]] = math.radians(12.0)

    def vertical_limit(self, lateral_mps: Any) -> Any:
        """Return the largest vertical speed at a lateral one [m/s]; beyond the largest lateral one it stays the same.

        >>> round(float(GearLimits().vertical_limit(0.61)), 2)
        2.59
        """
        import numpy as np  # here, as a student's process needs a robot's numbers, and numpy takes half of its start

        share = np.minimum(1.0, abs(lateral_mps) / self.lateral_mps)
        return self.vertical_mps - share * (self.vertical_mps - self.vertical_sliding_mps)

    def is_within(
        self,
        vertical_mps: Any,
        lateral_mps: Any = 0.0,
        attitude_rad: Any = 0.0,
        rate_radps: Any = 0.0,
        rest_rad: Any = 0.0,
        share: float = 1.0,
    ) -> tuple[Any, Any, Any, Any, Any]:
        """Return which limits landings keep, in the order of the arguments; NaN keeps none.

        The one judge of single landers and of batches: each number may be an array, for many landings at once.

        Args:
            vertical_mps: at the first contact, positive down.
            lateral_mps, attitude_rad, rate_radps: there, too.
            rest_rad: tilt of the module at rest.
            share: factor of each limit.

        >>> import numpy as np
        >>> GearLimits().is_within(np.array([2.0, 4.0]))[0].tolist()
        [True, False]
        """
        return (
            vertical_mps <= share * self.vertical_limit(lateral_mps),
            abs(lateral_mps) <= share * self.lateral_mps,
            abs(attitude_rad) <= share * self.attitude_rad,
            abs(rate_radps) <= share * self.rate_radps,
            abs(rest_rad) <= share * self.rest_rad,
        )

    def outcome(self, touchdown: Touchdown, fuel_kg: float, rest_rad: float = 0.0) -> str:
        """Return how a landing ended: 'landed', 'crashed', 'out_of_fuel' (crashed, tank dry) or 'tilted' at rest.

        >>> level = Touchdown(vertical_mps=1.0, lateral_mps=0.0, attitude_deg=0.0, rate_degps=0.0)
        >>> [GearLimits().outcome(level, 9.0, math.radians(rest_deg)) for rest_deg in (12.0, 33.0)]
        ['landed', 'tilted']
        """
        *contact, rest = self.is_within(*_numbers(touchdown), rest_rad)
        if not all(contact):
            return "crashed" if fuel_kg > 0.0 else "out_of_fuel"
        return "landed" if rest else "tilted"

    def exceeded_limits(self, touchdown: Touchdown, rest_rad: float = 0.0) -> list[str]:
        """Return descriptions of the exceeded limits of a landing; a value at a limit is within it.

        >>> touchdown = Touchdown(vertical_mps=3.0, lateral_mps=0.61, attitude_deg=-7.5, rate_degps=0.0)
        >>> GearLimits().exceeded_limits(touchdown)
        ['vertical 3.000 m/s is over 2.59 m/s (3.05 if it did not slide)', 'attitude -7.500 deg is over 6 deg']
        """
        lateral = touchdown["lateral_mps"]
        slides = f" ({self.vertical_mps:g} if it did not slide)" if lateral else ""
        rows = (
            ("vertical", touchdown["vertical_mps"], self.vertical_limit(lateral), "m/s", slides),
            ("lateral", lateral, self.lateral_mps, "m/s", ""),
            ("attitude", touchdown["attitude_deg"], math.degrees(self.attitude_rad), "deg", ""),
            ("rate", touchdown["rate_degps"], math.degrees(self.rate_radps), "deg/s", ""),
            ("attitude at rest", math.degrees(rest_rad), math.degrees(self.rest_rad), "deg", ""),
        )
        flags = self.is_within(*_numbers(touchdown), rest_rad)
        return [
            f"{name} {value:.3f} {unit} is over {limit:.3g} {unit}{remark}"
            for (name, value, limit, unit, remark), is_kept in zip(rows, flags, strict=True)
            if not is_kept
        ]


def _numbers(touchdown: Touchdown) -> tuple[float, float, float, float]:
    attitude, rate = math.radians(touchdown["attitude_deg"]), math.radians(touchdown["rate_degps"])
    return touchdown["vertical_mps"], touchdown["lateral_mps"], attitude, rate


APOLLO_GEAR = GearLimits()
