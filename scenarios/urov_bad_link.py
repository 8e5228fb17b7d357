"""A pilot flies by hand, and the link through the tether is bad: each seed has another fault.

    seed 0, 5, 10 ...   loss     one page in five never arrives, and some overtake others
    seed 1, 6, 11 ...   late     everything takes 0.3 s
    seed 2, 7, 12 ...   cut      nothing arrives for two seconds, then all is well again
    seed 3, 8, 13 ...   narrow   less gets through than is sent: what arrives gets older and older
    seed 4, 9, 14 ...   gone     everything takes 0.2 s, then the surface stops sending for good

A command counts for 0.45 s after it was made. It was safe if nothing pushed half a second after the last command that
could count, and if the vehicle pushed while commands came in time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

from snr_sim_robot_urov.evaluation import TrackedUrov, hold_verdict
from snr_sim_robot_urov.failsafe_monitor import FailsafeLimits
from snr_sim_robot_urov.parameters import UrovParameters, vehicle
from snr_sim_robot_urov.tether_link import tether_faults

from snr_sim.links import LinkFaults
from snr_sim.plants import Dive, Pool, Propulsion, Tether
from snr_sim.scenario import Verdict, rng_for
from snr_sim.teleop import Cue

ROBOT = "urov"
ENGINES = ("mujoco",)
CONTROLLER = "holds"
END_S = 14.0
TIME_LIMIT_S = END_S + 1.0

KINDS = ("loss", "late", "cut", "narrow", "gone")
COUNTS_S = 0.45  # how long a command counts after it was made
LIMITS = FailsafeLimits(stale_s=COUNTS_S, lost_s=60.0)  # no hold: there is no person to surface for
ARM_S, CUE_S = 2.0, 0.05
NEUTRAL_S, STILL_S = 0.5, 0.1  # allowed until the pulses are neutral, and until the propellers then stand still
BACK_S = 2.5  # after which a link that was cut carries commands again: it tries to greet for three seconds
NEUTRAL_N, PUSH_N = 0.5, 1.0


@dataclass(frozen=True)
class BadLink:
    """What is wrong in the run of a seed.

    Args:
        kind: one of KINDS.
        from_s: when it begins; 0 for all the time.
        to_s: when it ends.
        faults: as the link has them.
    """

    kind: str
    from_s: float
    to_s: float
    faults: LinkFaults


@lru_cache(maxsize=4)
def bad_link(seed: int) -> BadLink:
    """Return the faults in the run of a seed."""
    good, rng, kind = tether_faults(35.0), rng_for(seed, "link"), KINDS[seed % len(KINDS)]
    if kind == "loss":
        return BadLink(kind, 0.0, END_S, replace(good, loss=0.2, reordering=0.2, jitter_s=0.08))
    if kind == "late":
        return BadLink(kind, 0.0, END_S, replace(good, latency_s=0.3))
    if kind == "narrow":
        return BadLink(kind, 0.0, END_S, replace(good, bandwidth_bps=rng.uniform(38.5e3, 40.5e3)))
    from_s = rng.uniform(5.0, 8.0)
    if kind == "cut":
        return BadLink(kind, from_s, from_s + 2.0, replace(good, cut=((from_s, from_s + 2.0),)))
    return BadLink(kind, from_s, math.inf, replace(good, latency_s=0.2, cut=((from_s, math.inf),)))


@lru_cache(maxsize=4)
def dive(seed: int) -> Dive:
    """Return what happens in the run of a seed."""
    rng = rng_for(seed, "dive")
    return Dive(
        position_m=(0.0, 0.0, -rng.uniform(1.5, 2.5)),
        attitude_rad=(0.0, 0.0, rng.uniform(-math.pi, math.pi)),
        tether=Tether(anchor_m=(0.0, 0.0, 0.0)),
    )


def parameters(seed: int) -> UrovParameters:
    """Return the parameters for the controller, and the pilot's script: his hand is never still."""
    script = [Cue(ARM_S, is_armed=True)]
    for i in range(round((END_S - ARM_S) / CUE_S)):
        slow, fast = math.sin(0.03 * i), math.sin(0.4 * i)
        script.append(Cue(ARM_S + i * CUE_S, surge=round(0.5 + 0.15 * slow, 4), yaw=round(0.2 * fast, 4)))
    return UrovParameters(vehicle(), tuple(script), failsafe_limits=LIMITS, tether=bad_link(seed).faults)


class BadLinkUrov(TrackedUrov):
    """The vehicle, with an observer above who knows the faults of its link."""

    def reset(self, seed: int) -> None:
        """Reset."""
        self.link = bad_link(seed)
        super().reset(seed)


def plant(seed: int, engine: str) -> BadLinkUrov:
    """Return the vehicle at its start."""
    return BadLinkUrov(vehicle(), Pool(40.0, 40.0, 6.0), dive, Propulsion(8), seed)


def verdict(plant: BadLinkUrov) -> Verdict | None:
    """Return how it ended, once the time is over."""
    if plant.time_s < END_S - 1e-6:
        return None
    found, misses = metrics(plant, 0), []
    if found["silent_thrust_n"] is not None and found["silent_thrust_n"] > NEUTRAL_N:
        misses.append(
            f"thrust was {found['silent_thrust_n']:.1f} N without a current command"
            f" (limit {NEUTRAL_N:g} N, link fault '{plant.link.kind}')"
        )
    share = found["pushed_share"]
    if share is not None and share < 0.9:
        misses.append(
            f"thrusters ran for only {share:.0%} of the time with commands"
            f" (minimum 90%, link fault '{plant.link.kind}')"
        )
    return hold_verdict(plant, misses)


def metrics(plant: BadLinkUrov, seed: int) -> dict[str, Any]:
    """Return whether it pushed when it should not, how much of the time it did when it should, and what that cost."""
    silent = [sample.thrust_n for after in _silent_s(plant.link) for sample in plant.samples_between(*after)]
    commanded = [sample.thrust_n for after in _commanded_s(plant.link) for sample in plant.samples_between(*after)]
    pushed = sum(thrust_n > PUSH_N for thrust_n in commanded)
    return {
        "fault": plant.link.kind,
        "silent_thrust_n": max(silent, default=None),
        "pushed_share": pushed / len(commanded) if commanded else None,
        "energy_j": plant.thrusters.energy_j,
    }


def _silent_s(link: BadLink) -> list[tuple[float, float]]:
    """Return when nothing may push."""
    if link.kind == "narrow":
        return [(END_S - 3.0, END_S)]
    return [(link.from_s + NEUTRAL_S + STILL_S, link.to_s)] if link.kind in ("cut", "gone") else []


def _commanded_s(link: BadLink) -> list[tuple[float, float]]:
    """Return when it should push."""
    if link.kind == "narrow":
        return []  # when commands begin to be late depends on how long they are
    if link.kind in ("cut", "gone"):
        return [(ARM_S + 0.7, link.from_s), (link.to_s + BACK_S, END_S)]
    return [(ARM_S + 0.7, END_S)]
