"""The door to gymnasium: the only file that imports it, and where our environments are made known to it.

gymnasium finds no plug-ins by itself. `gymnasium.make("snr_sim.learning:snr_sim/LanderPad-v0")` imports the module
before the colon first, and so does whoever writes `import snr_sim.learning`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from snr_sim.prelude.errors import MissingExtra

try:
    from gymnasium import Env, spaces
    from gymnasium.envs.registration import register, registry
except ImportError:
    raise MissingExtra("gymnasium", "sim") from None

if TYPE_CHECKING:
    from typing import Any

__all__ = ["Env", "box", "make_known", "spaces"]

LANDERS, UROVS = "snr_sim.learning.lander_envs", "snr_sim.learning.urov_envs"
ENVIRONMENTS: dict[str, tuple[str, dict[str, Any]]] = {
    "snr_sim/LanderVertical-v0": (f"{LANDERS}:LanderVertical", {}),
    "snr_sim/LanderVerticalContinuous-v0": (f"{LANDERS}:LanderVertical", {"is_continuous": True}),
    "snr_sim/LanderPad-v0": (f"{LANDERS}:LanderPad", {}),
    "snr_sim/LanderPadContinuous-v0": (f"{LANDERS}:LanderPad", {"is_continuous": True}),
    "snr_sim/UrovDepthHold-v0": (f"{UROVS}:UrovDepthHold", {}),
    "snr_sim/UrovStation-v0": (f"{UROVS}:UrovStation", {}),
}
# Under LunarLander-v3's definitions, its time limit and its mark for a solved task among them.
COMPATIBLE = "snr_sim/LunarLanderBox-v0"
COMPATIBLE_ENTRY = "snr_sim.learning.lunar_box:LunarLanderBox"


def box(low: Sequence[float], high: Sequence[float]) -> spaces.Box[np.float32]:
    """Returns the space of float32 vectors between two."""
    return spaces.Box(np.array(low, np.float32), np.array(high, np.float32), dtype=np.float32)


def make_known() -> None:
    """Registers our environments, once."""
    for name, (entry_point, kwargs) in ENVIRONMENTS.items():
        if name not in registry:
            register(id=name, entry_point=entry_point, kwargs=kwargs)
    if COMPATIBLE not in registry:
        register(id=COMPATIBLE, entry_point=COMPATIBLE_ENTRY, max_episode_steps=1000, reward_threshold=200)
