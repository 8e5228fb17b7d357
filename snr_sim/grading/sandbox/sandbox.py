"""The sandbox: bubblewrap's namespaces around a student's process, which show it little.

It contains Python, snr_sim without its labs, the submission, and 16 MB in memory to write on; all else is
read-only or absent: no network, no other process, no environment, no file of the grader's. Its user is nobody
(uid 65534), and when the grader ends it, everything in its namespace ends.

As root, bubblewrap makes the mounts with root's rights, and the child drops them before it reads the submission
(`child_limits.py`). So no user namespaces are needed, and Python may be in folders that only root may enter. Other
users need user namespaces. Root in a container that may not mount has neither: `confinement.py` is used there instead.
"""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import snr_sim
from snr_sim.prelude.errors import SnrError

KIT: Path = Path(snr_sim.__file__).resolve().parent
NOBODY = 65534
LABS: Path = KIT / "shipped" / "assignments"  # where an installed kit has them
SYSTEM: tuple[str, ...] = ("/lib", "/lib32", "/lib64", "/libx32")
SUBMISSION_FOLDER: Path = Path("/submission")
_SCRATCH_BYTES = 16 << 20


class IsolationMissingError(SnrError):
    """Isolation is required, but not available on this computer."""


@dataclass(frozen=True)
class Limits:
    """What a student's process may use."""

    cpu_s: int = 60  # of its whole life, its start with the imports included
    memory_bytes: int = 1 << 30  # of address space
    file_bytes: int = _SCRATCH_BYTES  # of the longest file it may write
    open_files: int = 64

    def wall_s(self, cpu_s: float) -> float:
        """Return the wall time limit for a given CPU time: far longer, as the computer may be busy."""
        return 30.0 + 10.0 * min(cpu_s, self.cpu_s)


@lru_cache(maxsize=1)
def find_bubblewrap() -> Path:
    """Return where bubblewrap is; raise IsolationMissingError if it is not installed, or this is not Linux."""
    if sys.platform != "linux":
        raise IsolationMissingError(
            "Sandboxed grading requires Linux.",
            fix="grade on Linux or in a container; --isolation none is for practice, and every report states it.",
        )
    found = shutil.which("bwrap")
    if found is None:
        raise IsolationMissingError(
            "bubblewrap is not installed, which isolates a student's program.", fix="apt install bubblewrap"
        )
    return Path(found).resolve()


def is_root() -> bool:
    """Return whether we are root, as in a container."""
    return os.geteuid() == 0


def bubblewrap_command(folder: Path, readable: Sequence[Path], is_fork_server: bool) -> Iterator[str]:
    """Yield bubblewrap with its options, which come before the command of a process.

    `readable` are further folders that it may read; a fork server gives each copy of itself a namespace.
    """
    yield from (str(find_bubblewrap()), "--die-with-parent", "--cap-drop", "ALL")
    yield from ("--unshare-ipc", "--unshare-pid", "--unshare-net", "--unshare-uts", "--hostname", "grader")
    if is_root():
        for capability in ("CAP_SETUID", "CAP_SETGID", *["CAP_SYS_ADMIN"] * is_fork_server):  # to setuid to nobody
            yield from ("--cap-add", capability)
    else:
        yield from ("--unshare-user", "--uid", str(NOBODY), "--gid", str(NOBODY))
    yield from ("--dev", "/dev", "--ro-bind", "/usr", "/usr")
    yield from ("--perms", "1777", "--size", str(_SCRATCH_BYTES), "--tmpfs", "/tmp")
    for name in SYSTEM:
        if Path(name).is_symlink():
            yield from ("--symlink", str(Path(name).readlink()), name)
        elif Path(name).is_dir():
            yield from ("--ro-bind", name, name)
    bound = outermost([*python_folders(), KIT, *readable])
    for parent in sorted({parent for path in bound for parent in path.parents} - {Path("/"), Path("/tmp")}):
        yield from ("--dir", str(parent))  # or bubblewrap makes them itself, for root alone
    for path in bound:
        yield from ("--ro-bind", str(path), str(path))
    if LABS.is_dir():
        yield from ("--tmpfs", str(LABS))
    shown = str(SUBMISSION_FOLDER)
    yield from ("--ro-bind", str(folder), shown, "--chdir", shown, "--remount-ro", "/", "--")


def find_private_folder() -> Path | None:
    """Return a private folder on the path to Python, its packages or snr_sim; None if other users may enter all."""
    for path in outermost([*python_folders(), KIT]):
        if closed := first_private_ancestor(path / "any"):
            return closed
    return None


def first_private_ancestor(path: Path) -> Path | None:
    """Return the nearest folder above a path that others may not enter; None if they may enter all."""
    return next((parent for parent in path.parents if not parent.stat().st_mode & 0o001), None)


def python_folders() -> list[Path]:
    """Return where Python's own library and the installed packages are, if not in /usr."""
    base = Path(sys.base_prefix).resolve()
    return [path for path in (base, *package_folders()) if not path.is_relative_to("/usr")]


def package_folders() -> list[Path]:
    """Return the folders of packages in which Python searches."""
    entries = [Path(entry).resolve() for entry in sys.path if entry and Path(entry).is_dir()]
    prefixes = {Path(one).resolve() for one in (sys.prefix, sys.base_prefix)}
    return [entry for entry in entries if any(entry.is_relative_to(prefix) for prefix in prefixes)]


def outermost(paths: Sequence[Path]) -> list[Path]:
    """Return paths, each once, without those that are in another one."""
    resolved = sorted({path.resolve() for path in paths})
    return [path for path in resolved if not any(path != one and path.is_relative_to(one) for one in resolved)]
