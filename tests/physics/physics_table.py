"""The page robots/urov/PHYSICS.md: each case in physics_cases/, its reference, the plant's result, the error.

python tests/physics/physics_table.py            writes the page
python tests/physics/physics_table.py --print    shows it
"""

from __future__ import annotations

import sys
from itertools import groupby
from pathlib import Path

from physics_cases import cases
from physics_cases.case import STEPS_S, Case

PAGE = Path(__file__).parents[2] / "robots" / "urov" / "PHYSICS.md"

SHOWN_STEPS = ", ".join(f"{1e3 * step_s:g}" for step_s in STEPS_S)

HEAD = f"""# What the vehicle's physics is worth

Made by `python tests/physics/physics_table.py`; a test compares it with what the plant does. Each case is known without
a simulation: a closed form, a conserved quantity, the root of steady equations, or a Runge-Kutta (all in
`tests/physics/physics_cases/`) that shares nothing with the plant but the numbers. Errors are shares of the reference,
or in its unit where that is 0, at steps of {SHOWN_STEPS} ms (the plant's own is 5); 0 is rounding, or less than a
ten-thousandth of what is allowed. "Allowed" is what the test allows at each step, and why.

`benzon2022` and `wu2018` are as they are in `vehicles/`, in fresh water; where only one axis is meant, they are
ballasted to weigh nothing, with their buoyancy at their centre of mass.
"""


def row(case: Case, ours: list[float]) -> str:
    """Return one line of the table.

    Args:
        case: what it is about.
        ours: the plant's result, at each step.
    """
    errors = " | ".join(_error(case, value) for value in ours)
    allowed = f"{case.allowed:.0e}" + ("" if case.reference else f" {case.unit}")
    shown = f"{ours[1]:.5g}" if case.reference else _error(case, ours[1])
    return f"| {case.name} | {case.reference:.5g} {case.unit} | {shown} | {errors} | {allowed}: {case.reason} |"


def _error(case: Case, ours: float) -> str:
    """Return an error to one digit; one that is negligible, and may differ between computers, is 0."""
    error = case.error(ours)
    return f"{error:+.0e}" if abs(error) >= min_shown_error(case) else "0"


def min_shown_error(case: Case) -> float:
    """Return the least error that is shown."""
    return max(1e-9, 1e-4 * case.allowed)


def page(rows: dict[str, str]) -> str:
    """Return the page.

    Args:
        rows: of each case, by its name.
    """
    parts = [HEAD]
    for group, members in groupby(cases(), lambda case: case.group):
        parts.append(f"\n## {group}\n")
        parts.append(
            "| Case | Reference | At 5 ms | " + " | ".join(f"Error, {1e3 * s:g} ms" for s in STEPS_S) + " | Allowed |"
        )
        parts.append("|---|---|---|" + "---|" * len(STEPS_S) + "---|")
        parts += [rows[case.name] for case in members]
    return "\n".join(parts) + "\n"


if __name__ == "__main__":
    text = page({case.name: row(case, [case.run(step_s) for step_s in STEPS_S]) for case in cases()})
    if "--print" in sys.argv:
        print(text)
    else:
        PAGE.write_text(text, encoding="utf-8")
        print(f"{PAGE}: {len(cases())} cases")
