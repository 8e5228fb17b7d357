"""Lets q_lander.py learn as the grader does, flies what it has learned, and saves it: python learn.py [--seed N]

    policy.npz   the table, for `snr run lander_vertical --controller q --policy policy.npz`; hand it in
    curve.svg    the learning curve: open it in a browser

Do not change it; it is not graded.
"""

import argparse
import sys
from pathlib import Path

from snr_sim.grading.lab.lab import find_lab
from snr_sim.prelude.errors import SnrError
from snr_sim.scenario.library import load_program

HERE = Path(__file__).parent
TRIES = 1_000_000  # seeds of the flights begin here: training never sees them
AT_ONCE = 25  # episodes in one point of the curve


def main():
    """Learns, flies and saves."""
    parser = argparse.ArgumentParser(description="Lets q_lander.py learn to land.")
    parser.add_argument("--seed", type=int, default=0)
    seed = parser.parse_args().seed
    grader = find_lab("lunar_lander_q").module("grader.learning")
    student = grader.LocalSubmission(load_program(str(HERE / "q_lander.py")))
    trained = grader.train(student, seed)
    shares = curve_of(trained.landed)
    print(f"seed {seed}: {trained.steps} steps, {len(trained.landed)} landings tried")
    for i, share in enumerate(shares):
        print(f"{AT_ONCE * (i + 1):4d} {'#' * round(40 * share):40s} {share:4.0%}")
    (HERE / "curve.svg").write_text(svg_of(shares))

    stats = grader.simulate_landings(student, TRIES + seed, 100)
    print(f"without chance, from 100 starts that it has not seen: {outcome_text(stats)}")
    if not any(map(any, student.pilot.table.visits)):
        print("update() has changed nothing yet, so there is no table to save. Step 3 of the README.")
        return
    policy = grader.policy_table(student)
    policy.save(HERE / "policy.npz")
    stats = grader.simulate_landings(grader.TablePolicy(policy), TRIES + seed, 100)
    print(f"the same by policy.npz: {outcome_text(stats)}")
    print(f"snr run lander_vertical --seed 7 --controller q --policy {HERE / 'policy.npz'}")


def outcome_text(flights):
    """Return the number of flights per outcome, as text."""
    outcomes = ", ".join(f"{count} {outcome}" for outcome, count in flights.outcomes.items() if count)
    return outcomes + (f", {flights.fuel_kg:.0f} kg a landing" if any(flights.landed) else "")


def curve_of(landed):
    """Return which share of the landings succeeded, AT_ONCE at a time."""
    return [sum(landed[i : i + AT_ONCE]) / AT_ONCE for i in range(0, len(landed) - AT_ONCE + 1, AT_ONCE)]


def svg_of(shares):
    """Return the learning curve as a picture."""
    width, height, left, top = 560, 220, 50, 20
    across = (width - left - 20) / max(1, len(shares))
    points = [(left + across * (i + 0.5), top + height * (1 - share)) for i, share in enumerate(shares)]
    line = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    marks = "".join(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3" fill="#1f6fb4"/>' for x, y in points)
    rules = "".join(
        f'<line x1="{left}" x2="{width - 20}" y1="{top + height * (1 - q / 4)}" y2="{top + height * (1 - q / 4)}" '
        f'stroke="#ddd"/><text x="{left - 6}" y="{top + height * (1 - q / 4) + 4}" text-anchor="end">{25 * q} %</text>'
        for q in range(5)
    )
    below = top + height + 34
    words = f"episodes 1 to {AT_ONCE * len(shares)}, with chance; each point is {AT_ONCE} of them"
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{below + 14}" font-family="sans-serif" '
        f'font-size="12"><rect width="100%" height="100%" fill="white"/>{rules}'
        f'<polyline points="{line}" fill="none" stroke="#1f6fb4" stroke-width="2"/>{marks}'
        f'<text x="{left}" y="{below}">landed, of {words}</text></svg>\n'
    )


if __name__ == "__main__":
    try:
        main()
    except SnrError as error:
        sys.exit(f"Error: {error}")
