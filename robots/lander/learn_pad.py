"""Learns to land in the plane, and writes the policy to a file: python robots/lander/learn_pad.py --out policy.npz

    --steps N --seed N     how long, and which chance

Afterwards the policy lands 100 new starts; policy.csv contains the learning curve.
"""

from __future__ import annotations

import argparse
import csv
import sys
from pathlib import Path

import gymnasium
from rich.console import Console
from rich.progress import Progress

import snr_sim.learning
from snr_sim.errors import SnrError
from snr_sim.learning import PadPolicy, PadTraining, evaluate, train_pad

UNSEEN = range(1, 101)  # seeds of the scenario; training draws its starts from other numbers


def main() -> int:
    """Learn, tries and saves; return the exit status."""
    parser = argparse.ArgumentParser(description="Learns to land in the plane.")
    parser.add_argument("--out", type=Path, default=Path("policy.npz"))
    parser.add_argument("--steps", type=int, default=PadTraining.steps)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    if not args.out.parent.is_dir():  # reported now, and not after the training
        parser.error(f"--out: there is no folder {args.out.parent}. Make it, or name a file in another one.")
    assert snr_sim.learning is not None  # imported because it registers the environments with gymnasium
    env = gymnasium.make("snr_sim/LanderPad-v0").unwrapped
    policy, console = PadPolicy(), Console(stderr=True)
    how = PadTraining(steps=args.steps, seed=args.seed)
    with Progress(console=console, disable=not console.is_terminal) as progress:
        bar = progress.add_task("learning", total=how.steps)
        evaluations = train_pad(policy, env, how, on_step=lambda: progress.advance(bar))
    policy.save(args.out)
    with args.out.with_suffix(".csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(("trial", "slow", "straight", "landed"))
        writer.writerows((i, *evaluation) for i, evaluation in enumerate(evaluations))
    ends = evaluate(env, policy.act, UNSEEN)
    landed = sum(end["success"] for end in ends)  # exact: integers
    print(f"{args.out}: lands {landed} of {len(ends)} starts that it has not seen.")
    print(f"snr run lander_pad --seed 7 --controller q --policy {args.out}")
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except SnrError as error:
        sys.exit(f"Error: {error}")
