"""The grader: determines the points of a submission in a way that the submission cannot change."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from snr_sim.grading.lab.feed import Given, Produced
    from snr_sim.grading.lab.fields import field_of, page_of
    from snr_sim.grading.lab.fly import Flown
    from snr_sim.grading.lab.lab import Lab, check
    from snr_sim.grading.lab.student import Student
    from snr_sim.grading.lab.verdicts import Verdict, failed, partly, passed

# Imported when they are first used: the process of a student's program imports this package, too, and needs none of it.
_PLACES = {
    "snr_sim.grading.lab.feed": ("Given", "Produced"),
    "snr_sim.grading.lab.fields": ("field_of", "page_of"),
    "snr_sim.grading.lab.fly": ("Flown",),
    "snr_sim.grading.lab.lab": ("Lab", "check"),
    "snr_sim.grading.lab.student": ("Student",),
    "snr_sim.grading.lab.verdicts": ("Verdict", "failed", "partly", "passed"),
}
_MODULE_OF = {name: module for module, names in _PLACES.items() for name in names}
__all__ = [
    "Flown",
    "Given",
    "Lab",
    "Produced",
    "Student",
    "Verdict",
    "check",
    "failed",
    "field_of",
    "page_of",
    "partly",
    "passed",
]


def __getattr__(name: str) -> Any:
    module = _MODULE_OF.get(name)
    if module is None:
        raise AttributeError(f"module 'snr_sim.grading' has no attribute {name!r}")
    return getattr(importlib.import_module(module), name)
