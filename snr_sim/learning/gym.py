"""Interface to gymnasium: the only module that imports it; registers the environments.

gymnasium does not discover plug-ins. `gymnasium.make("snr_sim.learning:snr_sim/LanderPad-v0")` imports the module
before the colon first; `import snr_sim.learning` has the same effect. Both import this module once gymnasium is there.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from snr_sim.prelude.errors import MissingExtraError

try:
    from gymnasium import Env, spaces
    from gymnasium.envs.registration import register, registry
    from gymnasium.utils.seeding import np_random
    from gymnasium.vector import AutoresetMode, VectorEnv
    from gymnasium.vector.utils import batch_space
except ImportError:
    raise MissingExtraError("gymnasium", "sim") from None

__all__ = ["AutoresetMode", "Env", "VectorEnv", "batch_space", "box", "np_random", "register_environments", "spaces"]


def _definition(
    entry_point: str, steps: int, reward_threshold: float, vector: str = "", **kwargs: Any
) -> dict[str, Any]:
    """Return what `register` takes, of entry points in this package."""
    points = {"entry_point": entry_point, "vector_entry_point": vector}
    return {
        **{name: f"snr_sim.learning.{point}" for name, point in points.items() if point},
        "max_episode_steps": steps,
        "reward_threshold": reward_threshold,
        "kwargs": kwargs,
    }


# Steps are the scenario's time limit at the environment's rate. A threshold is what a policy has in the mean that meets
# the scenario's criterion from every start: some points below what tables, tiles and the control laws of tests have.
_VERTICAL = ("lander_envs:LanderVertical", 1200, 90.0, "lander_vector:LanderVerticalVector")
_PAD = ("lander_envs:LanderPad", 1800, 90.0, "pad_vector:LanderPadVector")
ENVIRONMENTS: dict[str, dict[str, Any]] = {
    "snr_sim/LanderVertical-v0": _definition(*_VERTICAL),
    "snr_sim/LanderVerticalContinuous-v0": _definition(*_VERTICAL, is_continuous=True),
    "snr_sim/LanderPad-v0": _definition(*_PAD),
    "snr_sim/LanderPadContinuous-v0": _definition(*_PAD, is_continuous=True),
    "snr_sim/UrovDepthHold-v0": _definition("urov_envs:UrovDepthHold", 380, -60.0),
    "snr_sim/UrovStation-v0": _definition("urov_envs:UrovStation", 400, -30.0),
}
COMPATIBLE = "snr_sim/LunarLanderBox-v0"  # under LunarLander-v3's definitions, also of time limit and threshold


def box(low: Sequence[float], high: Sequence[float]) -> spaces.Box[np.float32]:
    """Return the space of float32 vectors between two."""
    return spaces.Box(np.array(low, np.float32), np.array(high, np.float32), dtype=np.float32)


def register_environments() -> None:
    """Register our environments, once."""
    compatible = _definition("lunar_box:LunarLanderBox", 1000, 200.0)
    for name, definition in {**ENVIRONMENTS, COMPATIBLE: compatible}.items():
        if name not in registry:
            register(id=name, **definition)


register_environments()
