"""Learning: the compatible environment beside Box2D's, steps of the scenarios' environments, and a training.

Run by `snr bench learning`, or by itself: python tests/bench/bench_learning.py [--quick] [--json]
Box2D comes with the extra `bench`.
"""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Callable, Iterator
from typing import Any

import gymnasium
from harness import Row, compare, cpu_time_of, report

import snr_sim.learning  # noqa: F401 - makes the names known
from snr_sim.learning.batch_training import course_of, new_table, train_vertical
from snr_sim.learning.gym import COMPATIBLE
from snr_sim.learning.pad_training import PadPolicy, train_pad
from snr_sim.learning.tabular import evaluate

ORIGINAL = "LunarLander-v3"
UNSEEN = range(1, 101)


def steps_of(name: str, count: int, **kwargs: Any) -> Callable[[], Callable[[], None]]:
    """Returns a trial: so many steps with actions drawn beforehand, resets between episodes included."""
    env: Any = gymnasium.make(name, **kwargs).unwrapped
    env.action_space.seed(1)
    actions = [env.action_space.sample() for _ in range(count)]
    if isinstance(env.action_space, gymnasium.spaces.Discrete):
        actions = [int(action) for action in actions]

    def trial() -> Callable[[], None]:
        env.reset(seed=0)

        def run() -> None:
            for action in actions:
                _, _, *ended, _ = env.step(action)
                if any(ended):
                    env.reset()

        return run

    return trial


def measure(is_quick: bool) -> Iterator[Row]:
    """Measures, a row at a time."""
    count, rounds = (1000, 3) if is_quick else (5000, 9)
    if importlib.util.find_spec("Box2D") is not None:
        for continuous in (False, True):
            kind = "continuous" if continuous else "discrete"
            original = steps_of(ORIGINAL, count, continuous=continuous)
            found = compare(original, steps_of(COMPATIBLE, count, continuous=continuous), rounds=rounds)
            yield Row(
                name=f"LunarLanderBox, {kind}: step",
                value=found.shortest_s[1] / count * 1e6,
                unit="us",
                baseline=found.shortest_s[0] / count * 1e6,
                compared_to=f"gymnasium's {ORIGINAL} with Box2D",
                ratio=found.ratios[1],
                ratio_limit=0.5,
                note="resets included",
            )
    for name in ("LanderVertical", "LanderPad", "UrovDepthHold", "UrovStation"):
        steps = count // 10
        took_s = min(cpu_time_of(steps_of(f"snr_sim/{name}-v0", steps)) for _ in range(3))
        yield Row(name=f"{name}: step", value=took_s / steps * 1e6, unit="us", note="resets included")
    env = gymnasium.make("snr_sim/LanderVertical-v0").unwrapped
    table = new_table()
    start_s = time.process_time()
    train_vertical(table, course_of(env))
    took_s = time.process_time() - start_s
    landed = sum(end["success"] for end in evaluate(env, table.act, UNSEEN))
    yield Row(
        name="LanderVertical: training in a batch",
        value=took_s,
        unit="s",
        limit=5.0,
        note=f"{landed} of {len(UNSEEN)} unseen starts land",
    )
    if not is_quick:
        env = gymnasium.make("snr_sim/LanderPad-v0").unwrapped
        policy = PadPolicy()
        start_s = time.process_time()
        train_pad(policy, env)
        took_s = time.process_time() - start_s
        landed = sum(end["success"] for end in evaluate(env, policy.act, UNSEEN))
        yield Row(
            name="LanderPad: training by tiles",
            value=took_s,
            unit="s",
            limit=300.0,
            note=f"{landed} of {len(UNSEEN)} unseen starts land",
        )


if __name__ == "__main__":
    report(measure)
