"""Code of classes and functions that run in a student's process but are not the student's.

Modules of snr_sim are imported there. A module of a lab is sent as code when it is needed, and alone: the
process can read neither the lab's folder nor its other files. So such a module imports nothing else of the lab.
"""

from __future__ import annotations

import importlib
import marshal
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import msgspec

from snr_sim.grading.lab.verdicts import GraderError

LAB_MODULE = "snr_sim_lab_"  # so begin the names of modules that are the checks of a lab


class SentCode(msgspec.Struct, frozen=True):
    """A class or function, for a process to have.

    Args:
        module, name: where it is found.
        code: of the module, by `marshal`; none if it belongs to snr_sim.
    """

    module: str
    name: str
    code: bytes = b""

    def load(self) -> Any:
        """Return the class or function in the process that this was sent to."""
        if self.code and self.module not in sys.modules:
            module = sys.modules[self.module] = ModuleType(self.module)
            exec(marshal.loads(self.code), vars(module))
        return getattr(importlib.import_module(self.module), self.name)


def code_to_send(one: Callable[..., Any]) -> SentCode:
    """Return a class or function of snr_sim or of a lab as it is sent; raise GraderError if it is of neither."""
    module = one.__module__
    if module.startswith("snr_sim."):
        return SentCode(module, one.__qualname__)
    if not module.startswith(LAB_MODULE) or "." not in module:
        raise GraderError(
            f"{one.__qualname__} of {module} cannot be sent to a student's process.",
            fix="put it into a module of its own in the lab's folder: grader/bench.py.",
        )
    return SentCode(module, one.__qualname__, _code_of(sys.modules[module]))


@cache
def _code_of(module: ModuleType) -> bytes:
    # Not the file's own name: the process cannot read that file, and its lines are not the student's.
    return marshal.dumps(compile(Path(str(module.__file__)).read_bytes(), f"<{module.__name__}>", "exec"))
