"""Report of `snr bench`: runs benchmarks, and prints their rows as a table or as JSON.

Each file `bench_<name>.py` measures in a process of its own, so that none warms up or slows down the next, and prints
rows of JSON. A benchmark whose dependencies are missing is reported and skipped; one that fails is reported, and the
others run all the same.
"""

from __future__ import annotations

import importlib.metadata
import json
import os
import platform
import subprocess
import sys
import time
from contextlib import nullcontext
from pathlib import Path
from typing import Any

from history import append_result, read_history, slower_rows
from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from snr_sim.cli.plain_console import plain_console
from snr_sim.prelude.errors import UnknownNameError, suggest

_PREFIX = "bench_"
_REPORTED_PACKAGES = ("msgspec", "numpy", "pymunk", "rerun-sdk")
_WIDTH_IN_A_PIPE = 150

# A row as printed by harness.py; `skipped` is the reason why it was not measured.
Row = dict[str, Any]


def report(names: list[str], options: list[str], history: Path | None) -> int:
    """Measure, print the results, and return the exit status of `snr bench`.

    Args:
        names: of the benchmarks; all if there are none.
        options: for each of them.
        history: file of earlier results, for JSON; None for a table.

    Raises:
        UnknownNameError: there is no benchmark with this name.
    """
    files = _chosen(names)
    found: list[Row] = []
    failed: list[dict[str, Any]] = []
    errors = plain_console(stderr=True)
    for file in files:
        status = _measure(file, options, errors, found)
        if status != 0:
            failed.append({"subject": _subject(file), "status": status})
    rows = [row for row in found if "skipped" not in row]
    skipped = [row for row in found if "skipped" in row]
    if history is not None:
        result = {"machine": machine(), "options": options, "rows": rows, "skipped": skipped, "failed": failed}
        slower = slower_rows(read_history(history), result)
        append_result(history, result)
        print(json.dumps({**result, "slower": slower}))
        for one in slower:
            errors.print(
                f"{one['subject']}: {one['name']} is slower: {one['ratio']:.2f} x the bare version, "
                f"{one['before']:.2f} x before"
            )
    else:
        _show(rows, skipped)
    for one in failed:
        errors.print(
            f"The benchmark '{one['subject']}' stopped with status {one['status']}; its output is above.\n"
            f"  Try: run it alone: snr bench {one['subject']} --quick."
        )
    return 2 if failed else 0


def _subject(file: Path) -> str:
    return file.stem.removeprefix(_PREFIX)


def _chosen(names: list[str]) -> list[Path]:
    known = {_subject(path): path for path in sorted(Path(__file__).parent.glob(f"{_PREFIX}*.py"))}
    for name in names:
        if name not in known:
            raise UnknownNameError(f"There is no benchmark '{name}'.", fix=suggest(name, list(known)))
    return [known[name] for name in names or known]


def _measure(file: Path, options: list[str], errors: Console, found: list[Row]) -> int:
    """Run one benchmark and add its rows as they arrive; return its exit status."""
    subject = _subject(file)
    shown = errors.status(f"measuring {subject}") if errors.is_terminal else nullcontext()
    command = [sys.executable, str(file.with_name("run.py")), subject, *options]
    with shown, subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        found.extend({"subject": subject, **json.loads(line)} for line in process.stdout)
    return process.returncode


def machine() -> dict[str, Any]:
    """Return the conditions of the measurement: processor, cores, versions, and time."""
    versions = {}
    for package in _REPORTED_PACKAGES:
        try:
            versions[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            continue
    return {
        "cpu": _cpu_model(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "compiler": platform.python_compiler(),
        "platform": platform.platform(),
        "packages": versions,
        "date": time.strftime("%Y-%m-%d"),
    }


def _cpu_model() -> str:
    """Return the processor's name: from /proc/cpuinfo on Linux, elsewhere from Python's `platform`."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    for line in lines:
        name, _, value = line.partition(":")
        if name.strip() in ("model name", "Model"):
            return value.strip()
    return platform.processor() or platform.machine()


def _show(rows: list[Row], skipped: list[Row]) -> None:
    console = plain_console(width_in_a_pipe=_WIDTH_IN_A_PIPE)
    console.print(_table(rows))
    for row in rows:
        if row["note"]:
            console.print(f"{row['name']}: {row['note']}.")
    for row in skipped:
        console.print(f"skipped: {row['name']}: {row['skipped']}")
    here = machine()
    console.print(f"{here['cpu']}, {here['cores']} cores, Python {here['python']}, {here['date']}")
    missed = sum(row["is_met"] is False for row in rows)
    if missed:
        console.print(
            f"{missed} of {len(rows)} rows miss their target. On a busy machine look at the ratios, and measure again."
        )


def _table(rows: list[Row]) -> Table:
    table = Table(box=box.SIMPLE_HEAD)
    for title in ("", "value", "bare", "ratio", "target"):
        table.add_column(title, justify="left" if title == "" else "right", overflow="fold")
    table.add_column("")
    for row in rows:
        value = f"{row['value']:.3g} {row['unit']}" if row["value"] < 1000 else f"{row['value']:.0f} {row['unit']}"
        baseline = "" if row["baseline"] is None else f"{row['baseline']:.3g}"
        ratio = "" if row["ratio"] is None else f"{row['ratio']:.2f} x"
        table.add_row(row["name"], value, baseline, ratio, _target(row), Text(*_verdict_word(row["is_met"])))
    return table


def _target(row: Row) -> str:
    """Return a row's targets as text: '<= 0.6 us, <= 5 x'."""
    words = []
    if row["limit"] is not None:
        words.append(f"{'>=' if row['more_is_better'] else '<='} {row['limit']:g} {row['unit']}")
    if row["ratio_limit"] is not None:
        words.append(f"<= {row['ratio_limit']:g} x")
    return ", ".join(words)


def _verdict_word(is_met: bool | None) -> tuple[str, str]:
    """Return the word for a result, and its colour."""
    if is_met is None:
        return "", ""
    return ("met", "green") if is_met else ("missed", "red")
