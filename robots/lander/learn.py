"""Learns to land straight down, and writes the table to a file: python robots/lander/learn.py --out policy.npz

    --method batch            thousands of landings a second, with arrays (the default)
    --method q_learning       one landing after the other, as in a textbook: a minute; also sarsa, expected_sarsa
    --episodes N --seed N     how long (textbook methods), and which chance

Afterwards the table lands 100 new starts; policy.csv contains the learning curve.
"""

from __future__ import annotations

import argparse
import csv
import sys
from pathlib import Path
from typing import Any

import gymnasium
from rich.console import Console
from rich.progress import Progress

import snr_sim.learning
from snr_sim.errors import SnrError
from snr_sim.learning import (
    METHODS,
    BatchTraining,
    EvaluationResult,
    ExponentialSchedule,
    Training,
    coarse_grid,
    evaluate,
    new_table,
    train,
    train_vertical,
    vertical_batch_task,
)

UNSEEN = range(1, 101)  # seeds of the scenario; training draws its starts from other numbers


def main() -> int:
    """Learn, tries and saves; return the exit status."""
    parser = argparse.ArgumentParser(description="Learns to land straight down.")
    parser.add_argument("--out", type=Path, default=Path("policy.npz"))
    parser.add_argument("--method", choices=("batch", *METHODS), default="batch")
    parser.add_argument("--episodes", type=int, default=1500)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    if not args.out.parent.is_dir():  # reported now, and not after the training
        parser.error(f"--out: there is no folder {args.out.parent}. Make it, or name a file in another one.")
    assert snr_sim.learning is not None  # imported because it registers the environments with gymnasium
    env = gymnasium.make("snr_sim/LanderVertical-v0").unwrapped
    table = new_table() if args.method == "batch" else new_table(coarse_grid())
    console = Console(stderr=True)
    rows: list[tuple[Any, ...]]
    with Progress(console=console, disable=not console.is_terminal) as progress:
        if args.method == "batch":
            how = BatchTraining(seed=args.seed)
            bar = progress.add_task("learning", total=how.steps)
            rows = [("step", "landed", "fuel_kg")]

            def on_evaluation(step: int, result: EvaluationResult) -> None:
                """Note a point of the learning curve."""
                progress.update(bar, completed=step)
                rows.append((step, *result))

            train_vertical(table, vertical_batch_task(env), how, on_evaluation)
        else:
            half = max(1, args.episodes // 2)
            training = Training(
                args.method,
                args.episodes,
                step=ExponentialSchedule(0.3, 0.05, args.episodes or 1),
                epsilon=ExponentialSchedule(0.5, 0.02, half),
                seed=args.seed,
            )
            bar = progress.add_task("learning", total=args.episodes)
            curve = train(env, table, training, lambda *_: progress.advance(bar))
            rows = [("episode", "return"), *enumerate(curve)]
    table.save(args.out)
    with args.out.with_suffix(".csv").open("w", newline="") as file:
        csv.writer(file).writerows(rows)
    ends = evaluate(env, table.act, UNSEEN)
    landed = sum(end["success"] for end in ends)  # exact: integers
    print(f"{args.out}: lands {landed} of {len(ends)} starts that it has not seen.")
    print(f"snr run lander_vertical --seed 7 --controller q --policy {args.out}")
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except SnrError as error:
        sys.exit(f"Error: {error}")
