"""A state without work: it ends with the first of several events."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from snr_sim.behaviors.flow.state import PREEMPTED, Execution, State, check_outcomes
from snr_sim.behaviors.flow.waits import Step, Wait, event
from snr_sim.core.endpoint import Endpoint


class EventState(State):
    """A state that waits for events, and ends with the first one: its outcomes are their names.

        flow.add("searching", EventState("FOUND"), {"FOUND": "approaching"})

    A flow of these alone may also be a reference machine: see `ReferenceFactory`.

    Args:
        events: their names.
    """

    def __init__(self, *events: str) -> None:
        check_outcomes(events, "EventState")
        self.outcomes: tuple[str, ...] = events

    def check(self, path: str) -> None:
        """Do nothing: it has no `run`."""

    def execution(self, path: str, data: dict[str, Any], remapping: Mapping[str, str], owner: Endpoint) -> Execution:
        """Return itself: it keeps nothing."""
        return self

    def begin(self, step: Step) -> str | None:
        """Wait."""

    def step(self, step: Step) -> str | None:
        """End with an event that is one of its own."""
        return step.name if step.kind == "event" and step.name in self.outcomes else None

    def preempt(self, step: Step) -> str | None:
        """End at once."""
        return PREEMPTED

    def close(self) -> None:
        """Do nothing."""

    def waits(self) -> list[Wait]:
        """Return what it waits for."""
        return [event(name) for name in self.outcomes]

    def active(self) -> dict[str, str]:
        """Return nothing: its container names it."""
        return {}
