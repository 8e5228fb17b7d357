"""A lab: its checks, the cases each is tried on, and its points. `assignments/<lab>/checks.py` defines one as `lab`.

Visible cases are in checks.py. Hidden ones are drawn from a secret that only the instructor has, so reading
checks.py does not reveal them.
"""

from __future__ import annotations

import hashlib
import importlib.util
import inspect
import random
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from types import ModuleType
from typing import Any, TypeAlias

from snr_sim.core.source_location import describe_error
from snr_sim.grading.lab.student import Student
from snr_sim.grading.lab.verdicts import CheckVerdict, GraderError, InconclusiveError
from snr_sim.grading.remote.sent_code import LAB_MODULE
from snr_sim.grading.reports.results import Order
from snr_sim.prelude.errors import UnknownNameError, suggest
from snr_sim.scenario import library

Draw: TypeAlias = Callable[[random.Random], Sequence[Any]]


@dataclass(frozen=True)
class Case:
    """One thing a check is tried on."""

    value: Any  # argument of the check's function
    is_visible: bool  # to students
    name: str = ""  # of that argument

    @property
    def label(self) -> str:
        """What it is about, in a few words: its own `label`, or its fields; a bare number is called by its name."""
        label = getattr(self.value, "label", None)
        if isinstance(label, str):
            return label
        if is_dataclass(self.value):
            pairs = [(one.name, getattr(self.value, one.name)) for one in fields(self.value)]
            return ", ".join(_format_field(name, value) for name, value in pairs)
        if isinstance(self.value, (int, float)):
            return _format_field(self.name, self.value)
        return "" if self.value is None else _format_value(self.value)


_UNITS = {"m": "m", "s": "s", "n": "N", "v": "V", "hz": "Hz", "mps": "m/s", "rad": "rad", "deg": "deg"}


def _format_field(name: str, value: Any) -> str:
    """Return a field and its value as text.

    >>> _format_field("depth_m", 3.0), _format_field("is_armed", (True, False)), _format_field("seed", 4)
    ('depth 3 m', 'armed yes / no', 'seed 4')
    """
    words = name.removeprefix("is_").split("_")
    unit = f" {_UNITS[words.pop()]}" if len(words) > 1 and words[-1] in _UNITS else ""
    return f"{' '.join(words)} {_format_value(value)}{unit}".strip()


def _format_value(value: Any) -> str:
    if isinstance(value, (list, tuple)):
        return " / ".join(map(_format_value, value))
    if isinstance(value, bool):
        return "yes" if value else "no"
    if value is None:
        return "-"
    return f"{value:g}" if isinstance(value, float) else str(value)


@dataclass(frozen=True)
class Check:
    """A function of checks.py with its points and cases; `check` makes it.

    Args:
        function: called with the student, and a case if there are cases; returns a Verdict.
        points: maximum points; shared equally by its cases.
        visible: cases that `snr check` shows.
        hidden: draws the cases that only the instructor has.
        needs: names of checks without whose full points this one is not tried.
        all_or_nothing: whether one case that is not all right costs all points.
    """

    function: Callable[..., CheckVerdict]
    points: float
    visible: Sequence[Any]
    hidden: Draw | None
    needs: tuple[str, ...]
    all_or_nothing: bool

    @property
    def name(self) -> str:
        """The function's name."""
        return self.function.__name__

    @property
    def title(self) -> str:
        """The first line of the function's docstring."""
        return (inspect.getdoc(self.function) or self.name).partition("\n")[0]

    def cases(self, lab: str, secret: bytes | None) -> list[Case]:
        """Return the cases, visible ones first, without a secret only those; raise GraderError if drawing failed."""
        name = next(iter([*inspect.signature(self.function).parameters][1:]), "")
        found = [Case(value, True, name) for value in self.visible]
        if self.hidden is None:
            return found or [Case(None, True)]
        if secret is None:
            return found
        try:
            drawn = [Case(value, False, name) for value in self.hidden(hidden_case_rng(secret, lab, self.name))]
        except Exception as error:
            what = f"while hidden cases were drawn for the check '{self.name}'"
            raise GraderError(describe_error(error, what)) from error
        if not found + drawn:
            fix = "give it visible cases, or draw hidden ones."
            raise GraderError(f"The check '{self.name}' has no case.", fix=fix)
        return found + drawn

    def evaluate(self, student: Student, case: Case) -> CheckVerdict:
        """Try a case.

        Raises:
            SubmissionError: the student's program failed or returned something that the check cannot evaluate.
            InconclusiveError: the check's function returned something else than a Verdict.
        """
        takes_case = len(inspect.signature(self.function).parameters) > 1
        verdict = self.function(student, case.value) if takes_case else self.function(student)
        if not isinstance(verdict, CheckVerdict):
            raise InconclusiveError(
                f"The check '{self.name}' returned {verdict!r}, which is not a Verdict.",
                fix="end it with: return passed().",
            )
        return verdict


