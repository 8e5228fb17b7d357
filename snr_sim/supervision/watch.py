"""Deadlines of what must report regularly, such as the processes of a robot: which of them hang.

A watched process reports by `pet` that it works. It hangs once its silence is as long as its timeout. Time is an
argument, so the same table serves a virtual clock and the wall clock. For one thread.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from snr_sim.prelude.errors import ParameterError, SupervisionError, UnknownNameError, suggest

PREVIOUS: Literal["PREVIOUS"] = "PREVIOUS"


@dataclass(slots=True)
class Deadline:
    """The deadline of one name.

    Attributes:
        timeout_s: how long it may be silent.
        previous_s: the timeout before the last `extend`.
        last_pet_s: when it reported last.
        is_reported: whether `take_hanging` has returned it since then.
    """

    timeout_s: float
    previous_s: float
    last_pet_s: float
    is_reported: bool = False

    def pet(self, now_s: float) -> None:
        """Begin the time of silence again."""
        self.last_pet_s, self.is_reported = now_s, False


class Watch:
    """Table of deadlines by name, in the order in which they were added."""

    def __init__(self) -> None:
        self.deadlines: dict[str, Deadline] = {}

    def add(self, name: str, timeout_s: float, now_s: float) -> None:
        """Watch a name from now on; one that is watched already, as after a restart, loses its former deadline.

        Raises:
            ParameterError: the timeout is not positive and finite.
        """
        _check_timeout(name, timeout_s)
        self.deadlines.pop(name, None)
        self.deadlines[name] = Deadline(timeout_s, timeout_s, now_s)

    def remove(self, name: str) -> None:
        """Stop watching a name.

        Raises:
            UnknownNameError: it is not watched.
        """
        self._get(name)
        del self.deadlines[name]

    def pet(self, name: str, now_s: float) -> None:
        """Note that a name works.

        Raises:
            UnknownNameError: it is not watched.
        """
        self._get(name).pet(now_s)

    def extend(self, name: str, timeout_s: float | Literal["PREVIOUS"]) -> None:
        """Set the timeout of a name. This is not a pet: the silence so far counts.

        Args:
            timeout_s: the new timeout, also a shorter one; "PREVIOUS" for the one before the last change.

        Raises:
            ParameterError: the timeout is not positive and finite.
            UnknownNameError: the name is not watched.
        """
        deadline = self._get(name)
        if timeout_s == PREVIOUS:
            deadline.timeout_s = deadline.previous_s
            return
        _check_timeout(name, timeout_s)
        deadline.previous_s, deadline.timeout_s = deadline.timeout_s, timeout_s

    def reset(self, now_s: float) -> None:
        """Pet all names. It hides hangs, so the caller should log it."""
        for deadline in self.deadlines.values():
            deadline.pet(now_s)

    def get_hanging(self, now_s: float) -> list[str]:
        """Return all names that hang.

        Raises:
            SupervisionError: a deadline is corrupt, so that its name would never be found to hang.
        """
        for name, deadline in self.deadlines.items():
            _check_deadline(name, deadline, now_s)
        return [name for name, one in self.deadlines.items() if now_s - one.last_pet_s >= one.timeout_s]

    def take_hanging(self, now_s: float) -> list[str]:
        """Return names that hang and have not been returned since their last pet, so each hang is reported once.

        Raises:
            SupervisionError: a deadline is corrupt, so that its name would never be found to hang.
        """
        hangs = [name for name in self.get_hanging(now_s) if not self.deadlines[name].is_reported]
        for name in hangs:
            self.deadlines[name].is_reported = True
        return hangs

    def _get(self, name: str) -> Deadline:
        try:
            return self.deadlines[name]
        except KeyError:
            raise UnknownNameError(f"'{name}' is not watched.", fix=suggest(name, self.deadlines)) from None


def _is_timeout(value: object) -> bool:
    return isinstance(value, (int, float)) and math.isfinite(value) and value > 0


def _check_timeout(name: str, timeout_s: float) -> None:
    if not _is_timeout(timeout_s):
        raise ParameterError(
            f"The timeout of '{name}' must be positive and finite, not {timeout_s!r}.",
            fix='a number of seconds; `extend` also takes "PREVIOUS".',
        )


def _check_deadline(name: str, deadline: Deadline, now_s: float) -> None:
    # Comparisons with NaN are false, and a pet in the future hides any silence: both would look healthy indefinitely.
    if not (_is_timeout(deadline.timeout_s) and deadline.last_pet_s <= now_s):
        raise SupervisionError(
            f"The deadline of '{name}' is corrupt at {now_s!r} s: {deadline}.",
            fix="change deadlines by the methods of Watch, with the time of one clock.",
        )
