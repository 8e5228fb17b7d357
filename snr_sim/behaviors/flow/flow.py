"""A flow: states one after the other, by their outcomes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass, field
from typing import Any

from snr_sim.behaviors.flow.sequential import Child, SequentialExecution
from snr_sim.behaviors.flow.state import PREEMPTED, Behavior, check_outcomes
from snr_sim.behaviors.flow.userdata import Scope, check_known
from snr_sim.core.endpoint import Endpoint
from snr_sim.prelude.errors import ConfigError

MAX_MOVES = 100  # of one flow in one step


@dataclass(eq=False)
class Flow:
    """States one after the other. The state that was added first is the initial one.

    Args:
        name: of the flow.
        outcomes: with which it can end; "preempted" is always possible.
        input_keys, output_keys: data that it takes from its container, and gives back.
        connector: an outcome that leads to the state added next, if `transitions` has no other: a sequence.
    """

    name: str
    outcomes: tuple[str, ...]
    _: KW_ONLY
    input_keys: tuple[str, ...] = ()
    output_keys: tuple[str, ...] = ()
    connector: str = ""
    initial: str = field(default="", init=False)
    entries: dict[str, Child] = field(default_factory=dict, init=False)

    def __post_init__(self) -> None:
        check_outcomes(self.outcomes, f"Flow '{self.name}'")

    def add(
        self,
        label: str,
        behavior: Behavior,
        transitions: Mapping[str, str] | None = None,
        remapping: Mapping[str, str] | None = None,
    ) -> None:
        """Add a state or a container.

        Args:
            label: of it, unique in the flow.
            behavior: a State, a Flow, a Concurrence or an Iterator.
            transitions: where each outcome leads: to a label, or to an outcome of the flow. An outcome that is not
                listed leads to the outcome of the flow with the same name.
            remapping: the flow's name for a key of the state, where it is another one.

        Raises:
            ConfigError: the label is in use, or an outcome or key is unknown.
        """
        if label in self.entries or label in self.outcomes:
            raise ConfigError(f"Flow '{self.name}' has '{label}' twice.", fix="give every state a label of its own.")
        if isinstance(behavior, type):
            raise ConfigError(
                f"'{label}' of flow '{self.name}' is the class.", fix=f"{behavior.__name__}(), with brackets."
            )
        known = (*behavior.outcomes, PREEMPTED)
        for outcome in transitions or {}:
            check_known(outcome, known, f"'{label}' of flow '{self.name}' has no outcome '{outcome}'.")
        keys = sorted({*behavior.input_keys, *behavior.output_keys})
        for key in remapping or {}:
            check_known(key, keys, f"'{label}' of flow '{self.name}' has no key '{key}' to remap.")
        self.initial = self.initial or label
        self.entries[label] = Child(label, behavior, dict(remapping or {}), dict(transitions or {}))

    def set_initial(self, label: str) -> None:
        """Begin with another state than the one that was added first."""
        check_known(label, self.entries, f"Flow '{self.name}' has no state '{label}'.")
        self.initial = label

    def target(self, label: str, outcome: str) -> str:
        """Return where an outcome of a state leads: a label, or an outcome of the flow."""
        given = self.entries[label].transitions.get(outcome)
        if given is not None:
            return given
        if outcome == self.connector:
            labels = list(self.entries)
            after = labels.index(label) + 1
            if after < len(labels):
                return labels[after]
        return outcome

    def check(self, path: str) -> None:
        """Check that every outcome leads somewhere and every state can be reached.

        Raises:
            ConfigError: it has no states, an outcome leads nowhere, or a state cannot be reached.
        """
        if not self.entries:
            raise ConfigError(f"Flow '{path}' has no states.", fix='flow.add("FIRST", First(), {...}).')
        ends = (*self.outcomes, PREEMPTED)
        reached, new = {self.initial}, [self.initial]
        while new:
            label = new.pop()
            for outcome in self.entries[label].behavior.outcomes:
                target = self.target(label, outcome)
                if target in self.entries and target not in reached:
                    reached.add(target)
                    new.append(target)
        for label, entry in self.entries.items():
            for outcome in (*entry.behavior.outcomes, *entry.transitions):
                target = self.target(label, outcome)
                if target not in ends:
                    message = f"Outcome '{outcome}' of '{path}/{label}' leads to '{target}', which is neither a state"
                    check_known(target, self.entries, f"{message} nor an outcome of the flow.")
            if label not in reached:
                raise ConfigError(f"No outcome leads to '{path}/{label}'.", fix="leave it out, or let one lead there.")
            entry.behavior.check(f"{path}/{label}")

    def children(self) -> dict[str, Behavior]:
        """Return its states and containers by label."""
        return {label: entry.behavior for label, entry in self.entries.items()}

    def execution(
        self, path: str, data: dict[str, Any], remapping: Mapping[str, str], owner: Endpoint
    ) -> SequentialExecution:
        """Return one execution."""

        def choose(label: str, outcome: str) -> Child | str:
            target = self.target(label, outcome) if label else self.initial
            return self.entries.get(target, target)

        scope = Scope(path, data, self.input_keys, self.output_keys, remapping)
        return SequentialExecution(path, scope, owner, choose, MAX_MOVES, is_noted=True)
