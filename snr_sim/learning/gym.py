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

LANDERS, UROVS = "snr_sim.learning.lander_envs", "snr_sim.learning.urov_envs"
# Steps are the scenario's time limit at the environment's rate. A threshold is what a policy has in the mean that meets
# the scenario's criterion from every start: some points below what tables, tiles and the control laws of tests have.
VERTICAL: dict[str, Any] = {
    "entry_point": f"{LANDERS}:LanderVertical",
    "vector_entry_point": "snr_sim.learning.lander_vector:LanderVerticalVector",
    "max_episode_steps": 1200,
    "reward_threshold": 90.0,
}
PAD: dict[str, Any] = {
    "entry_point": f"{LANDERS}:LanderPad",
    "vector_entry_point": "snr_sim.learning.pad_vector:LanderPadVector",
    "max_episode_steps": 1800,
    "reward_threshold": 90.0,
}
CONTINUOUS = {"kwargs": {"is_continuous": True}}
ENVIRONMENTS: dict[str, dict[str, Any]] = {
    "snr_sim/LanderVertical-v0": VERTICAL,
    "snr_sim/LanderVerticalContinuous-v0": {**VERTICAL, **CONTINUOUS},
    "snr_sim/LanderPad-v0": PAD,
    "snr_sim/LanderPadContinuous-v0": {**PAD, **CONTINUOUS},
    "snr_sim/UrovDepthHold-v0": {
        "entry_point": f"{UROVS}:UrovDepthHold",
        "max_episode_steps": 380,
        "reward_threshold": -60.0,
    },
    "snr_sim/UrovStation-v0": {
        "entry_point": f"{UROVS}:UrovStation",
        "max_episode_steps": 400,
        "reward_threshold": -30.0,
    },
}
# Under LunarLander-v3's definitions, its time limit and its mark for a solved task among them.
COMPATIBLE = "snr_sim/LunarLanderBox-v0"
COMPATIBLE_ENTRY: dict[str, Any] = {
    "entry_point": "snr_sim.learning.lunar_box:LunarLanderBox",
    "max_episode_steps": 1000,
    "reward_threshold": 200,
}


def box(low: Sequence[float], high: Sequence[float]) -> spaces.Box[np.float32]:
    """Return the space of float32 vectors between two."""
    return spaces.Box(np.array(low, np.float32), np.array(high, np.float32), dtype=np.float32)


def register_environments() -> None:
    """Register our environments, once."""
    for name, definition in {**ENVIRONMENTS, COMPATIBLE: COMPATIBLE_ENTRY}.items():
        if name not in registry:
            register(id=name, **definition)


register_environments()
