"""Keeps a student's process apart: bubblewrap's namespaces around it, the kernel's limits on it.

In it there are Python, the kit without its labs, the submission, and 16 MB in memory to write on; all else is
read-only or absent: no network, no other process, no environment, no file of ours. It is nobody's (uid 65534), it can
start neither process nor thread, and when the grader ends it, everything in its namespace ends.

As root, bubblewrap makes the mounts by that right, and the child gives it away before it reads the submission
(`child.py`). So no user namespaces are needed, and folders that only root may enter can hold Python. Anybody else
needs user namespaces. Root in a container that may not mount has neither: there `confinement.py` takes its place.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import snr_sim
from snr_sim.grading.reports.results import Isolation
from snr_sim.grading.sandbox.confiner import Confiner
from snr_sim.grading.sandbox.scratch import FILE_BYTES
from snr_sim.prelude.errors import SnrError

KIT = Path(snr_sim.__file__).resolve().parent
NOBODY = 65534
LABS = KIT / "shipped" / "assignments"  # where an installed kit has them
SUBMISSION = Path("/submission")
# They choose among ways to reckon that differ in the last bits; a graded flight is to be that of `snr run`.
WAYS_TO_RECKON = ("OPENBLAS_CORETYPE", "MKL_CBWR", "NPY_DISABLE_CPU_FEATURES", "NPY_ENABLE_CPU_FEATURES")
_NEEDED_ON_WINDOWS = "SYSTEMROOT"  # or no Python starts there
_SCRATCH_BYTES = 16 << 20
_SYSTEM = ("/lib", "/lib32", "/lib64", "/libx32")
_INSTALL = "apt install bubblewrap"


class IsolationMissing(SnrError):
    """A student's program cannot be kept apart here, and was to be."""


@dataclass(frozen=True)
class Limits:
    """What a student's process may use.

    Args:
        cpu_s: CPU time of its whole life, its start with the imports included.
        memory_bytes: address space.
        file_bytes: the longest file it may write.
        open_files: how many files it may have open.
    """

    cpu_s: int = 60
    memory_bytes: int = 1 << 30
    file_bytes: int = _SCRATCH_BYTES
    open_files: int = 64

    def wall_s(self, cpu_s: float) -> float:
        """Returns how long to wait for something that may take so much CPU time: far longer, on a busy computer."""
        return 30.0 + 10.0 * min(cpu_s, self.cpu_s)


def environment(confiner: Confiner | None = None) -> dict[str, str]:
    """Returns the whole environment of a student's process: nothing of ours but how numpy is to reckon."""
    alike = {name: os.environ[name] for name in (*WAYS_TO_RECKON, _NEEDED_ON_WINDOWS) if name in os.environ}
    threads = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    scratch = {} if confiner is None else {"TMPDIR": str(confiner.scratch.folder)}
    return {"PYTHONHASHSEED": "0", "PYTHONDONTWRITEBYTECODE": "1", "LC_ALL": "C.UTF-8", **threads, **scratch, **alike}


@contextmanager
def lent(folder: Path, isolation: Isolation) -> Iterator[Path]:
    """Yields a submission's folder as nobody can read it: itself, or a copy if only its owner may."""
    is_reached = isolation == "sandbox" or _closed_above(folder) is None
    if isolation == "none" or not is_root() or (is_reached and _is_open(folder)):
        yield folder
        return
    with tempfile.TemporaryDirectory(prefix="snr-grading-") as name:
        os.chmod(name, 0o755)
        copy = Path(name) / folder.name
        copy_for_all(folder, copy)
        yield copy


def copy_for_all(folder: Path, copy: Path) -> None:
    """Copies a submission so that everybody may read it; the copy's folder may be there already, and empty."""
    shutil.copytree(folder, copy, symlinks=True, ignore=_what_is_no_file, dirs_exist_ok=True)
    for path in [copy, *copy.rglob("*")]:
        if not path.is_symlink():
            path.chmod(0o755 if path.is_dir() else 0o644)


def closed_to_others() -> Path | None:
    """Returns a folder on the way to Python, its packages or the kit that others may not enter; None if they may."""
    for path in _outermost([*_pythons(), KIT]):
        if not path.stat().st_mode & 0o001:
            return path
        if closed := _closed_above(path):
            return closed
    return None


def _closed_above(path: Path) -> Path | None:
    return next((parent for parent in path.parents if not parent.stat().st_mode & 0o001), None)


def _is_open(folder: Path) -> bool:
    modes = [(path.is_dir(), path.stat().st_mode) for path in [folder, *folder.rglob("*")] if not path.is_symlink()]
    return all(mode & 0o004 and (mode & 0o001 or not is_folder) for is_folder, mode in modes)


def _what_is_no_file(folder: str, names: list[str]) -> list[str]:
    """Returns what must not be copied: a pipe or a device would be read without end."""
    paths = {name: Path(folder, name) for name in names}
    return [name for name, path in paths.items() if not (path.is_symlink() or path.is_dir() or path.is_file())]


