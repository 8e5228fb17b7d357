"""Packages for another computer: wheels only, unpacked into a folder, as pip would choose them there."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
import venv
from pathlib import Path

_PLATFORMS = ("manylinux_2_28", "manylinux_2_27", "manylinux_2_17", "manylinux2014")


def install(project: Path, extras: str, more: list[str], site: Path, python_version: str, work: Path) -> None:
    """Installs this project with some extras, and some packages more, for aarch64.

    pip takes markers such as `platform_machine` for this computer's. No package that is needed has one of those.

    Args:
        project: the checkout.
        extras: such as 'hardware,peers'.
        more: requirements.
        site: folder that they go into.
        python_version: of the Python there, such as '3.11'.
        work: folder for pip's own needs.
    """
    pip = [*_pip(work), "--disable-pip-version-check", "-qq", "--cache-dir", str(work / "cache")]
    wheels = work / "wheels"
    for old in wheels.glob("snr_sim-*.whl"):
        old.unlink()
    subprocess.run([*pip, "wheel", "--no-deps", "--wheel-dir", wheels, project], check=True, cwd=work)
    wheel = next(wheels.glob("snr_sim-*.whl"))
    there = [f"--platform={platform}_aarch64" for platform in _PLATFORMS]
    there += ["--only-binary=:all:", "--implementation=cp", f"--python-version={python_version}"]
    target = ["--target", str(site), "--upgrade", "--no-compile"]
    subprocess.run([*pip, "install", *target, *there, f"{wheel}[{extras}]", *more], check=True, cwd=work)


def _pip(work: Path) -> list[str]:
    """Returns a command for pip: this Python's, or one in a venv of its own."""
    work.mkdir(parents=True, exist_ok=True)
    if importlib.util.find_spec("pip") is not None:
        return [sys.executable, "-m", "pip"]
    if not (work / "venv").exists():
        venv.create(work / "venv", with_pip=True)
    return [str(work / "venv/bin/python"), "-m", "pip"]
