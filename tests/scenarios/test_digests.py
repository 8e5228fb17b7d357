"""Every scenario, engine and seed leaves the trace that it left before, under every Python (digests.json).

The digests are over the records after the header, which names versions and sources. Each dive must also meet its
criterion. After a change that is meant to alter runs, renew them and say so in CHANGELOG.md:

    python tests/scenarios/test_digests.py --write
"""

import json
import sys
import tempfile
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest

from snr_sim.scenario import library
from snr_sim.scenario.simulation import Request, prepare
from tests.lanes import nightly, slow
from tests.scenarios.recorded import (
    DIGESTS,
    PACKAGES,
    REFERENCE,
    WRITTEN,
    differing_platform,
    simulate,
    simulate_with_digest,
)

SEEDS = (0, 1, 2)
# Other tests simulate these, and look at more: once is enough before the night.
ELSEWHERE = {
    "urov_depth_hold mujoco 1": "scenarios/test_urov.py",
    "urov_heading_hold mujoco 1": "scenarios/test_urov.py",
    "urov_link_loss mujoco 1": "scenarios/test_urov.py",
    "urov_thruster_failure mujoco 2": "scenarios/test_urov.py",
    "urov_leak mujoco 1": "scenarios/test_urov.py",
    "urov_station_keeping mujoco 1": "scenarios/test_urov.py",
    "urov_gate mujoco 2": "scenarios/test_urov.py",
    "urov_bad_link mujoco 1": "scenarios/test_urov.py",
    "urov_bad_link mujoco 2": "scenarios/test_urov.py",
    "urov_sticks mujoco 1": "scenarios/test_urov.py",
    "urov_tank mujoco 1": "scenarios/test_urov.py",
    "urov_teleop mujoco 1": "scenarios/test_urov.py",
    "dora_room pymunk 0": "robots/test_dora.py",
    "dora_corners pymunk 0": "robots/test_dora.py",
    "dora_corners pymunk 1": "robots/test_dora.py",
    "dora_people pymunk 0": "robots/test_dora.py",
    "dora_people pymunk 1": "robots/test_dora.py",
    "rover_arm mujoco 0": "robots/test_rover_arm.py",
    "rover_dead_motor mujoco 0": "robots/test_rover_motors.py",
    "rover_dead_motor mujoco 1": "robots/test_rover_motors.py",
    "rover_dead_motor mujoco 2": "robots/test_rover_motors.py",
    "rover_dead_motor pymunk 0": "robots/test_rover_motors.py",
    "rover_dead_motor pymunk 1": "robots/test_rover_motors.py",
    "rover_dead_motor pymunk 2": "robots/test_rover_motors.py",
    "rover_hill mujoco 0": "robots/test_rover.py",
    "rover_hill pymunk 0": "robots/test_rover.py",
    "rover_lost_link mujoco 0": "robots/test_rover_avoid.py",
    "rover_lost_link pymunk 0": "robots/test_rover_avoid.py",
    "rover_obstacle mujoco 0": "robots/test_rover_avoid.py",
    "rover_obstacle pymunk 0": "robots/test_rover_avoid.py",
    "rover_teleop mujoco 0": "robots/test_rover.py",
    "rover_unplug pymunk 0": "robots/test_rover_unplug.py",
    "rover_waypoints mujoco 0": "robots/test_rover.py",
    "rover_wheel_up mujoco 0": "robots/test_rover_motors.py",
}


def runs() -> list[str]:
    """Return all runs, as 'scenario engine seed'."""
    return [
        f"{found.name} {engine} {seed}"
        for found in library.list_available("scenarios")
        for engine in prepare(Request(found.name)).scenario.ENGINES
        for seed in SEEDS
    ]


def in_its_lane(run: str) -> Any:
    """Return a run with its lane: landings are quick; of others, a scenario's first seed is tried before the night."""
    is_first, is_quick = run.endswith(f" {SEEDS[0]}"), run.startswith("lander")
    if run in ELSEWHERE or not (is_first or is_quick):
        return nightly(run)
    return run if is_first and is_quick else slow(run)


# The runs of the file, as `runs` reads all robots and scenarios, whichever tests are run.
@pytest.mark.parametrize("run", [in_its_lane(run) for run in WRITTEN["digests"]])
def test_run_keeps_recorded_digest(run: str, tmp_path: Path) -> None:
    if differs := differing_platform(run):
        pytest.skip(f"digests.json is of {REFERENCE}; this is {differs}")
    simulate(run, tmp_path)


@pytest.mark.parametrize("file", sorted(set(ELSEWHERE.values())))
def test_runs_of_other_files_are_simulated_there(file: str) -> None:
    text = (Path(__file__).parents[1] / file).read_text(encoding="utf-8")
    assert [run for run, where in ELSEWHERE.items() if where == file and f'"{run}"' not in text] == []


def test_digests_cover_all_runs() -> None:
    assert list(WRITTEN["digests"]) == runs()


def write() -> None:
    """Write the digests of all runs."""
    digests = {}
    for run in runs():
        if differs := differing_platform(run):
            sys.exit(f"Digests are written on {REFERENCE}; this is {differs}.")
        with tempfile.TemporaryDirectory() as folder:
            _, digests[run] = simulate_with_digest(run, Path(folder))
    packages = {name: version(name) for name in PACKAGES}
    DIGESTS.write_text(json.dumps({"packages": packages, "digests": digests}, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    if sys.argv[1:] != ["--write"]:
        sys.exit(__doc__)
    write()
