"""Stay above a yellow plate on the floor. The position fix stops after eight seconds.

It hovered if, from then on, the plate was within 15 pixels of the middle of its camera's picture for 80 % of the time.
Every seed is another start, current and water. For some seconds the water is so murky that nothing can be seen in it.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

from snr_sim_robot_urov.evaluation import Sample, TrackedUrov, hold_verdict
from snr_sim_robot_urov.parameters import Sensors, UrovParameters, vehicle

from snr_sim.devices import Camera, PositionFix, position_fix_of
from snr_sim.plants import Current, Dive, Pool, Propulsion, Tether
from snr_sim.scenario import Verdict, rng_for
from snr_sim.teleop import Cue

ROBOT = "urov"
ENGINES = ("mujoco",)
CONTROLLER = "holds"
END_S = 32.0
TIME_LIMIT_S = END_S + 1.0

FLOOR_M, DEPTH_M = 4.0, 2.2
ARM_S, FIXED_S = 2.0, 8.0
CLOUD_S, CLOUDED_S, CLOUD_PER_M = 15.0, 6.0, 6.0
NEAR_PX, SHARE = 15.0, 0.8
PLATE = {"kind": "box", "center_m": [0.0, 0.0, -FLOOR_M + 0.05], "half_size_m": [0.2, 0.2, 0.05], "rgb": [250, 215, 20]}
LITTER = {
    "hose": {
        "kind": "polyline",
        "points_m": [[-2.5, 1.2, -FLOOR_M + 0.03], [0.4, 0.9, -FLOOR_M + 0.03], [2.5, 1.4, -FLOOR_M + 0.03]],
        "radius_m": 0.03,
        "rgb": [235, 190, 40],
    },
    "brick": {"kind": "box", "center_m": [1.0, -1.0, -3.95], "half_size_m": [0.12, 0.06, 0.04], "rgb": [170, 70, 40]},
    "leaf": {"kind": "box", "center_m": [-0.9, -0.6, -3.99], "half_size_m": [0.04, 0.03, 0.01], "rgb": [230, 210, 40]},
}


@lru_cache(maxsize=4)
def camera(seed: int) -> Camera:
    """Return the camera, in the water of a seed."""
    cloud = (CLOUD_S, CLOUD_S + CLOUDED_S, CLOUD_PER_M)
    return Camera("down", backscatter_per_m=rng_for(seed, "water").uniform(0.06, 0.5), clouds=(cloud,))


@lru_cache(maxsize=4)
def dive(seed: int) -> Dive:
    """Return what happens in the run of a seed."""
    rng = rng_for(seed, "dive")
    speed, direction = rng.uniform(0.10, 0.14), rng.uniform(-math.pi, math.pi)
    return Dive(
        position_m=(rng.uniform(-0.5, 0.5), rng.uniform(-0.4, 0.4), -DEPTH_M),
        attitude_rad=(0.0, 0.0, rng.uniform(-math.pi, math.pi)),
        currents=(Current(0.0, (speed * math.cos(direction), speed * math.sin(direction), 0.0)),),
        tether=Tether(anchor_m=(0.0, 0.0, 0.0)),
    )


def parameters(seed: int) -> UrovParameters:
    """Return the parameters of the controller, and the pilot's script: arm, then request a depth and a heading."""
    script = (Cue(ARM_S, is_armed=True, mode="heading_hold", depth_m=DEPTH_M),)
    return UrovParameters(vehicle(), script, sensors=Sensors(camera=camera(seed)), fix_hz=5.0)


class AboveThePlate(TrackedUrov):
    """The vehicle, with the true position of the plate in its camera's picture."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._readers["position_fix"] = self.fix

    def reset(self, seed: int) -> None:
        """Start a run."""
        self.last_fix: PositionFix | None = None
        super().reset(seed)

    def fix(self) -> PositionFix:
        """Return the position fix: from FIXED_S on, always the same."""
        if self.last_fix is None or self.time_s <= FIXED_S:
            self.last_fix = position_fix_of(self)
        return self.last_fix

    def scene(self) -> dict[str, Any]:
        """Return the pool's floor with the plate on it, and what else lies there."""
        scene = super().scene()
        return {**scene, "statics": {"floor": scene["statics"]["floor"], "plate": PLATE, **LITTER}}

    def near_share(self) -> float:
        """Return for which share of the time the plate was near the middle of the picture, since the fix was lost."""
        is_near = [off_px(sample) <= NEAR_PX for sample in self.samples_between(FIXED_S, END_S)]
        return sum(is_near) / len(is_near) if is_near else 0.0


def off_px(sample: Sample) -> float:
    """Return how far the plate is from the middle of the picture, also if it is not in it."""
    x, y, z = sample.position_m
    up_m = z + FLOOR_M - 0.1
    # The vehicle is nearly level, so what it is tilted moves the picture by as much as its angle.
    cos, sin = math.cos(sample.yaw_rad), math.sin(sample.yaw_rad)
    ahead, left = -(cos * x + sin * y) / up_m, -(-sin * x + cos * y) / up_m
    pixel = Camera("down").pixel
    return math.hypot(ahead - sample.pitch_rad, left + sample.roll_rad) / pixel


def plant(seed: int, engine: str) -> AboveThePlate:
    """Return the vehicle at its start."""
    return AboveThePlate(vehicle(), Pool(25.0, 25.0, FLOOR_M), dive, Propulsion(8), seed)


def verdict(plant: AboveThePlate) -> Verdict | None:
    """Return how it ended, once the time is over."""
    if plant.time_s < END_S - 1e-6:
        return None
    share = plant.near_share()
    if share < SHARE:
        return hold_verdict(
            plant, [f"had the plate near the middle of the picture {share:.0%} of the time, not {SHARE:.0%}"]
        )
    return hold_verdict(plant, [])


def metrics(plant: AboveThePlate, seed: int) -> dict[str, Any]:
    """Return how near the plate was to the middle of the picture."""
    far = [off_px(sample) for sample in plant.samples_between(FIXED_S, END_S)]
    return {"near_share": plant.near_share(), "worst_px": max(far, default=None), "end_px": far[-1] if far else None}
