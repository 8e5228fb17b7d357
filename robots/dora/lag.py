"""Delays of readings and commands: python robots/dora/lag.py prints the tables of docs/live_programming.md

    --starts N        how many starts for each row of the first table (default 40)
    --rooms N         how many rooms for each row of the second (default 5)

The first drives at a wall (scenario dora_wall), the second explores rooms (dora_room); nothing is recorded.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path
from typing import Any

from snr_sim.errors import SnrError
from snr_sim.scenario import Request, RunResult, SimulationRun, prepare

HERE = Path(__file__).resolve().parent
WIRES = ("none", "brick", "wifi")
SPEEDS = (20, 40, 55, 80, 100)
EXPLORERS = (("explorer", "brick"), ("explorer", "wifi"), ("stutter", "brick"), ("stutter", "wifi"))


def run(scenario: str, seed: int, controller: str, wire: str) -> RunResult:
    """Return the result of one run."""
    simulation = prepare(Request(scenario, seed=seed, controller=controller, options={"wire": wire}))
    plant = simulation.plant()
    return SimulationRun(simulation, plant, simulation.config(plant)).run()


def wall_row(wire: str, speed: int, starts: int, folder: Path) -> dict[str, Any]:
    """Return how far it moved before its command was applied, from each start, at a speed in percent."""
    text = (HERE / "controllers" / "stop.lrp").read_text(encoding="utf-8")
    file = folder / f"stop_{speed}.lrp"
    file.write_text(text.replace("[55]", f"[{speed}]"), encoding="utf-8")
    results = [run("dora_wall", seed, str(file), wire) for seed in range(1, starts + 1)]
    from snr_sim_robot_dora.parameters import DORA  # there since the first run

    coasting_m = 0.01 * speed * DORA.full_speed_mps * DORA.lag_s
    moved_cm = [100.0 * (one.metrics["beyond_m"] - coasting_m) for one in results if one.success]
    return {
        "wire": wire,
        "speed_percent": speed,
        "moved_mean_cm": sum(moved_cm) / len(moved_cm) if moved_cm else None,  # decides no run: shown
        "moved_max_cm": max(moved_cm, default=None),
        "left_min_cm": min(100.0 * one.metrics["left_m"] for one in results),
        "touched": sum(not one.success for one in results),  # exact: integers
    }


def room_row(controller: str, wire: str, rooms: int) -> dict[str, Any]:
    """Return how an explorer did in some rooms."""
    results = [run("dora_room", seed, controller, wire) for seed in range(rooms)]
    return {
        "controller": controller,
        "wire": wire,
        "explored": f"{sum(one.success for one in results)} of {rooms}",  # exact: integers
        "mean_cmps": 100.0 * sum(one.metrics["mean_mps"] for one in results) / rooms,  # decides no run: shown
        "hardest_hit_mps": max(one.metrics["hit_mps"] for one in results),
    }


def show(rows: list[dict[str, Any]]) -> None:
    """Print rows as a table in Markdown."""
    print("| " + " | ".join(rows[0]) + " |")
    print("|" + "---|" * len(rows[0]))
    for row in rows:
        cells = (f"{one:.2f}" if isinstance(one, float) else "-" if one is None else str(one) for one in row.values())
        print("| " + " | ".join(cells) + " |")
    print()


def main() -> int:
    """Print both tables; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--starts", type=int, default=40)
    parser.add_argument("--rooms", type=int, default=5)
    given = parser.parse_args()
    if given.starts < 1 or given.rooms < 1:
        parser.error("--starts and --rooms must be 1 or more")
    try:
        with tempfile.TemporaryDirectory() as folder:
            show([wall_row(wire, speed, given.starts, Path(folder)) for wire in WIRES for speed in SPEEDS])
        show([room_row(controller, wire, given.rooms) for controller, wire in EXPLORERS])
    except SnrError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
