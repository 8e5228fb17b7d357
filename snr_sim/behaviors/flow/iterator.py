"""A behavior once for each of several items."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from snr_sim.behaviors.flow.flow import copy_in, copy_out
from snr_sim.behaviors.flow.state import PREEMPTED, Behavior, Execution, FlowOwner
from snr_sim.behaviors.flow.userdata import data_copy, keys_of
from snr_sim.behaviors.flow.waits import Step, Wait
from snr_sim.prelude.errors import ConfigError, TaskError, UnknownNameError, suggest

MAX_TURNS = 10_000  # in one step, without waiting


class Iterator:
    """A behavior, executed once for each item.

    Args:
        outcomes: with which it can end, the exhausted one among them.
        items: what it is executed for, or a function that returns it when the iterator begins.
        key: name of the item in the data of the iterator.
        exhausted: the outcome after the last item.
        input_keys, output_keys: data that it takes from its container, and gives back.
    """

    def __init__(
        self,
        outcomes: tuple[str, ...],
        items: Sequence[Any] | Callable[[], Sequence[Any]],
        key: str,
        exhausted: str,
        *,
        input_keys: tuple[str, ...] = (),
        output_keys: tuple[str, ...] = (),
    ) -> None:
        self.outcomes: tuple[str, ...] = tuple(outcomes)
        self.items: Sequence[Any] | Callable[[], Sequence[Any]] = items
        self.key: str = key
        self.exhausted: str = exhausted
        self.input_keys: tuple[str, ...] = tuple(input_keys)
        self.output_keys: tuple[str, ...] = tuple(output_keys)
        self.label: str = ""
        self.behavior: Behavior | None = None
        self.loops: tuple[str, ...] = ()
        self.breaks: tuple[str, ...] = ()
        self.remapping: dict[str, str] = {}
        if exhausted not in self.outcomes:
            raise UnknownNameError(
                f"The iterator's exhausted={exhausted!r} is not among its outcomes.",
                fix=suggest(exhausted, self.outcomes),
            )

    def set_behavior(
        self,
        label: str,
        behavior: Behavior,
        *,
        loops: tuple[str, ...] = (),
        breaks: tuple[str, ...] = (),
        remapping: Mapping[str, str] | None = None,
    ) -> None:
        """Set what is executed.

        Args:
            label: of it.
            behavior: a state or a container.
            loops: outcomes after which the next item follows; all that the iterator does not have, if not given.
            breaks: outcomes with which the iterator ends; one that is in both ends it.
            remapping: the iterator's name for a key of the behavior, where it is another one.
        """
        for outcome in (*loops, *breaks):
            if outcome not in behavior.outcomes:
                raise UnknownNameError(
                    f"'{label}' has no outcome '{outcome}'.", fix=suggest(outcome, behavior.outcomes)
                )
        self.label, self.behavior = label, behavior
        self.loops, self.breaks, self.remapping = tuple(loops), tuple(breaks), dict(remapping or {})

    def does_loop(self, outcome: str) -> bool:
        """Return whether the next item follows an outcome."""
        if outcome in self.breaks:
            return False
        return outcome in self.loops or outcome not in self.outcomes

    def check(self, path: str) -> None:
        """Check that it has a behavior, and what is inside it."""
        if self.behavior is None:
            raise ConfigError(f"Iterator '{path}' has no behavior.", fix='iterator.set_behavior("GRAB", Grab()).')
        for outcome in self.breaks:
            if outcome not in self.outcomes:
                raise UnknownNameError(
                    f"Iterator '{path}' breaks with '{outcome}', which is not one of its outcomes.",
                    fix=suggest(outcome, self.outcomes),
                )
        self.behavior.check(f"{path}/{self.label}")

    def execution(
        self, path: str, data: dict[str, Any], remapping: Mapping[str, str], owner: FlowOwner
    ) -> IteratorExecution:
        """Return one execution."""
        return IteratorExecution(self, path, data, remapping, owner)


class IteratorExecution:
    """One execution of an iterator."""

    def __init__(
        self, iterator: Iterator, path: str, outer: dict[str, Any], remapping: Mapping[str, str], owner: FlowOwner
    ) -> None:
        self._iterator, self._path, self._owner = iterator, path, owner
        self._outer, self._outputs = outer, keys_of(iterator.output_keys, remapping)
        self._data = copy_in(path, outer, keys_of(iterator.input_keys, remapping))
        self._left: list[Any] = []
        self._child: Execution | None = None
        self._is_preempted = False

    def begin(self, step: Step) -> str | None:
        """Begin with the first item."""
        items = self._iterator.items
        self._left = list(data_copy(f"The items of '{self._path}'", list(items() if callable(items) else items)))
        return self._follow("", step)

    def step(self, step: Step) -> str | None:
        """Continue."""
        assert self._child is not None
        return self._follow(self._child.step(step), step)

    def preempt(self, step: Step) -> str | None:
        """Preempt what is executed; no other item follows."""
        assert self._child is not None
        if self._is_preempted:
            return None
        self._is_preempted = True
        return self._follow(self._child.preempt(step), step)

    def close(self) -> None:
        """Close what is executed."""
        if self._child is not None:
            self._child.close()

    def waits(self) -> list[Wait]:
        """Return what is waited for."""
        return [] if self._child is None else self._child.waits()

    def active(self) -> dict[str, str]:
        """Return the label of the behavior, and those inside it."""
        inner = {} if self._child is None else self._child.active()
        return {self._path: self._iterator.label, **inner}

    def _follow(self, outcome: str | None, step: Step) -> str | None:
        """Begin the next item as long as the behavior ends at once; return the outcome if the iterator has ended."""
        iterator = self._iterator
        for _ in range(MAX_TURNS):
            if outcome is None:
                return None
            if self._is_preempted:
                return self._end(PREEMPTED)
            if self._child is not None and not iterator.does_loop(outcome):
                return self._end(outcome)
            if not self._left:
                return self._end(iterator.exhausted)
            self._data[iterator.key] = self._left.pop(0)
            assert iterator.behavior is not None
            path = f"{self._path}/{iterator.label}"
            self._child = iterator.behavior.execution(path, self._data, iterator.remapping, self._owner)
            outcome = self._child.begin(replace(step, kind=""))
        raise TaskError(
            f"Iterator '{self._path}' went through {MAX_TURNS} items without waiting.",
            fix="let the behavior wait: yield wait(0.1).",
        )

    def _end(self, outcome: str) -> str:
        self._child = None
        copy_out(self._data, self._outer, self._outputs)
        return outcome
