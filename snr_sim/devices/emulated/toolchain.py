"""Compiles the emulator's parts when they are first needed, and caches them by a digest of their sources.

The firmware is compiled by its own Makefile, so that the emulator runs the same files that `make flash` flashes.
"""

from __future__ import annotations

import errno
import hashlib
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path

from snr_sim.prelude.errors import DeviceError

PACKAGES = "gcc libc6-dev make gcc-avr binutils-avr avr-libc libsimavr-dev libelf-dev"
APT = f"sudo apt install --no-install-recommends {PACKAGES}"
_RUNNER = Path(__file__).with_name("board.c")
_INCLUDE = (Path("/usr/include/simavr"), Path("/usr/local/include/simavr"))
_FIRMWARE_FILES = ("Makefile", "*.c", "*.h")
OUT = "{out}"  # in a command: the folder it writes to


class ToolsMissingError(DeviceError):
    """A compiler or a library of the emulator is not installed."""


def cache_folder() -> Path:
    """Return the folder of compiled files: `snr_sim/emulated` under XDG_CACHE_HOME, or ~/.cache."""
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "snr_sim" / "emulated"


def require_tools() -> None:
    """Raise a ToolsMissingError if build tools are missing, with the command that installs them."""
    missing = [tool for tool in ("gcc", "make", "avr-gcc", "avr-objcopy") if shutil.which(tool) is None]
    if not any((folder / "sim_avr.h").exists() for folder in _INCLUDE):
        missing.append("simavr's headers")
    if missing:
        raise ToolsMissingError(f"The emulated microcontroller needs {', '.join(missing)}: not found here.", fix=APT)


def runner_library() -> Path:
    """Return the compiled `board.c`, a shared library; raise errors as `firmware_elf` does."""
    target = cache_folder() / f"board-{_digest([_RUNNER])}.so"
    if not target.exists():
        require_tools()
        flags = ["-O2", "-shared", "-fPIC", *(f"-I{folder}" for folder in _INCLUDE)]
        _make(target, "board.so", ["gcc", *flags, "-o", f"{OUT}/board.so", str(_RUNNER), "-lsimavr", "-lelf"])
    return target


def firmware_elf(folder: Path, mcu: str, settings: Mapping[str, str | int] | None = None) -> Path:
    """Return the firmware in a folder, compiled for a microcontroller.

    Args:
        folder: where its Makefile is.
        mcu: as avr-gcc names it: "atmega328p".
        settings: of the Makefile, such as {"PERIOD_MS": 20}.

    Raises:
        ToolsMissingError: see `require_tools`.
        DeviceError: the compiler failed; with its output.
    """
    words = [f"{name}={value}" for name, value in sorted((settings or {}).items())]
    files = sorted(path for pattern in _FIRMWARE_FILES for path in folder.glob(pattern))
    if not files:
        raise DeviceError(
            f"There is no firmware in {folder}.", fix="a folder with a Makefile, as robots/urov/firmware."
        )
    target = cache_folder() / f"esc-{mcu}-{_digest(files, mcu, *words)}.elf"
    if not target.exists():
        require_tools()
        _make(target, f"esc-{mcu}.elf", ["make", "-s", "-C", str(folder), f"MCU={mcu}", f"OUT={OUT}", *words])
    return target


def _digest(files: Iterable[Path], *words: str) -> str:
    digest = hashlib.sha256("\0".join(words).encode())
    for file in files:
        digest.update(file.name.encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()[:16]


def _make(target: Path, name: str, command: list[str]) -> None:
    """Run a command in a temporary folder, and move its output file of this name to its destination atomically."""
    elsewhere = "XDG_CACHE_HOME=FOLDER before the command names another place for what is compiled."
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=target.parent) as folder:
            words = [word.replace(OUT, folder) for word in command]
            done = subprocess.run(words, capture_output=True, text=True, check=False)
            if done.returncode != 0:
                output = "\n".join((done.stdout + done.stderr).strip().splitlines()[-20:])
                is_full = os.strerror(errno.ENOSPC) in output
                raise DeviceError(
                    f"Compiling for the emulator failed:\n  {' '.join(words)}\n{output}",
                    fix=f"make room in {target.parent}; or {elsewhere}" if is_full else APT,
                )
            (Path(folder) / name).replace(target)
    except OSError as error:
        raise DeviceError(
            f"What the emulator needs cannot be compiled into {target.parent}: {error.strerror}.", fix=elsewhere
        ) from error
