"""Several behaviors side by side."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field
from typing import Any, TypeAlias

from snr_sim.behaviors.flow.state import PREEMPTED, Behavior, Execution
from snr_sim.behaviors.flow.userdata import Scope, check_known
from snr_sim.behaviors.flow.waits import Step, Wait
from snr_sim.core.endpoint import Endpoint
from snr_sim.prelude.errors import ConfigError

Outcomes: TypeAlias = dict[str, str | None]  # of the children by label; None: it continues


@dataclass(eq=False)
class Concurrence:
    """Behaviors that are executed side by side, stepped in the order in which they were added.

    Args:
        outcomes: with which it can end; "preempted" is always possible.
        default: the outcome if no other rule applies.
        outcome_map: which outcomes of children make an outcome: {"found": {"LEFT": "seen", "RIGHT": "seen"}}. Of
            several that apply, the one with most criteria.
        outcome_function: called first, with the outcomes of all children; None: the map decides.
        ends_when: called when a child has ended, with the outcomes so far; if it returns true, the others are
            preempted.
        input_keys, output_keys: data that it takes from its container, and gives back.
    """

    outcomes: tuple[str, ...]
    default: str
    outcome_map: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    _: KW_ONLY
    outcome_function: Callable[[Outcomes], str | None] | None = None
    ends_when: Callable[[Outcomes], bool] | None = None
    input_keys: tuple[str, ...] = ()
    output_keys: tuple[str, ...] = ()
    entries: dict[str, tuple[Behavior, Mapping[str, str]]] = field(default_factory=dict, init=False)

    def __post_init__(self) -> None:
        for name in (self.default, *self.outcome_map):
            check_known(name, self.outcomes, f"A concurrence has no outcome '{name}'.")

    def add(self, label: str, behavior: Behavior, remapping: Mapping[str, str] | None = None) -> None:
        """Add a state or a container.

        Args:
            label: of it, unique here.
            behavior: a State, a Flow, a Concurrence or an Iterator.
            remapping: the concurrence's name for a key of the behavior, where it is another one.
        """
        if label in self.entries:
            raise ConfigError(f"A concurrence has '{label}' twice.", fix="give every child a label of its own.")
        self.entries[label] = behavior, dict(remapping or {})

    def check(self, path: str) -> None:
        """Check that there are children, and that the map names theirs.

        Raises:
            ConfigError: there are none; the map names an unknown child or outcome; two rules have the same criteria.
        """
        if not self.entries:
            raise ConfigError(f"Concurrence '{path}' has no children.", fix='concurrence.add("LOOK", Look()).')
        seen: dict[frozenset[tuple[str, str]], str] = {}
        for name, rule in self.outcome_map.items():
            for label, outcome in rule.items():
                check_known(label, self.entries, f"The outcome map of '{path}' names '{label}'.")
                known = (*self.entries[label][0].outcomes, PREEMPTED)
                check_known(outcome, known, f"The outcome map of '{path}' waits for '{outcome}' of '{label}'.")
            other = seen.setdefault(frozenset(rule.items()), name)
            if other != name:
                raise ConfigError(
                    f"The outcome map of '{path}' has the same criteria for '{other}' and '{name}'.",
                    fix="let one of them ask for more.",
                )
        for label, (behavior, _) in self.entries.items():
            behavior.check(f"{path}/{label}")

    def result(self, found: Outcomes, path: str) -> str:
        """Return the outcome for those of the children.

        Raises:
            UnknownNameError: `outcome_function` returned another one.
        """
        if self.outcome_function is not None:
            given = self.outcome_function(dict(found))
            if given is not None:
                check_known(given, self.outcomes, f"outcome_function of '{path}' returned '{given}'.")
                return given
        fitting = [
            (len(rule), name)
            for name, rule in self.outcome_map.items()
            if all(found[label] == outcome for label, outcome in rule.items())
        ]
        return max(fitting, key=lambda row: row[0])[1] if fitting else self.default

    def children(self) -> dict[str, Behavior]:
        """Return its states and containers by label."""
        return {label: behavior for label, (behavior, _) in self.entries.items()}

    def execution(
        self, path: str, data: dict[str, Any], remapping: Mapping[str, str], owner: Endpoint
    ) -> ConcurrenceExecution:
        """Return one execution."""
        scope = Scope(path, data, self.input_keys, self.output_keys, remapping)
        return ConcurrenceExecution(self, path, scope, owner)


class ConcurrenceExecution:
    """One execution of a concurrence."""

    def __init__(self, concurrence: Concurrence, path: str, scope: Scope, owner: Endpoint) -> None:
        self._concurrence, self._path, self._scope = concurrence, path, scope
        self._running: dict[str, Execution] = {
            label: behavior.execution(f"{path}/{label}", scope.data, own, owner)
            for label, (behavior, own) in concurrence.entries.items()
        }
        self._found: Outcomes = dict.fromkeys(concurrence.entries)
        self._is_preempted = False  # from outside
        self._is_ending = False

    def begin(self, step: Step) -> str | None:
        """Begin all children."""
        return self._each(list(self._running), "begin", step)

    def step(self, step: Step) -> str | None:
        """Continue those that have not ended."""
        return self._each(list(self._running), "step", step)

    def preempt(self, step: Step) -> str | None:
        """Preempt all that have not ended."""
        if self._is_preempted:
            return None
        self._is_preempted = self._is_ending = True
        return self._each(list(self._running), "preempt", step)

    def close(self) -> None:
        """Close all that have not ended."""
        for child in self._running.values():
            child.close()

    def waits(self) -> list[Wait]:
        """Return what all of them wait for."""
        return [wait for child in self._running.values() for wait in child.waits()]

    def active(self) -> dict[str, str]:
        """Return the labels of those that have not ended, and what is inside them."""
        found = {self._path: " ".join(self._running)}
        for child in self._running.values():
            found |= child.active()
        return found

    def _each(self, labels: Sequence[str], action: str, step: Step) -> str | None:
        """Do something to children, end them all if one of them decides it; return the outcome once all have ended."""
        begun: set[str] = set()
        for label in labels:
            begun.add(label)
            outcome = getattr(self._running[label], action)(step)
            if outcome is None:
                continue
            self._found[label] = outcome
            del self._running[label]
            ends = self._concurrence.ends_when
            if not self._is_ending and ends is not None and ends(dict(self._found)):
                self._is_ending = True
                if action == "begin":  # those after it have not begun, and do not begin any more
                    for other in labels[len(begun) :]:
                        self._found[other] = PREEMPTED
                        del self._running[other]
                return self._each(list(self._running), "preempt", step)
        if self._running:
            return None
        self._scope.give_back()
        return PREEMPTED if self._is_preempted else self._concurrence.result(self._found, self._path)
