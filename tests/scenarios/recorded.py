"""Runs whose digests are written down, in digests.json: each is simulated once, for all that is looked at in it."""

import json
import platform
import re
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest

from snr_sim.recording.folder import records_digest
from snr_sim.recording.trace import FILE_NAME
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import RunResult, run_recorded

DIGESTS = Path(__file__).with_name("digests.json")
WRITTEN: dict[str, Any] = json.loads(DIGESTS.read_text(encoding="utf-8"))
# What computes part of a run outside Python: another version may round differently.
PACKAGES = ("mujoco-core", "pymunk")
MAX_BYTES_PER_S = 125_000  # of a dive: 5 MB for 40 s; each value is in its trace once
REFERENCE = "Linux on x86_64 with glibc and a processor with FMA"
MACHINES = ("x86_64", "aarch64")
DIFFERENT_ON_ARM = re.compile(r"(lander|rover)_\w+ mujoco ")


def simulate(run: str, folder: Path) -> RunResult:
    """Simulate a run, 'scenario engine seed'; check its digest, and that a dive meets its criterion."""
    result, digest = simulate_with_digest(run, folder)
    if digest != WRITTEN["digests"].get(run) and not differing_platform(run):
        scenario, engine, seed = run.split()
        pytest.fail(
            f"{scenario} on {engine} with seed {seed} has the digest {digest}, and in {DIGESTS.name} "
            f"{WRITTEN['digests'].get(run, 'none')}. Python {platform.python_version()}; packages: "
            f"{differing_packages(WRITTEN['packages']) or 'as then'}. Find the first difference: `snr compare` of this "
            "run and of one before the change. If it is meant: python tests/scenarios/test_digests.py --write",
            pytrace=False,
        )
    return result


def simulate_with_digest(run: str, folder: Path) -> tuple[RunResult, str]:
    """Simulate a run; return its result and the digest of its records, without opening and header."""
    scenario, engine, seed = run.split()
    folder.mkdir(exist_ok=True)
    result = run_recorded(prepare(Request(scenario, int(seed), engine)), folder / FILE_NAME)
    assert (result.error, result.outcome == "interrupted") == ("", False)  # a signal ends a run, and not `--write`
    if scenario.startswith("urov"):
        assert result.success, result.notes
        assert (folder / FILE_NAME).stat().st_size <= MAX_BYTES_PER_S * result.sim_time_s
    return result, records_digest(folder / FILE_NAME)


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
    if machine == "aarch64" and DIFFERENT_ON_ARM.match(run):
        return "aarch64, where MuJoCo rounds differently"
    return ""


def differing_packages(written: dict[str, str]) -> str:
    """Return which packages have other versions than those that the digests were written with; empty if none."""
    pairs = [(name, then, version(name)) for name, then in written.items()]
    return ", ".join(f"{name} {now}, not {then}" for name, then, now in pairs if now != then)
