"""Print the coverage of each room of snr_sim, lines and branches, and the statements that no test executes.

    COVERAGE_FILE=FOLDER/fast coverage run --branch -m pytest
    COVERAGE_FILE=FOLDER/slow COVERAGE_CORE=sysmon coverage run -m pytest -m slow
    python tests/coverage_per_room.py FOLDER

Branches are those of the fast lane: before Python 3.14 they can only be measured with a trace function, which makes the
slow lane take 2 to 3 times as long; lines by `sys.monitoring` cost a sixth. What runs inside a sandbox, which may write
no files, is missed.
"""

from __future__ import annotations

import sys
from collections import defaultdict
from pathlib import Path

import coverage

ROOT = Path(__file__).parents[1]
KIT = ROOT / "snr_sim"


def ranges(lines: list[int]) -> str:
    """Return line numbers as text, neighbours joined.

    >>> ranges([3, 4, 5, 9])
    '3-5, 9'
    """
    parts: list[list[int]] = []
    for line in sorted(lines):
        if parts and line == parts[-1][-1] + 1:
            parts[-1].append(line)
        else:
            parts.append([line])
    return ", ".join(f"{part[0]}-{part[-1]}" if len(part) > 1 else str(part[0]) for part in parts)


def measured_in(folder: Path, lane: str) -> coverage.Coverage:
    """Return what the processes of a lane have measured."""
    measured = coverage.Coverage(config_file=str(ROOT / "pyproject.toml"), data_file=str(folder / lane))
    measured.combine([str(path) for path in folder.glob(f"{lane}.*")])
    return measured


def main() -> None:
    """Read the data of both lanes and print both tables."""
    fast, slow = (measured_in(Path(sys.argv[1]), lane) for lane in ("fast", "slow"))
    totals: dict[str, list[int]] = defaultdict(lambda: [0, 0, 0, 0])  # statements, executed, branches, taken
    missing: list[tuple[str, str]] = []
    for path in sorted(KIT.rglob("*.py")):
        name = path.relative_to(KIT)
        if name.parts[0] == "shipped":
            continue
        found = fast._analyze(str(path))
        numbers = found.numbers
        missed = found.missing & slow._analyze(str(path)).missing
        for room in (name.parts[0].removesuffix(".py"), "all"):
            sums = totals[room]
            sums[0] += numbers.n_statements
            sums[1] += numbers.n_statements - len(missed)
            sums[2] += numbers.n_branches
            sums[3] += numbers.n_executed_branches
        if missed:
            missing.append((f"snr_sim/{name.as_posix()}", ranges(list(missed))))
    print("statements that no test executes:")
    for file, lines in missing:
        print(f"  {file}: {lines}")
    print(f"\n{'room':<14} {'statements':>10} {'executed':>9} {'branches':>9} {'taken':>7}  (by the fast lane)")
    for room, (statements, executed, branches, taken) in sorted(totals.items(), key=lambda item: item[0] == "all"):
        line_share, branch_share = executed / max(statements, 1), taken / max(branches, 1)
        print(f"{room:<14} {statements:>10} {line_share:>9.1%} {branches:>9} {branch_share:>7.1%}")


if __name__ == "__main__":
    main()
