"""Earlier results of `snr bench`, one JSON object per line, and the rows that have become slower.

Times of different days are not comparable, since a computer's speed drifts by half. Compared are ratios: of the subject
to a bare version that was measured in turns with it.
"""

from __future__ import annotations

import json
from pathlib import Path
from statistics import median
from typing import Any

LAST = 5  # results that count; one alone may have been measured on a busy computer
SLOWER = 1.1

Result = dict[str, Any]


def read_history(path: Path) -> list[Result]:
    """Return the results in a history file, oldest first; a truncated or invalid line is skipped."""
    results = []
    for line in path.read_text(errors="replace").splitlines() if path.is_file() else []:
        try:
            result = json.loads(line)
        except json.JSONDecodeError:
            continue
        if isinstance(result, dict) and isinstance(result.get("rows"), list):
            results.append(result)
    return results


def append_result(path: Path, result: Result) -> None:
    """Append a result to a history file, which is created if it does not exist.

    Raises:
        ParameterError: the file cannot be written.
    """
    from snr_sim.prelude.errors import ParameterError

    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("a") as file:
            file.write(json.dumps(result) + "\n")
    except OSError as error:
        raise ParameterError(
            f"The history {path} cannot be written: {error.strerror}.", fix="name another file with --history."
        ) from error


def slower_rows(history: list[Result], result: Result) -> list[dict[str, Any]]:
    """Return the rows of a result whose ratio is more than 10 % above the median of the last comparable results.

    Args:
        history: earlier results, oldest first. Those with the same processor, Python and options are comparable.
        result: the newest.

    Returns:
        for each: subject, name, ratio, before (the median), and slower_by (ratio / before).
    """
    ratios: dict[tuple[str, str], list[float]] = {}
    for earlier in history:
        if _conditions(earlier) == _conditions(result):
            for row in earlier["rows"]:
                if row.get("ratio"):
                    ratios.setdefault((row["subject"], row["name"]), []).append(row["ratio"])
    slower = []
    for row in result["rows"]:
        before = ratios.get((row["subject"], row["name"]), [])[-LAST:]
        if row["ratio"] and before and row["ratio"] > SLOWER * median(before):
            then = median(before)
            about = {"subject": row["subject"], "name": row["name"], "ratio": row["ratio"]}
            slower.append({**about, "before": then, "slower_by": row["ratio"] / then})
    return slower


def _conditions(result: Result) -> tuple[Any, ...]:
    machine = result.get("machine", {})
    return machine.get("cpu"), machine.get("cores"), machine.get("python"), result.get("options")
