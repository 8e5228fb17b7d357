"""Every scenario, engine and seed leaves the trace that it left before, under every Python (digests.json).

The digests are over the records after the header, which names versions and sources. Each dive must also meet its
criterion. After a change that is meant to alter runs, renew them and say so in CHANGELOG.md:

    python tests/scenarios/test_digests.py --write
"""

import json
import platform
import sys
import tempfile
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest

from snr_sim.recording.folder import records_digest
from snr_sim.recording.trace import FILE_NAME
from snr_sim.scenario import library
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import run_recorded
from tests.lanes import slow

DIGESTS = Path(__file__).with_name("digests.json")
WRITTEN: dict[str, Any] = json.loads(DIGESTS.read_text(encoding="utf-8"))
SEEDS = (0, 1, 2)
FAST = "urov_tank mujoco 0"  # of dives, which take a second of CPU time each
# What computes part of a run outside Python: another version may round differently.
PACKAGES = ("mujoco-core", "pymunk")
MAX_BYTES_PER_S = 125_000  # of a dive: 5 MB for 40 s; each value is in its trace once
REFERENCE = "Linux on x86_64 with glibc and a processor with FMA"
MACHINES = ("x86_64", "aarch64")
DIFFERENT_ON_ARM = ("lander_pad mujoco", "lander_rough mujoco")


def runs() -> list[str]:
    """Return all runs, as 'scenario engine seed'."""
    return [
        f"{found.name} {engine} {seed}"
        for found in library.list_available("scenarios")
        for engine in prepare(Request(found.name)).scenario.ENGINES
        for seed in SEEDS
    ]


def digest_of(run: str, folder: Path) -> str:
    """Simulate a run and return the digest of its records, without opening and header."""
    scenario, engine, seed = run.split()
    result = run_recorded(prepare(Request(scenario, int(seed), engine)), folder / FILE_NAME)
    assert (result.error, result.outcome == "interrupted") == ("", False)  # a signal ends a run, and not `--write`
    if scenario.startswith("urov"):
        assert result.success, result.notes
        assert (folder / FILE_NAME).stat().st_size <= MAX_BYTES_PER_S * result.sim_time_s
    return records_digest(folder / FILE_NAME)


def differing_platform(run: str) -> str:
    """Return why this computer may round differently than the one that wrote the digests; empty if it may not.

    The C library computes sin, exp and the like; glibc has versions with and without FMA, and both differ from those of
    other libraries. On ARM, MuJoCo's own code for bodies with joints uses FMA, and on x86-64 it does not
    (docs/hardware.md); a vehicle of one body, as in dives, comes out the same.
    """
    machine = platform.machine()
    if platform.system() != "Linux" or machine not in MACHINES or platform.libc_ver()[0] != "glibc":
        return f"{platform.system()} on {machine}, {platform.libc_ver()[0] or 'not glibc'}"
    if machine == "x86_64" and " fma " not in Path("/proc/cpuinfo").read_text(encoding="utf-8").replace("\n", " "):
        return "a processor without FMA"
    if machine == "aarch64" and run.startswith(DIFFERENT_ON_ARM):
        return "aarch64, where MuJoCo rounds differently"
    return ""


def differing_packages(written: dict[str, str]) -> str:
    """Return which packages have other versions than those that the digests were written with; empty if none."""
    pairs = [(name, then, version(name)) for name, then in written.items()]
    return ", ".join(f"{name} {now}, not {then}" for name, then, now in pairs if now != then)


def in_its_lane(run: str) -> Any:
    """Return a run with its lane: a scenario's last seed is tried at night, unless all of them are quick."""
    if run.startswith("lander"):
        return run if run.endswith(f" {SEEDS[0]}") else slow(run)
    if run == FAST:
        return run
    return pytest.param(run, marks=pytest.mark.nightly) if run.endswith(f" {SEEDS[-1]}") else slow(run)


# The runs of the file, as `runs` reads all robots and scenarios, whichever tests are run.
@pytest.mark.parametrize("run", [in_its_lane(run) for run in WRITTEN["digests"]])
def test_run_keeps_recorded_digest(run: str, tmp_path: Path) -> None:
    if differs := differing_platform(run):
        pytest.skip(f"digests.json is of {REFERENCE}; this is {differs}")
    digest = digest_of(run, tmp_path)
    if digest == WRITTEN["digests"].get(run):
        return
    scenario, engine, seed = run.split()
    pytest.fail(
        f"{scenario} on {engine} with seed {seed} has the digest {digest}, and in {DIGESTS.name} "
        f"{WRITTEN['digests'].get(run, 'none')}. Python {platform.python_version()}; packages: "
        f"{differing_packages(WRITTEN['packages']) or 'as then'}. Find the first difference: `snr compare` of this run "
        "and of one before the change. If it is meant: python tests/scenarios/test_digests.py --write",
        pytrace=False,
    )


def test_digests_cover_all_runs() -> None:
    assert list(WRITTEN["digests"]) == runs()


def write() -> None:
    """Write the digests of all runs."""
    digests = {}
    for run in runs():
        if differs := differing_platform(run):
            sys.exit(f"Digests are written on {REFERENCE}; this is {differs}.")
        with tempfile.TemporaryDirectory() as folder:
            digests[run] = digest_of(run, Path(folder))
    packages = {name: version(name) for name in PACKAGES}
    DIGESTS.write_text(json.dumps({"packages": packages, "digests": digests}, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    if sys.argv[1:] != ["--write"]:
        sys.exit(__doc__)
    write()
