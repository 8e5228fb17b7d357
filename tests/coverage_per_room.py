"""Print the coverage of each room of snr_sim, lines and branches, and the statements that no test executes.

    coverage run -m pytest -m 'fast or slow' && coverage combine && python tests/coverage_per_room.py

The options of the measurement are in pyproject.toml. What runs inside a sandbox, which may write no files, is missed.
"""

from __future__ import annotations

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


def main() -> None:
    """Read the data of the last measurement and print both tables."""
    measured = coverage.Coverage(config_file=str(ROOT / "pyproject.toml"))
    measured.load()
    totals: dict[str, list[int]] = defaultdict(lambda: [0, 0, 0, 0])  # statements, executed, branches, taken
    missing: list[tuple[str, str]] = []
    for path in sorted(KIT.rglob("*.py")):
        name = path.relative_to(KIT)
        if name.parts[0] == "shipped":
            continue
        found = measured._analyze(str(path))
        numbers = found.numbers
        for room in (name.parts[0].removesuffix(".py"), "all"):
            sums = totals[room]
            sums[0] += numbers.n_statements
            sums[1] += numbers.n_executed
            sums[2] += numbers.n_branches
            sums[3] += numbers.n_executed_branches
        if found.missing:
            missing.append((f"snr_sim/{name.as_posix()}", ranges(list(found.missing))))
    print("statements that no test executes:")
    for file, lines in missing:
        print(f"  {file}: {lines}")
    print(f"\n{'room':<14} {'statements':>10} {'executed':>9} {'branches':>9} {'taken':>7}")
    for room, (statements, executed, branches, taken) in sorted(totals.items(), key=lambda item: item[0] == "all"):
        line_share, branch_share = executed / max(statements, 1), taken / max(branches, 1)
        print(f"{room:<14} {statements:>10} {line_share:>9.1%} {branches:>9} {branch_share:>7.1%}")


if __name__ == "__main__":
    main()
