"""The pages robots/*/PHYSICS.md: each case in physics_cases/, its reference, the plant's result, the error.

python tests/physics/physics_table.py ROBOT            writes the page of a robot, urov or rover
python tests/physics/physics_table.py ROBOT --print    shows it
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

from physics_cases import cases
from physics_cases.case import STEPS_S, Case
from physics_cases.rover import ROVER_STEPS_S, rover_cases

ROBOTS = Path(__file__).parents[2] / "robots"


@dataclass(frozen=True)
class Page:
    """A page of cases.

    Args:
        robot: whose they are.
        cases: returns all of them.
        steps_s: of integration, three; the plant's own is that in the middle.
        about: text over the tables.
    """

    robot: str
    cases: Callable[[], list[Case]]
    steps_s: tuple[float, float, float]
    about: str

    @property
    def path(self) -> Path:
        """Where it is."""
        return ROBOTS / self.robot / "PHYSICS.md"


HEAD = """# What the {what} physics is worth

Made by `python tests/physics/physics_table.py {robot}`; a test compares it with what the plant does. Each case is known
without a simulation: a closed form, a conserved quantity, the root of steady equations, or {other} (all in
`tests/physics/physics_cases/`) that shares nothing with the plant but the numbers. Errors are shares of the reference,
or in its unit where that is 0, at steps of {steps} ms (the plant's own is {own}); 0 is rounding, or less than a
ten-thousandth of what is allowed. "Allowed" is what the test allows at each step, and why.
"""
UROV = Page(
    "urov",
    cases,
    STEPS_S,
    HEAD.format(what="vehicle's", robot="urov", other="a Runge-Kutta", steps="2, 5, 10", own="5")
    + """
`benzon2022` and `wu2018` are as they are in `vehicles/`, in fresh water; where only one axis is meant, they are
ballasted to weigh nothing, with their buoyancy at their centre of mass.
""",
)
ROVER = Page(
    "rover",
    rover_cases,
    ROVER_STEPS_S,
    HEAD.format(what="rover's", robot="rover", other="an iteration", steps="1, 2, 4", own="2")
    + """
The rover is that of `vehicles/competition.toml`. References that depend on the rolling radius, or on loads, take those
that the plant has: they are cases of their own.
""",
)
PAGES = {page.robot: page for page in (UROV, ROVER)}


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


def text_of(page: Page, rows: dict[str, str]) -> str:
    """Return the text of a page.

    Args:
        page: which.
        rows: of each case, by its name.
    """
    parts = [page.about]
    own_s, errors = page.steps_s[1], " | ".join(f"Error, {1e3 * step_s:g} ms" for step_s in page.steps_s)
    for group, members in groupby(page.cases(), lambda case: case.group):
        parts.append(f"\n## {group}\n")
        parts.append(f"| Case | Reference | At {1e3 * own_s:g} ms | {errors} | Allowed |")
        parts.append("|---|---|---|" + "---|" * len(page.steps_s) + "---|")
        parts += [rows[case.name] for case in members]
    return "\n".join(parts) + "\n"


if __name__ == "__main__":
    asked = PAGES.get(sys.argv[1]) if len(sys.argv) > 1 else None
    if asked is None:
        sys.exit(__doc__)
    text = text_of(
        asked, {case.name: row(case, [case.run(step_s) for step_s in asked.steps_s]) for case in asked.cases()}
    )
    if "--print" in sys.argv:
        print(text)
    else:
        asked.path.write_text(text, encoding="utf-8")
        print(f"{asked.path}: {len(asked.cases())} cases")
