"""Results of a class, written when all of it is graded: tables, ranking, picture."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path

from snr_sim.grading.batch.class_folder import ClassFolder
from snr_sim.grading.reports.class_table import Summary, write_cases, write_class, write_leaderboard
from snr_sim.grading.reports.distribution import draw_distribution
from snr_sim.prelude.errors import MissingExtraError
from snr_sim.recording.atomic_files import write_atomic


def write_class_files(folder: ClassFolder, title: str) -> tuple[Summary, str]:
    """Write class.csv, cases.csv, leaderboard.csv if something is ranked, and distribution.png.

    Returns:
        the class in numbers, and why there is no picture, if there is none.
    """
    summary = Summary()
    for graded in folder.every_result():
        summary.add(graded)
    given = {one.id: str(one.given) for one in folder.known}
    _write(folder.path / "class.csv", lambda table: write_class(table, folder.every_result, given))
    _write(folder.path / "cases.csv", lambda table: write_cases(table, folder.every_result()))
    if summary.ranked:
        _write(folder.path / "leaderboard.csv", lambda table: write_leaderboard(table, summary))
    try:
        draw_distribution(summary, title, folder.path / "distribution.png")
    except (MissingExtraError, ImportError) as error:
        return summary, f"There is no picture of the distribution. {error}"
    return summary, ""


def _write(path: Path, fill: Callable[[io.StringIO], None]) -> None:
    table = io.StringIO(newline="")
    fill(table)
    write_atomic(path, table.getvalue().encode())
