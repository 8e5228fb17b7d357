"""Start-up: import time of snr_sim, and the size of an installation on a Raspberry Pi.

Wall time of whole processes, bare Python in between. With --install, the base install goes into a fresh environment,
which takes a minute and needs the package index.

Run by `snr bench start_up`.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from statistics import median

from harness import Row, with_bytecode

PROJECT = Path(__file__).resolve().parents[2]
sys.path.append(str(PROJECT / "tests"))
from install_size import size_mb  # noqa: E402

NOTHING = [sys.executable, "-c", "pass"]
IMPORT = [sys.executable, "-c", "import snr_sim"]
HELP = [sys.executable, "-m", "snr_sim", "--help"]


def wall_time_s(command: list[str], bytecode: Path) -> float:
    """Return the time of one process from start to end, with its bytecode kept in a folder."""
    start_s = time.perf_counter()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env=with_bytecode(bytecode))
    return time.perf_counter() - start_s


def base_install_mb() -> float:
    """Return the size of all packages of a base install, without bytecode [10^6 bytes]."""
    with tempfile.TemporaryDirectory() as name:
        subprocess.run([sys.executable, "-m", "venv", name], check=True)
        pip = [str(Path(name) / "bin" / "python"), "-m", "pip", "install", "--quiet", "--no-compile", str(PROJECT)]
        subprocess.run(pip, check=True, stdout=subprocess.DEVNULL)
        return size_mb(Path(name))


def measure(is_quick: bool) -> Iterator[Row]:
    """Yield the rows."""
    rounds = 3 if is_quick else 15
    commands = (NOTHING, IMPORT, HELP)
    with tempfile.TemporaryDirectory() as name:
        for command in commands:
            wall_time_s(command, Path(name))  # so that bytecode is written and files are in memory
        turns = [[wall_time_s(command, Path(name)) for command in commands] for _ in range(rounds)]
    yield Row(
        "import snr_sim, beyond bare Python",
        1e3 * median(imported - bare for bare, imported, _ in turns),
        "ms",
        limit=120.0,
        baseline=1e3 * median(bare for bare, _, _ in turns),
        compared_to="python -c pass",
        note="wall time, median",
    )
    yield Row(
        "import snr_sim",
        1e3 * median(imported for _, imported, _ in turns),
        "ms",
        limit=250.0,
        baseline=1e3 * median(bare for bare, _, _ in turns),
        compared_to="python -c pass",
        note="wall time, median",
    )
    yield Row(
        "snr --help",
        1e3 * median(helped for _, _, helped in turns),
        "ms",
        limit=150.0,
        baseline=1e3 * median(bare for bare, _, _ in turns),
        compared_to="python -c pass",
        note="wall time, median",
    )
    if "--install" in sys.argv:
        yield Row("base install", base_install_mb(), "MB", limit=25.0, note="without bytecode, pip and setuptools")
