"""`snr bench`: measures the speed of snr_sim on this machine and compares it with the targets.

The benchmarks, and what runs them and prints their results, are in `tests/bench`, which an installed snr_sim lacks.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from snr_sim.prelude.errors import UnknownNameError


def bench(
    names: Annotated[
        list[str] | None, typer.Argument(help="Which: dispatch, pages, loops, processes, lander, ...")
    ] = None,
    is_quick: Annotated[bool, typer.Option("--quick", help="Measure briefly: to see that it works.")] = False,
    with_install: Annotated[bool, typer.Option("--install", help="Measure the size of a fresh base install.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object, and keep it in the history.")] = False,
    history: Annotated[Path, typer.Option(metavar="FILE", help="With --json: earlier results, one line each.")] = Path(
        "runs/bench.jsonl"
    ),
) -> None:
    """Measure speed on this machine and compare it with the targets.

    Times are CPU time, ratios are to a bare version measured in turns within the same run. Needs a checkout of the
    project, and some quiet: whatever else runs is measured, too.

    With --json what has become slower by more than 10 % is named. Compared are ratios to the bare version, with the
    median of the last five results in the history of the same processor, Python and options.

    Exit status: 0 it was measured, also if targets are missed; 2 there are no benchmarks, or one failed.
    """
    from snr_sim.scenario.library import load_program

    folders = (Path.cwd(), Path(__file__).resolve().parents[2])
    report = next((path for folder in folders if (path := folder / "tests" / "bench" / "report.py").is_file()), None)
    if report is None:
        raise UnknownNameError(
            "The benchmarks are not part of an installed snr_sim, and there is no tests/bench in the current folder.",
            fix="get the project with git, and run `snr bench` in its folder.",
        )
    options = [*(["--quick"] if is_quick else []), *(["--install"] if with_install else [])]
    sys.exit(load_program(str(report)).report(names or [], options, history if as_json else None))