def check(
    points: float,
    visible: Sequence[Any] = (),
    hidden: Draw | None = None,
    needs: Sequence[str] = (),
    all_or_nothing: bool = False,
) -> Callable[[Callable[..., CheckVerdict]], Check]:
    """Return a decorator that makes a check of a function; arguments as for `Check`."""
    return lambda function: Check(function, points, tuple(visible), hidden, tuple(needs), all_or_nothing)


def hidden_case_rng(secret: bytes, lab: str, check: str) -> random.Random:
    """Return the generator of a check's hidden cases: from the secret, the lab's name and the check's."""
    digest = hashlib.blake2b("\0".join((lab, check)).encode(), key=hashlib.sha256(secret).digest()).digest()
    return random.Random(int.from_bytes(digest, "big"))


class Lab:
    """What a submission is tried by.

    Args:
        title: of the lab.
        files: required files of a submission.
        checks: in the order in which they are tried and shown.
        may_import: modules that are refused otherwise, such as "socket".
        refused: modules that are refused here, each with the reason; for example one that solves the lab.
        leaderboard: metrics that are ranked, "<check>.<metric>", and whether the least ("asc") or the most is best.

    Raises:
        GraderError: points do not sum to 100, or a check needs one that does not come before it.
    """

    def __init__(
        self,
        title: str,
        files: Sequence[str],
        checks: Sequence[Check],
        may_import: Sequence[str] = (),
        refused: Mapping[str, str] | None = None,
        leaderboard: Mapping[str, Order] | None = None,
    ) -> None:
        self.title: str = title
        self.files: tuple[str, ...] = tuple(files)
        self.checks: tuple[Check, ...] = tuple(checks)
        self.may_import: frozenset[str] = frozenset(may_import)
        self.refused: dict[str, str] = dict(refused or {})
        self.leaderboard: dict[str, Order] = dict(leaderboard or {})
        self.name: str = title  # of its folder, once it was found
        self.folder: Path | None = None
        total = sum(one.points for one in checks)
        if abs(total - 100.0) > 1e-9:
            raise GraderError(
                f"The checks of '{title}' give {total:g} points, not 100.", fix="change the points of a check."
            )
        before: list[str] = []
        for one in checks:
            for need in one.needs:
                if need not in before:
                    what = f"The check '{one.name}' needs '{need}', which does not come before it."
                    raise GraderError(what, fix=suggest(need, before))
            if one.name in before:
                raise GraderError(f"Two checks are called '{one.name}'.", fix="give each a name of its own.")
            before.append(one.name)
        for metric, order in self.leaderboard.items():
            if metric.partition(".")[0] not in before or order not in ("asc", "desc"):
                raise GraderError(
                    f"The leaderboard entry '{metric}': '{order}' is not valid.",
                    fix='give CHECK.METRIC and the order: {"lands.fuel_kg": "asc"} ranks the smallest first.',
                )

    def module(self, name: str) -> ModuleType:
        """Import a module of the lab's own folder, next to its checks: "grader.pilot" is `grader/pilot.py`."""
        return importlib.import_module(f"{LAB_MODULE}{self.name}.{name}")


def find_lab(name: str) -> Lab:
    """Find a lab by its name, with or without its number, or by a path, and read its checks.

    Raises:
        UnknownNameError: there is none, or it has no checks.
        GraderError: its checks cannot be read.
    """
    found = library.find_lab(name)
    path = found.path / "checks.py"
    if not path.is_file():
        raise UnknownNameError(f"The lab '{found.name}' has no checks: there is no {path}.", fix="snr list assignments")
    return load_lab(path)


def load_lab(path: Path) -> Lab:
    """Read the checks of a lab from its checks.py, which may import modules of its folder: `from .grader import ...`.

    GraderError is raised if they cannot be read.
    """
    folder = path.resolve().parent
    name = folder.name
    spec = importlib.util.spec_from_file_location(LAB_MODULE + name, path, submodule_search_locations=[str(folder)])
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    if getattr(sys.modules.get(spec.name), "__path__", None) != module.__path__:  # a lab of this name elsewhere
        for known in [one for one in sys.modules if one.startswith(f"{spec.name}.")]:
            del sys.modules[known]
    sys.modules[spec.name] = module
    try:
        spec.loader.exec_module(module)
    except GraderError:
        raise
    except Exception as error:
        raise GraderError(describe_error(error, f"while the checks of '{name}' were read")) from error
    lab = getattr(module, "lab", None)
    if not isinstance(lab, Lab):
        raise GraderError(f"{path} has no `lab` that is a Lab.", fix='lab = Lab("Title", files=[...], checks=[...]).')
    lab.name, lab.folder = name, folder
    return lab
