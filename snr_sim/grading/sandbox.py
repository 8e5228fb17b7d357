"""How a student's process is started, and what it may use."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import snr_sim

KIT = Path(snr_sim.__file__).resolve().parent


@dataclass(frozen=True)
class Limits:
    """What a student's process may use.

    Args:
        cpu_s: CPU time of its whole life, its start with the imports included.
        memory_bytes: address space.
    """

    cpu_s: float = 60.0
    memory_bytes: int = 2 << 30

    def wall_s(self, cpu_s: float) -> float:
        """Returns how long to wait for something that may take so much CPU time: far longer, on a busy computer."""
        return 30.0 + 10.0 * min(cpu_s, self.cpu_s)


def environment() -> dict[str, str]:
    """Returns the whole environment of a student's process: nothing of ours."""
    threads = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    return {"PYTHONHASHSEED": "0", "PYTHONDONTWRITEBYTECODE": "1", "LC_ALL": "C.UTF-8", **threads}


def search_path() -> list[Path]:
    """Returns where the child looks for modules: Python's own folders, installed packages and the kit."""
    own = [Path(entry).resolve() for entry in sys.path if entry and Path(entry).is_dir()]
    prefixes = {Path(one).resolve() for one in (sys.prefix, sys.base_prefix)}
    kept = [path for path in own if any(path.is_relative_to(prefix) for prefix in prefixes)]
    return list(dict.fromkeys([*kept, KIT.parent]))


def command_of(folder: Path, isolation: str, line: int, readable: Sequence[Path]) -> tuple[list[str], Path]:
    """Returns the command that starts a student's process, and its current folder.

    Args:
        folder: of the submission.
        isolation: "none".
        line: the file descriptor it answers on.
        readable: folders that it may read.
    """
    path = [str(one) for one in search_path()]
    begin = f"import sys; sys.path[:] = {path!r}; from snr_sim.grading.child import main; main({line})"
    return [sys.executable, "-P", "-s", "-S", "-c", begin], folder
