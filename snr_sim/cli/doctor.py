"""`snr doctor`: what works on this machine, what is missing, and the command that mends it."""

from __future__ import annotations

import os
import platform
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from snr_sim.cli.finding import Finding

if TYPE_CHECKING:
    from snr_sim.prelude.io import Io

_EXTRAS = {
    "sim": ("pymunk", "gymnasium", "mujoco-core"),
    "view": ("rerun-sdk", "pillow"),
}
_LOWEST_PYTHON = (3, 11)
_ROOM_WANTED_MB = 100


def doctor(
    io: Annotated[
        str, typer.Option(help="Also asks who is there: mcu:PORT, pca9685:BUS:ADDR, emulated, ...", envvar="SNR_SIM_IO")
    ] = "",
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Check this machine.

    Python, packages and folders; serial ports, buses and PWM chips, if there are any; and lands a module to see that
    all works together.

    Exit status: 0 all is well, 1 something is missing.
    """
    from snr_sim.prelude.io import parse_io

    findings = list(_look(parse_io(io) if io else None))
    if as_json:
        import json

        print(json.dumps({"findings": [finding._asdict() for finding in findings]}))
    else:
        for finding in findings:
            print(f"{finding.tag:<4} {finding.what}")
            if finding.fix:
                print(f"       {finding.fix}")
    sys.exit(0 if all(finding.is_well for finding in findings) else 1)


def _look(io: Io | None) -> Iterator[Finding]:
    import importlib.metadata  # slow, and `snr --help` does not need it

    version = platform.python_version()
    yield Finding(sys.version_info >= _LOWEST_PYTHON, f"Python {version} on {platform.platform()}")
    for extra, packages in _EXTRAS.items():
        for package in packages:
            try:
                yield Finding(True, f"{package} {importlib.metadata.version(package)}")
            except importlib.metadata.PackageNotFoundError:
                yield Finding(False, f"{package} is not installed", f"pip install 'snr_sim[{extra}]'")
    free_mb = shutil.disk_usage(Path.cwd()).free // 2**20
    yield Finding(
        free_mb > _ROOM_WANTED_MB, f"{free_mb} MB free in this folder", "" if free_mb > _ROOM_WANTED_MB else "make room"
    )
    is_writable = os.access(Path.cwd(), os.W_OK)
    yield Finding(is_writable, "runs can be written here" if is_writable else "this folder is read-only: use --out")
    yield _landing()
    yield from _wires(io)


def _wires(io: Io | None) -> Iterator[Finding]:
    from snr_sim.cli.doctor_hardware import answers, wires
    from snr_sim.devices.wires_here import Machine

    found = list(wires(Machine(), io))
    yield from found
    if io is not None and all(finding.is_well for finding in found):
        yield from answers(io)


def _landing() -> Finding:
    from snr_sim.flight import Flight
    from snr_sim.prelude.errors import SnrError
    from snr_sim.simulation import Request, prepare

    try:
        simulation = prepare(Request("lander_vertical"))
        plant = simulation.plant()
        result = Flight(simulation, plant, simulation.config(plant)).run()
    except SnrError as error:
        return Finding(False, "lander_vertical does not run", str(error))
    return Finding(result.success, f"lander_vertical, seed 0: {result.outcome}, {result.tasks} tasks")