def start_command(
    folder: Path,
    isolation: Isolation,
    line: int,
    limits: Limits,
    readable: Sequence[Path],
    confiner: Confiner | None = None,
    makes_copies: bool = False,
) -> tuple[list[str], Path]:
    """Returns the command that starts a student's process, and the folder to start it in.

    Nothing in it tells more than where Python, the kit, and what it may read are: a process can read its own command.

    Args:
        folder: of the submission.
        isolation: how it is kept.
        line: the file descriptor it answers on, or `protocol.PIPES`.
        limits: what it may use.
        readable: further folders that it may read.
        confiner: of a process that is "confined".
        makes_copies: it is `nursery_process.py`, whose copies are the student's processes.
    """
    place = "sandbox.nursery_process" if makes_copies else "remote.child"
    walls = ""
    if confiner is not None:
        limits = replace(limits, file_bytes=min(limits.file_bytes, FILE_BYTES))
        system = [path for path in map(Path, ("/usr", *_SYSTEM)) if path.is_dir()]
        readable = [*system, *_outermost([*_pythons(), KIT, *readable]), folder]
        walls = f", {tuple(confiner.walls(readable, LABS))}"
    limited = (limits.cpu_s, limits.memory_bytes, limits.file_bytes, limits.open_files)
    drops_to = NOBODY if isolation == "sandbox" and is_root() else None
    path = [str(one) for one in _search_path()]
    begin = (
        f"import sys; sys.path[:] = {path!r}; from snr_sim.grading.{place} import main; "
        f"main({line}, {limited}, {isolation != 'none'}, {drops_to}{walls})"
    )
    # What -I is, but for PYTHONHASHSEED: there is nothing else in the environment. And -S, as sys.path is given whole.
    python = [os.path.realpath(sys.executable), "-P", "-s", "-S", "-c", begin]
    if isolation == "sandbox":
        return [*_wrapping(folder, readable, makes_copies), *python], Path("/")
    return python, folder


@lru_cache(maxsize=1)
def find_bubblewrap() -> Path:
    """Returns where bubblewrap is.

    Raises:
        IsolationMissing: it is not installed, or this is no Linux.
    """
    if sys.platform != "linux":
        raise IsolationMissing(
            "A student's program can be kept apart on Linux only.",
            fix="grade on Linux or in a container; --isolation none is for practice, and every report says so.",
        )
    found = shutil.which("bwrap")
    if found is None:
        raise IsolationMissing("bubblewrap is not installed, which keeps a student's program apart.", fix=_INSTALL)
    return Path(found).resolve()


def is_root() -> bool:
    """Returns whether we are root, as in a container."""
    return os.geteuid() == 0


def _wrapping(folder: Path, readable: Sequence[Path], makes_copies: bool) -> Iterator[str]:
    """Yields bubblewrap with its options."""
    yield from (str(find_bubblewrap()), "--die-with-parent", "--new-session", "--clearenv", "--cap-drop", "ALL")
    yield from ("--unshare-ipc", "--unshare-pid", "--unshare-net", "--unshare-uts", "--unshare-cgroup-try")
    for name, value in environment().items():
        yield from ("--setenv", name, value)
    if is_root():
        more = ["CAP_SYS_ADMIN"] if makes_copies else []  # to give each copy a namespace
        for capability in ("CAP_SETUID", "CAP_SETGID", *more):  # to become nobody
            yield from ("--cap-add", capability)
    else:
        yield from ("--unshare-user", "--uid", str(NOBODY), "--gid", str(NOBODY))
    yield from ("--hostname", "grader", "--dev", "/dev", *_scratch(), "--ro-bind", "/usr", "/usr")
    for name in _SYSTEM:
        if os.path.islink(name):
            yield from ("--symlink", os.readlink(name), name)
        elif os.path.isdir(name):
            yield from ("--ro-bind", name, name)
    bound = _outermost([*_pythons(), KIT, *readable])
    for parent in sorted({parent for path in bound for parent in path.parents} - {Path("/"), Path("/tmp")}):
        yield from ("--dir", str(parent))  # or bubblewrap makes them itself, for root alone
    for path in bound:
        yield from ("--ro-bind", str(path), str(path))
    if LABS.is_dir():
        yield from ("--tmpfs", str(LABS))
    yield from ("--ro-bind", str(folder), str(SUBMISSION), "--chdir", str(SUBMISSION), "--remount-ro", "/", "--")


def _scratch() -> list[str]:
    """Returns options for /tmp, in memory and bounded; with a bubblewrap that cannot bound it, nothing to write on."""
    if _knows_sizes():
        return ["--perms", "1777", "--size", str(_SCRATCH_BYTES), "--tmpfs", "/tmp"]
    return ["--dir", "/tmp"]


@lru_cache(maxsize=1)
def _knows_sizes() -> bool:
    told = subprocess.run([find_bubblewrap(), "--help"], capture_output=True, text=True, check=False)
    return "--size" in told.stdout + told.stderr


def _pythons() -> list[Path]:
    """Returns where Python's own library and the installed packages are."""
    base = Path(sys.base_prefix).resolve()
    return [path for path in (base, *_packages()) if not path.is_relative_to("/usr")]


def _packages() -> list[Path]:
    """Returns the folders of packages that Python looks into."""
    entries = [Path(entry).resolve() for entry in sys.path if entry and Path(entry).is_dir()]
    prefixes = {Path(one).resolve() for one in (sys.prefix, sys.base_prefix)}
    return [entry for entry in entries if any(entry.is_relative_to(prefix) for prefix in prefixes)]


def _search_path() -> list[Path]:
    """Returns where the child looks for modules: Python's own folders, installed packages and the kit."""
    return list(dict.fromkeys([*_packages(), KIT.parent]))


def _outermost(paths: Sequence[Path]) -> list[Path]:
    """Returns paths, each once, without those that are in another one."""
    resolved = sorted({path.resolve() for path in paths})
    return [path for path in resolved if not any(path != one and path.is_relative_to(one) for one in resolved)]
