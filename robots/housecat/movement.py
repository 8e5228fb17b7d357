"""Action `move` of Housecat: a goal of up to four requests, each with a magnitude and a duration [s].

    grab    lowers the blade behind stones: 1 is down
    turn    rad/s, positive to the left
    move    m/s, positive forward
    lift    raises the blade that `grab` lowers

    event "move.start" [{"goal": {"move": [0.2, 3.0], "grab": [1.0, 2.0]}}]; `self.move(...)` in a control process

After the movement server of Kooi (2018).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from snr_sim.behaviors.flow import movement_parts
from snr_sim.scenario import Factory

from .parameters import DOZER

REQUESTS = ("grab", "turn", "move", "lift")


def dozer_command(magnitudes: Mapping[str, float]) -> dict[str, Any]:
    """Return the page "dozer" for the magnitudes of the requests."""
    difference_mps = 0.5 * DOZER.track_m * magnitudes["turn"]
    return {
        "dozer": {
            "left_mps": magnitudes["move"] - difference_mps,
            "right_mps": magnitudes["move"] + difference_mps,
            "blade": min(max(magnitudes["grab"] - magnitudes["lift"], 0.0), 1.0),
        }
    }


def move_parts() -> list[Factory]:
    """Return the factories of the action."""
    return [*movement_parts(REQUESTS, dozer_command)]
