"""Execution of a container whose children follow one another: of a flow, and of an iterator."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import NamedTuple, TypeAlias

from snr_sim.behaviors.context import NS_PER_S
from snr_sim.behaviors.flow.state import PREEMPTED, Behavior, Execution
from snr_sim.behaviors.flow.userdata import Scope
from snr_sim.behaviors.flow.waits import Step, Wait
from snr_sim.core.endpoint import Endpoint
from snr_sim.prelude.errors import TaskError


class Child(NamedTuple):
    """A child to execute: its label, the container's names for its keys, and where its outcomes lead in a flow."""

    label: str
    behavior: Behavior
    remapping: Mapping[str, str]
    transitions: Mapping[str, str]


Choose: TypeAlias = Callable[[str, str], "Child | str"]  # by label and outcome: what follows, or the final outcome


class SequentialExecution:
    """One execution of a container of which one child is active.

    Args:
        path: of the container.
        scope: its data.
        owner: the component.
        choose: returns what follows an outcome of a child, or the outcome of the container; first, with two empty
            texts, the first child.
        max_moves: how many children may follow one another without waiting.
        is_noted: whether changes are noted in steps.
    """

    def __init__(
        self, path: str, scope: Scope, owner: Endpoint, choose: Choose, max_moves: int, *, is_noted: bool
    ) -> None:
        self.scope: Scope = scope
        self._path, self._owner, self._choose = path, owner, choose
        self._max_moves, self._is_noted = max_moves, is_noted
        self._label = ""
        self._since_ns = 0
        self._child: Execution | None = None
        self.is_preempted: bool = False

    def begin(self, step: Step) -> str | None:
        """Enter the first child."""
        outcome = self._enter(self._choose("", ""), step)
        return outcome if self._child is None else self._follow(outcome, step)

    def go_to(self, child: Child, step: Step) -> str | None:
        """Leave the active child at once, and enter another one."""
        self.close()
        self._note(child.label, "goto", step)
        return self._follow(self._enter(child, step), step)

    def step(self, step: Step) -> str | None:
        """Continue."""
        assert self._child is not None
        return self._follow(self._child.step(step), step)

    def preempt(self, step: Step) -> str | None:
        """Preempt the active child; no other follows."""
        assert self._child is not None
        if self.is_preempted:
            return None
        self.is_preempted = True
        return self._follow(self._child.preempt(step), step)

    def close(self) -> None:
        """Close the active child."""
        if self._child is not None:
            self._child.close()

    def waits(self) -> list[Wait]:
        """Return what the active child waits for."""
        return [] if self._child is None else self._child.waits()

    def active(self) -> dict[str, str]:
        """Return the active label, and those inside it."""
        inner = {} if self._child is None else self._child.active()
        return {self._path: self._label, **inner}

    def _follow(self, outcome: str | None, step: Step) -> str | None:
        """Follow the outcomes of children until one continues; return that of the container if it has ended."""
        for _ in range(self._max_moves):
            if outcome is None:
                return None
            chosen = PREEMPTED if self.is_preempted else self._choose(self._label, outcome)
            self._note(chosen if isinstance(chosen, str) else chosen.label, outcome, step)
            outcome = self._enter(chosen, step)
            if self._child is None:
                return outcome
        raise TaskError(
            f"'{self._path}' went through {self._max_moves} states without waiting, '{self._label}' among them.",
            fix="let one of them wait: yield wait(0.1).",
        )

    def _enter(self, chosen: Child | str, step: Step) -> str | None:
        """Enter a child; return its outcome if it has ended at once. An outcome ends the container."""
        if isinstance(chosen, str):
            self._child = None
            self.scope.give_back()
            return chosen
        self._label, self._since_ns = chosen.label, step.now_ns
        path = f"{self._path}/{chosen.label}"
        self._child = chosen.behavior.execution(path, self.scope.data, chosen.remapping, self._owner)
        return self._child.begin(replace(step, kind=""))  # what caused the step came before it waits for anything

    def _note(self, target: str, outcome: str, step: Step) -> None:
        if self._is_noted:
            step.moves.append({
                "t_ns": step.now_ns, "machine": self._path, "source": self._label, "target": target,
                "outcome": outcome, "held_s": (step.now_ns - self._since_ns) / NS_PER_S,
            })  # fmt: skip
