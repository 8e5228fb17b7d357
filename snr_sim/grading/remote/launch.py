"""Start of a student's process: its command, its environment, and a submission that it can read."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import IO, Any

from snr_sim.grading.lab.verdicts import GraderError
from snr_sim.grading.remote.protocol import PIPES
from snr_sim.grading.reports.results import Isolation
from snr_sim.grading.sandbox import sandbox
from snr_sim.grading.sandbox.confiner import FILE_BYTES, Confiner

# They choose numeric code paths that differ in the last bits; a graded run must equal that of `snr run`.
NUMERIC_ENV_VARS = ("OPENBLAS_CORETYPE", "MKL_CBWR", "NPY_DISABLE_CPU_FEATURES", "NPY_ENABLE_CPU_FEATURES")
_NEEDED_ON_WINDOWS = "SYSTEMROOT"  # or no Python starts there


def environment(confiner: Confiner | None = None) -> dict[str, str]:
    """Return the whole environment of a student's process: only the variables that select numpy's code paths."""
    alike = {name: os.environ[name] for name in (*NUMERIC_ENV_VARS, _NEEDED_ON_WINDOWS) if name in os.environ}
    threads = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    scratch = {} if confiner is None else {"TMPDIR": str(confiner.scratch)}
    return {"PYTHONHASHSEED": "0", "PYTHONDONTWRITEBYTECODE": "1", "LC_ALL": "C.UTF-8", **threads, **scratch, **alike}


def start_command(
    folder: Path,
    isolation: Isolation,
    line: int,
    limits: sandbox.Limits,
    readable: Sequence[Path],
    confiner: Confiner | None = None,
    is_fork_server: bool = False,
) -> tuple[list[str], Path]:
    """Return the command that starts a student's process, and the folder to start it in.

    It contains only the paths of Python, snr_sim and what it may read, since a process can read its own command.

    Args:
        line: the file descriptor it answers on, or `protocol.PIPES`.
        limits: CPU time, memory and files that it may use.
        readable: further folders that it may read.
        confiner: of a process that is "confined".
        is_fork_server: it is `fork_server_process.py`, whose copies are the student's processes.
    """
    module = "fork_server_process" if is_fork_server else "child"
    confinement = ""
    if confiner is not None:
        limits = replace(limits, file_bytes=min(limits.file_bytes, FILE_BYTES))
        system = [name for name in ("/usr", *sandbox.SYSTEM) if Path(name).is_dir()]
        own = sandbox.outermost([*sandbox.python_folders(), sandbox.KIT, *readable])
        granted = [*system, *map(str, own), str(folder)]
        confinement = f", {(confiner.user, granted, str(sandbox.LABS), str(confiner.scratch))}"
    limited = (limits.cpu_s, limits.memory_bytes, limits.file_bytes, limits.open_files)
    drops_to = sandbox.NOBODY if isolation == "sandbox" and sandbox.is_root() else None
    path = [str(one) for one in dict.fromkeys([*sandbox.package_folders(), sandbox.KIT.parent])]
    begin = (
        f"import sys; sys.path[:] = {path!r}; from snr_sim.grading.remote.{module} import main; "
        f"main({line}, {limited}, {isolation != 'none'}, {drops_to}{confinement})"
    )
    # What -I is, but for PYTHONHASHSEED: there is nothing else in the environment. And -S, as sys.path is given whole.
    python = [os.path.realpath(sys.executable), "-P", "-s", "-S", "-c", begin]
    if isolation == "sandbox":
        return [*sandbox.bubblewrap_command(folder, readable, is_fork_server), *python], Path("/")
    return python, folder


def start_process(
    folder: Path,
    isolation: Isolation,
    line: int,
    limits: sandbox.Limits,
    readable: Sequence[Path] = (),
    confiner: Confiner | None = None,
    is_fork_server: bool = False,
    prints_to: IO[bytes] | None = None,
) -> subprocess.Popen[bytes]:
    """Start a student's process, whose stdout is a pipe; raise GraderError if it cannot be started.

    Arguments as of `start_command`, and a file for what it prints, if it answers on its stdout.
    """
    command, cwd = start_command(folder, isolation, line, limits, readable, confiner, is_fork_server)
    options: dict[str, Any] = {"stdin": subprocess.PIPE, "stderr": prints_to}
    if line != PIPES:
        options = {"stdin": subprocess.DEVNULL, "stderr": subprocess.STDOUT}
        options |= {"pass_fds": (line,), "start_new_session": True}
    try:
        return subprocess.Popen(command, cwd=cwd, env=environment(confiner), stdout=subprocess.PIPE, **options)
    except OSError as error:
        raise GraderError(f"A student's process could not be started: {error}.") from error


@contextmanager
def readable_copy(folder: Path, isolation: Isolation) -> Iterator[Path]:
    """Yield a folder that the unprivileged user can read: the submission's, or a copy if only its owner may."""
    is_reached = isolation == "sandbox" or sandbox.first_private_ancestor(folder) is None
    if isolation == "none" or not sandbox.is_root() or (is_reached and _is_open(folder)):
        yield folder
        return
    with tempfile.TemporaryDirectory(prefix="snr-grading-") as name:
        Path(name).chmod(0o755)
        copy = Path(name) / folder.name
        copy_world_readable(folder, copy)
        yield copy


def copy_world_readable(folder: Path, copy: Path) -> None:
    """Copy a submission so that everybody may read it; the copy's folder may be there already, and empty."""
    shutil.copytree(folder, copy, symlinks=True, ignore=_ignore_special_files, dirs_exist_ok=True)
    for path in [copy, *copy.rglob("*")]:
        if not path.is_symlink():
            path.chmod(0o755 if path.is_dir() else 0o644)


def _is_open(folder: Path) -> bool:
    modes = [(path.is_dir(), path.stat().st_mode) for path in [folder, *folder.rglob("*")] if not path.is_symlink()]
    return all(mode & 0o004 and (mode & 0o001 or not is_folder) for is_folder, mode in modes)


def _ignore_special_files(folder: str, names: list[str]) -> list[str]:
    """Return the entries that must not be copied: a pipe or a device would be read without end."""
    paths = {name: Path(folder, name) for name in names}
    return [name for name, path in paths.items() if not (path.is_symlink() or path.is_dir() or path.is_file())]
