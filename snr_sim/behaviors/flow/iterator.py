"""A behavior once for each of several items."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from snr_sim.behaviors.flow.sequential import Child, SequentialExecution
from snr_sim.behaviors.flow.state import Behavior
from snr_sim.behaviors.flow.userdata import Scope, data_copy
from snr_sim.core.endpoint import Endpoint
from snr_sim.prelude.errors import ConfigError, UnknownNameError, suggest

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
        self, path: str, data: dict[str, Any], remapping: Mapping[str, str], owner: Endpoint
    ) -> SequentialExecution:
        """Return one execution."""
        behavior = self.behavior
        assert behavior is not None
        scope = Scope(path, data, self.input_keys, self.output_keys, remapping)
        left: list[Any] = []

        def choose(label: str, outcome: str) -> Child | str:
            if not label:
                items = self.items
                left.extend(data_copy(f"The items of '{path}'", list(items() if callable(items) else items)))
            elif not self.does_loop(outcome):
                return outcome
            if not left:
                return self.exhausted
            scope.data[self.key] = left.pop(0)
            return Child(self.label, behavior, self.remapping)

        return SequentialExecution(path, scope, owner, choose, MAX_TURNS, is_noted=False)
