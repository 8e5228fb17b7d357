"""Failsafe actions of the vehicle, agreed before the dive: `Failsafes` has one row for each cause.

    action       what the vehicle does
    warn         reports it, and nothing else
    neutral      nothing pushes until a person has disarmed and armed
    Rearm(N)     nothing pushes; if the cause is over within N seconds it resumes by itself, once; else as neutral
    hold         depth and heading, for `hold_s`; then it goes up. Controls apply again when the cause is over
    surface      goes up

Of several causes, `surface` counts first, then `neutral`, then `hold`. While outputs do not answer nothing can push:
their `hold` and `surface` begin when they are back, for which the vehicle re-arms them, until a person has disarmed.
`lost_s`, `hold_s`, `low_s` are in `FailsafeLimits` (failsafe_monitor.py).
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Annotated

from snr_sim.errors import ParameterError, suggest
from snr_sim.plants import IS_ABOVE, Limit, check_number, check_record, format_value

ACTIONS = ("warn", "neutral", "hold", "surface")
OUTPUTS = ("line_lost", "controller_reset")  # the outputs have disarmed themselves
LASTING = ("low_battery", "leak")  # until the next start
MILLISECONDS = {"milliseconds": 1e-3}
WITHIN = Limit(0.0, 600.0, "s", "5 is usual; a later start of the thrusters is unexpected", MILLISECONDS, IS_ABOVE)
NO_REARM = Limit(0.0, 3600.0, "s", "10 is usual: as long as a person needs", MILLISECONDS)


@dataclass(frozen=True)
class Rearm:
    """Action: resume without a person, once until a person disarms, if the cause is over soon enough."""

    within_s: float  # since it began, with all that arming takes: a microcontroller that was reset needs 1.5 s

    def __post_init__(self) -> None:
        check_number("A failsafe's Rearm", self.within_s, WITHIN)


@dataclass(frozen=True)
class Failsafes:
    """The table: for each cause, one of ACTIONS or `Rearm`. The comment says when the cause is there.

    Raises:
        ParameterError: there is no such action, or a cause cannot have it.
    """

    link_lost: str | Rearm = "hold"  # no controls that count have come for `lost_s`
    line_lost: str | Rearm = "neutral"  # the outputs have disarmed by themselves, or do not answer
    controller_reset: str | Rearm = "neutral"  # the outputs' microcontroller has restarted
    stale_sensor: str | Rearm = "warn"  # a sensor that has been read has had no reading for a while
    nonsense: str | Rearm = "hold"  # a sensor's page has wrong types, NaN or implausible values
    low_battery: str | Rearm = "surface"  # it was low for `low_s`; until the next start
    leak: str | Rearm = "surface"  # a probe is wet; until the next start
    disk_full: str | Rearm = "warn"  # nothing more is recorded: page `recording` reports it
    overloaded: str | Rearm = "warn"  # readings wait for more than 0.1 s until they are answered
    no_rearm: str | Rearm = "neutral"  # disarmed outputs, and no person has re-armed them for `no_rearm_s`
    no_rearm_s: Annotated[float, NO_REARM] = 10.0

    def __post_init__(self) -> None:
        check_record(self, "The failsafes' ")
        for cause in CAUSES:
            self._check(cause, self.of(cause))

    def of(self, cause: str) -> str | Rearm:
        """Return the action for one of CAUSES."""
        action: str | Rearm = getattr(self, cause)
        return action

    def _check(self, cause: str, action: str | Rearm) -> None:
        if not isinstance(action, Rearm) and action not in ACTIONS:
            raise ParameterError(
                f"The failsafe {cause} is {format_value(action)}.",
                fix=f"{suggest(str(action), ACTIONS)} Or Rearm(5.0).",
            )
        if action == "warn" and cause in (*OUTPUTS, "no_rearm"):
            raise ParameterError(
                f"The failsafe {cause} is 'warn', but disarmed outputs do not push, warned or not.",
                fix=f'{cause}="neutral", or Rearm(5.0) to continue without a person.',
            )
        if isinstance(action, Rearm) and cause in (*LASTING, "no_rearm"):
            reason = "it starts when re-arming is late" if cause == "no_rearm" else "it lasts until the next start"
            raise ParameterError(
                f"The failsafe {cause} is {action}, which never takes effect: {reason}.",
                fix=f'{cause}="surface", or line_lost=Rearm(5.0) for outputs that come back.',
            )

    def lines(self, hold_s: float) -> list[str]:
        """Return the table in few lines of text, one for each action; `hold` holds for `hold_s`."""
        causes: dict[str, list[str]] = {}
        for cause in CAUSES:
            causes.setdefault(describe_action(self.of(cause), hold_s), []).append(cause)
        return [f"{action}: {', '.join(names)}" for action, names in causes.items()]


CAUSES = tuple(field.name for field in fields(Failsafes) if field.name != "no_rearm_s")


def describe_action(action: str | Rearm, hold_s: float) -> str:
    """Return an action as the display shows it.

    >>> describe_action(Rearm(5.0), 10.0), describe_action("hold", 10.0)
    ('neutral, resumes once within 5 s', 'hold for 10 s, then surface')
    """
    if not isinstance(action, str):
        return f"neutral, resumes once within {action.within_s:g} s"
    words = {"neutral": "neutral until re-armed", "hold": f"hold for {hold_s:g} s, then surface", "warn": "warn only"}
    return words.get(action, action)
