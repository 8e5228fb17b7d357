"""Landing gear: what a touchdown may look like. The judge of every lander."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypedDict

from snr_sim.plants.plausible import check_fields


class Touchdown(TypedDict):
    """How a module met the ground, at the first contact.

    Degrees, because this leaves the library: it goes into results that people read.
    """

    vertical_mps: float  # positive down
    lateral_mps: float  # positive towards +x
    attitude_deg: float
    rate_degps: float


@dataclass(frozen=True)
class GearLimits:
    """What the legs take. A fast touchdown leaves less room for sliding sideways.

    Args:
        vertical_mps: largest vertical speed without any lateral one.
        vertical_sliding_mps: largest vertical speed at the largest lateral one; in between the limit is a line.
        lateral_mps: largest lateral speed.
        attitude_rad: largest tilt.
        rate_radps: largest rate of tilting.

    Raises:
        ParameterError: a number cannot be.

    Source of the defaults: design limits of the lunar module's gear (10 ft/s; 7 ft/s with 4 ft/s; 6 deg; 2 deg/s),
    as given for NASA TN D-6850.
    """

    vertical_mps: float = 3.05
    vertical_sliding_mps: float = 2.13
    lateral_mps: float = 1.22
    attitude_rad: float = math.radians(6.0)
    rate_radps: float = math.radians(2.0)

    def __post_init__(self) -> None:
        speeds = dict.fromkeys(("vertical_mps", "vertical_sliding_mps", "lateral_mps"), "gear_mps")
        check_fields(self, "The gear's ", {**speeds, "attitude_rad": "gear_rad", "rate_radps": "gear_radps"}, {})

    def vertical_limit(self, lateral_mps: float) -> float:
        """Returns the largest vertical speed at a lateral one [m/s]; 0 beyond what the gear takes sideways.

        >>> round(GearLimits().vertical_limit(0.61), 2)
        2.59
        """
        share = abs(lateral_mps) / self.lateral_mps
        if not share <= 1.0:
            return 0.0
        return self.vertical_mps - share * (self.vertical_mps - self.vertical_sliding_mps)

    def holds(self, touchdown: Touchdown) -> bool:
        """Returns whether the gear survives. A touchdown exactly at a limit does."""
        return not self.passed(touchdown)

    def passed(self, touchdown: Touchdown) -> list[str]:
        """Returns which limits a touchdown passes, in words; none if the gear survives.

        >>> GearLimits().passed(Touchdown(vertical_mps=3.0, lateral_mps=0.61, attitude_deg=-7.5, rate_degps=0.0))
        ['vertical 3.000 m/s is over 2.59 m/s (3.05 if it did not slide)', 'attitude -7.500 deg is over 6 deg']
        """
        vertical, lateral = touchdown["vertical_mps"], touchdown["lateral_mps"]
        slides = f" ({self.vertical_mps:g} if it did not slide)" if lateral else ""
        # What slides too fast is judged as at the fastest slide: it is not also told that it came down too fast.
        takes_mps = self.vertical_limit(min(abs(lateral), self.lateral_mps))
        limits = (
            ("vertical", vertical, vertical, takes_mps, "m/s", slides),
            ("lateral", lateral, abs(lateral), self.lateral_mps, "m/s", ""),
            (
                "attitude",
                touchdown["attitude_deg"],
                abs(touchdown["attitude_deg"]),
                math.degrees(self.attitude_rad),
                "deg",
                "",
            ),
            ("rate", touchdown["rate_degps"], abs(touchdown["rate_degps"]), math.degrees(self.rate_radps), "deg/s", ""),
        )
        return [
            f"{name} {value:.3f} {unit} is over {limit:.3g} {unit}{remark}"
            for name, value, size, limit, unit, remark in limits
            if not size <= limit  # also a NaN
        ]


APOLLO_GEAR = GearLimits()
