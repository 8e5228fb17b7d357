"""A pilot's commands where they arrive: whether a page "controls" is valid, and which command counts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Generic, Protocol, TypeVar

import msgspec

from snr_sim.prelude.errors import CommandError, ParameterError, UnknownNameError, suggest
from snr_sim.prelude.task import ensure_type_info

PILOTS = ("scripted", "manual")


class PilotControls(Protocol):
    """What the controls of every robot have."""

    @property
    def number(self) -> int:
        """Count of the commands."""

    @property
    def mode(self) -> str:
        """What the robot does with the sticks."""

    @property
    def is_armed(self) -> bool:
        """Whether outputs may follow."""

    @property
    def is_stop(self) -> bool:
        """Whether it is an emergency stop."""

    @property
    def clears_stop(self) -> bool:
        """Whether it ends an emergency stop."""


ControlsT = TypeVar("ControlsT", bound=PilotControls)


def read_controls(kind: type[ControlsT], data: Any, modes: Sequence[str], sticks: Iterable[str]) -> ControlsT:
    """Return the controls that a page holds.

    Args:
        kind: struct of the controls.
        data: of the page.
        modes: possible values of `mode`.
        sticks: fields that are -1 to 1.

    Raises:
        CommandError: the page is not valid, or a stick is out of range.
        UnknownNameError: there is no such mode.
    """
    try:
        controls = msgspec.convert(data, ensure_type_info(kind))
    except msgspec.ValidationError as error:
        fix = f"store the fields of {kind.__name__}."
        raise CommandError(f"The page 'controls' is invalid: {error}.", fix=fix) from error
    if controls.mode not in modes:
        raise UnknownNameError(f"There is no mode '{controls.mode}'.", fix=suggest(controls.mode, modes))
    for stick in sticks:
        value = getattr(controls, stick)
        if not -1.0 <= value <= 1.0:  # also NaN
            raise CommandError(f"Stick '{stick}' must be in -1 to 1, not {value!r}.", fix="clamp it.")
    return controls


class NewestControls(Generic[ControlsT]):
    """The newest controls, when they were made, and an emergency stop, which lasts until a person clears it.

    Args:
        neutral: controls that ask for nothing, until there are others.
        restart_s: after a silence of this length any number counts, for a pilot's program that was started again
            begins with 1.
    """

    def __init__(self, neutral: ControlsT, restart_s: float) -> None:
        self.controls: ControlsT = neutral
        self.controls_s: float | None = None
        self.is_stopped: bool = False
        self._restart_s = restart_s

    def take(self, controls: ControlsT, made_s: float) -> bool:
        """Take controls, made at a moment of the robot's clock, and return whether they count.

        A stop counts in any order. Of two others, the one with the higher number is newer.
        """
        self.is_stopped = self.is_stopped or controls.is_stop
        is_overtaken = self.controls_s is not None and controls.number <= self.controls.number
        if is_overtaken and made_s - (self.controls_s or 0.0) <= self._restart_s:
            return False
        self.controls, self.controls_s = controls, made_s
        if controls.clears_stop and not (controls.is_stop or controls.is_armed):
            self.is_stopped = False
        return True

    def age_s(self, now_s: float) -> float | None:
        """Return how old the newest controls are; None if there are none."""
        return None if self.controls_s is None else now_s - self.controls_s


def pilot_of(options: Mapping[str, str]) -> str:
    """Return who commands, "scripted" or "manual", by the options `pilot` and `deadman`.

    Raises:
        UnknownNameError: a value is not one of the possible ones.
        ParameterError: there is a switch for a pilot who has no sticks.
    """
    pilot = options.get("pilot", PILOTS[0])
    if pilot not in PILOTS:
        raise UnknownNameError(f"--option pilot={pilot}: there is no such pilot.", fix=suggest(pilot, PILOTS))
    deadman = options.get("deadman", "no")
    if deadman not in ("yes", "no"):
        raise UnknownNameError(f"--option deadman must be yes or no, not {deadman}.", fix="--option deadman=yes")
    if deadman == "yes" and pilot != "manual":
        raise ParameterError(
            f"--option deadman=yes requires pilot=manual, not pilot={pilot}.",
            fix="add --option pilot=manual, or leave out deadman.",
        )
    return pilot
