"""A behavior once for each of several items."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field
from typing import Any

from snr_sim.behaviors.flow.sequential import Child, SequentialExecution
from snr_sim.behaviors.flow.state import Behavior
from snr_sim.behaviors.flow.userdata import Scope, check_known, data_copy
from snr_sim.core.endpoint import Endpoint
from snr_sim.prelude.errors import ConfigError

MAX_TURNS = 10_000  # in one step, without waiting


@dataclass(eq=False)
class Iterator:
    """A behavior, executed once for each item.

    Args:
        outcomes: with which it can end, the exhausted one among them.
        items: what it is executed for, or a function that returns it when the iterator begins.
        key: name of the item in the data of the iterator.
        exhausted: the outcome after the last item.
        input_keys, output_keys: data that it takes from its container, and gives back.
    """

    outcomes: tuple[str, ...]
    items: Sequence[Any] | Callable[[], Sequence[Any]]
    key: str
    exhausted: str
    _: KW_ONLY
    input_keys: tuple[str, ...] = ()
    output_keys: tuple[str, ...] = ()
    child: Child | None = field(default=None, init=False)
    loops: tuple[str, ...] = field(default=(), init=False)
    breaks: tuple[str, ...] = field(default=(), init=False)

    def __post_init__(self) -> None:
        message = f"The iterator's exhausted={self.exhausted!r} is not among its outcomes."
        check_known(self.exhausted, self.outcomes, message)

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
            check_known(outcome, behavior.outcomes, f"'{label}' has no outcome '{outcome}'.")
        self.child, self.loops, self.breaks = Child(label, behavior, dict(remapping or {}), {}), loops, breaks

    def does_loop(self, outcome: str) -> bool:
        """Return whether the next item follows an outcome."""
        if outcome in self.breaks:
            return False
        return outcome in self.loops or outcome not in self.outcomes

    def check(self, path: str) -> None:
        """Check that it has a behavior, and what is inside it."""
        if self.child is None:
            raise ConfigError(f"Iterator '{path}' has no behavior.", fix='iterator.set_behavior("GRAB", Grab()).')
        for outcome in self.breaks:
            message = f"Iterator '{path}' breaks with '{outcome}', which is not one of its outcomes."
            check_known(outcome, self.outcomes, message)
        self.child.behavior.check(f"{path}/{self.child.label}")

    def children(self) -> dict[str, Behavior]:
        """Return its behavior by its label."""
        return {} if self.child is None else {self.child.label: self.child.behavior}

    def execution(
        self, path: str, data: dict[str, Any], remapping: Mapping[str, str], owner: Endpoint
    ) -> SequentialExecution:
        """Return one execution."""
        child = self.child
        assert child is not None
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
            return child

        return SequentialExecution(path, scope, owner, choose, MAX_TURNS, is_noted=False)
