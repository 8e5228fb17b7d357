"""`snr doctor`: what works on this machine, what is missing, and the command that fixes it."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import shutil
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated

import typer

from snr_sim.cli.arguments import AsJson
from snr_sim.cli.doctor_hardware import Finding, answers, wires
from snr_sim.cli.output import print_json, print_text
from snr_sim.devices.device_strings import check_io
from snr_sim.devices.host_ports import HostInfo
from snr_sim.prelude.errors import MissingExtraError, SnrError
from snr_sim.prelude.io import Io, parse_io
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import SimulationRun

_EXTRAS = {
    "sim": ("pymunk", "gymnasium", "mujoco-core"),
    "view": ("rerun-sdk", "matplotlib"),
    "web": ("starlette", "uvicorn", "websockets"),
    "hardware": ("pyserial", "smbus2", "numpy"),
}
_LOWEST_PYTHON = (3, 11)
_MIN_FREE_MB = 100


def doctor(
    io: Annotated[
        str, typer.Option(help="Also asks who is there: mcu:PORT, pca9685:BUS:ADDR, emulated, ...", envvar="SNR_SIM_IO")
    ] = "",
    as_json: AsJson = False,
) -> None:
    """Check this machine.

    Python, packages and folders; serial ports, buses and PWM chips, if there are any; and lands a module to see that
    all works together.

    Exit status: 0 all is well, 1 something is missing, 2 the request was wrong.
    """
    meant = parse_io(io) if io else None
    if meant is not None:
        check_io(meant)
    findings = list(_run_checks(meant))
    if as_json:
        print_json({"findings": [finding._asdict() for finding in findings]})
    else:
        for finding in findings:
            print_text(f"{finding.tag:<4} {finding.message}")
            if finding.fix:
                print_text(f"       {finding.fix}")
    sys.exit(0 if all(finding.is_ok for finding in findings) else 1)


def _run_checks(io: Io | None) -> Iterator[Finding]:
    machine = HostInfo()
    python = platform.python_version()
    yield Finding(sys.version_info >= _LOWEST_PYTHON, f"Python {python} on {platform.platform()}")
    is_for_wires = drives_only(machine.is_pi, importlib.metadata.version)
    yield from packages(is_for_wires, importlib.metadata.version)
    free_mb = shutil.disk_usage(Path.cwd()).free // 2**20
    has_room = free_mb > _MIN_FREE_MB
    yield Finding(has_room, f"{free_mb} MB free in this folder", "" if has_room else "make room")
    is_writable = os.access(Path.cwd(), os.W_OK)
    yield Finding(is_writable, "runs can be written here" if is_writable else "this folder is read-only: use --out")
    yield landing(is_for_wires)
    found = list(wires(machine, io))
    yield from found
    if io is not None and all(finding.is_ok for finding in found):
        yield from answers(io)


def drives_only(is_pi: bool, version: Callable[[str], str]) -> bool:
    """Return whether a computer only drives hardware: a Raspberry Pi, or one without the physics packages.

    `version` returns a package's, or raises PackageNotFoundError.
    """

    def is_there(name: str) -> bool:
        try:
            return bool(version(name))
        except ModuleNotFoundError:  # its subclass PackageNotFoundError
            return False

    return is_pi or (all(map(is_there, _EXTRAS["hardware"])) and not any(map(is_there, _EXTRAS["sim"])))


def packages(is_for_wires: bool, version: Callable[[str], str]) -> Iterator[Finding]:
    """Yield the packages of each extra. Computers for hardware need those for wires, all others those for simulation.

    `version` returns a package's, or raises PackageNotFoundError.
    """
    for extra, names in _EXTRAS.items():
        is_needed = (extra == "hardware") == is_for_wires
        for name in names if is_needed or is_for_wires else ():
            try:
                yield Finding(True, f"{name} {version(name)}")
            except ModuleNotFoundError:
                yield Finding(not is_needed, f"{name} is not installed", f"pip install 'snr_sim[{extra}]'")


def landing(is_for_wires: bool) -> Finding:
    """Return whether a test run of a lander works; a computer for hardware does not need the physics packages."""
    try:
        simulation = prepare(Request("lander_vertical"))
        plant = simulation.plant()
        result = SimulationRun(simulation, plant, simulation.config(plant)).run()
    except SnrError as error:
        is_ok = is_for_wires and isinstance(error, MissingExtraError)
        return Finding(is_ok, f"lander_vertical does not run: {error.message}", error.fix)
    return Finding(result.success, f"lander_vertical, seed 0: {result.outcome}, {result.tasks} tasks")
