"""Environments that can be copied and pickled during an episode and then continue exactly as the original does.

Neither pymunk's contacts nor a loaded scenario can be serialised. But an episode is determined, bit for bit, by the
constructor's arguments, the reset and the actions, so a copy repeats these. This takes as long as the episode has taken
so far.
"""

from __future__ import annotations

import copy
from typing import Any, NamedTuple

from snr_sim.learning.gym import Env

# State that is set from outside after construction: copied as it is, random generators included.
PRESERVED_ATTRIBUTES = ("spec", "action_space", "observation_space", "_np_random", "_np_random_seed")


class Episode(NamedTuple):
    """What determines an episode: the random generator's state when it began, the reset's options, the actions."""

    rng_state: Any
    options: dict[str, Any] | None
    actions: list[Any]


class CopyableEnv(Env[Any, Any]):
    """What `copy.deepcopy` and `pickle` need. A subclass calls `_note_reset` and `_note_action`.

    Attributes that were set on it by hand are not copied.
    """

    _init_args: tuple[tuple[Any, ...], dict[str, Any]]
    _episode: Episode | None = None

    def __new__(cls, *args: Any, **kwargs: Any) -> CopyableEnv:
        """Remember how it is made."""
        env = super().__new__(cls)
        env._init_args = args, kwargs
        return env

    def __reduce__(self) -> Any:
        """Return how to make it again."""
        attributes = {name: self.__dict__[name] for name in PRESERVED_ATTRIBUTES if name in self.__dict__}
        return rebuild, (type(self), self._init_args, attributes, self._episode)

    def _note_reset(self, options: dict[str, Any] | None) -> None:
        """Store how an episode begins; called when the random generator is seeded, before the first draw."""
        self._episode = Episode(self.np_random.bit_generator.state, copy.deepcopy(options), [])

    def _note_action(self, action: Any) -> None:
        """Store an action, as an object that does not change afterwards."""
        assert self._episode is not None
        self._episode.actions.append(action)


def rebuild(
    env_type: type[CopyableEnv],
    init_args: tuple[tuple[Any, ...], dict[str, Any]],
    attributes: dict[str, Any],
    episode: Episode | None,
) -> CopyableEnv:
    """Return an environment in the same state as another one: made alike, with the episode repeated if there is one."""
    args, kwargs = init_args
    env = env_type(*args, **kwargs)
    env.__dict__.update(attributes)
    if episode is not None:
        generator = env.np_random.bit_generator
        newest = generator.state
        generator.state = episode.rng_state
        env.reset(options=episode.options)
        for action in episode.actions:
            env.step(action)
        generator.state = newest
    return env
