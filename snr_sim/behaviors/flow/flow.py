"""A flow: states one after the other, by their outcomes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from snr_sim.behaviors.flow.state import NS_PER_S, PREEMPTED, Behavior, Execution, FlowOwner
from snr_sim.behaviors.flow.userdata import data_copy, keys_of
from snr_sim.behaviors.flow.waits import Step, Wait
from snr_sim.prelude.errors import ConfigError, TaskError, UnknownNameError, suggest

MAX_MOVES = 100  # of one flow in one step


@dataclass(frozen=True)
class Entry:
    """A state in a flow: its label, where its outcomes lead, and the flow's names for its keys."""

    label: str
    behavior: Behavior
    transitions: Mapping[str, str]
    remapping: Mapping[str, str]


class Flow:
    """States one after the other. The state that was added first is the initial one.

    Args:
        name: of the flow.
        outcomes: with which it can end; "preempted" is always possible.
        input_keys, output_keys: data that it takes from its container, and gives back.
        connector: an outcome that leads to the state added next, if `transitions` has no other: a sequence.
    """

    def __init__(
        self,
        name: str,
        outcomes: tuple[str, ...],
        *,
        input_keys: tuple[str, ...] = (),
        output_keys: tuple[str, ...] = (),
        connector: str = "",
    ) -> None:
        if not isinstance(outcomes, tuple) or not outcomes:
            raise ConfigError(
                f"Flow '{name}' has the outcomes {outcomes!r}.", fix='outcomes=("done",), with the comma.'
            )
        self.name: str = name
        self.outcomes: tuple[str, ...] = tuple(outcomes)
        self.input_keys: tuple[str, ...] = tuple(input_keys)
        self.output_keys: tuple[str, ...] = tuple(output_keys)
        self.connector: str = connector
        self.initial: str = ""
        self.entries: dict[str, Entry] = {}

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
        known = {*behavior.outcomes, PREEMPTED}
        for outcome in transitions or {}:
            if outcome not in known:
                raise UnknownNameError(
                    f"'{label}' of flow '{self.name}' has no outcome '{outcome}'.", fix=suggest(outcome, sorted(known))
                )
        for key in remapping or {}:
            if key not in (*behavior.input_keys, *behavior.output_keys):
                keys = sorted({*behavior.input_keys, *behavior.output_keys})
                raise UnknownNameError(
                    f"'{label}' of flow '{self.name}' has no key '{key}' to remap.", fix=suggest(key, keys)
                )
        self.initial = self.initial or label
        self.entries[label] = Entry(label, behavior, dict(transitions or {}), dict(remapping or {}))

    def set_initial(self, label: str) -> None:
        """Begin with another state than the one that was added first."""
        if label not in self.entries:
            raise UnknownNameError(f"Flow '{self.name}' has no state '{label}'.", fix=suggest(label, self.entries))
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
                if target not in self.entries and target not in ends:
                    raise UnknownNameError(
                        f"Outcome '{outcome}' of '{path}/{label}' leads to '{target}', which is neither a state nor an "
                        "outcome of the flow.",
                        fix=suggest(target, [*self.entries, *self.outcomes]),
                    )
            if label not in reached:
                raise ConfigError(f"No outcome leads to '{path}/{label}'.", fix="leave it out, or let one lead there.")
            entry.behavior.check(f"{path}/{label}")

    def execution(
        self, path: str, data: dict[str, Any], remapping: Mapping[str, str], owner: FlowOwner
    ) -> FlowExecution:
        """Return one execution."""
        return FlowExecution(self, path, data, remapping, owner)


class FlowExecution:
    """One execution of a flow."""

    def __init__(
        self, flow: Flow, path: str, outer: dict[str, Any], remapping: Mapping[str, str], owner: FlowOwner
    ) -> None:
        self._flow, self._path, self._owner = flow, path, owner
        self._outer, self._outputs = outer, keys_of(flow.output_keys, remapping)
        self.data: dict[str, Any] = copy_in(path, outer, keys_of(flow.input_keys, remapping))
        self._label = ""
        self._since_ns = 0
        self._child: Execution | None = None
        self._is_preempted = False

    def begin(self, step: Step) -> str | None:
        """Enter the initial state."""
        return self._follow(self._enter(self._flow.initial, step), step)

    def go_to(self, label: str, step: Step) -> str | None:
        """Leave the active state at once, and enter another one."""
        self.close()
        self._note(label, "goto", step)
        return self._follow(self._enter(label, step), step)

    def step(self, step: Step) -> str | None:
        """Continue."""
        assert self._child is not None
        return self._follow(self._child.step(step), step)

    def preempt(self, step: Step) -> str | None:
        """Preempt the active state; no other follows."""
        assert self._child is not None
        if self._is_preempted:
            return None
        self._is_preempted = True
        return self._follow(self._child.preempt(step), step)

    def close(self) -> None:
        """Close the active state."""
        if self._child is not None:
            self._child.close()

    def waits(self) -> list[Wait]:
        """Return what the active state waits for."""
        return [] if self._child is None else self._child.waits()

    def active(self) -> dict[str, str]:
        """Return the active label, and those inside it."""
        inner = {} if self._child is None else self._child.active()
        return {self._path: self._label, **inner}

    def _enter(self, label: str, step: Step) -> str | None:
        entry = self._flow.entries[label]
        self._label, self._since_ns = label, step.now_ns
        self._child = entry.behavior.execution(f"{self._path}/{label}", self.data, entry.remapping, self._owner)
        return self._child.begin(replace(step, kind=""))  # what caused the step came before it waits for anything

    def _follow(self, outcome: str | None, step: Step) -> str | None:
        """Follow the outcomes of states until one continues; return the outcome of the flow if it has ended."""
        for _ in range(MAX_MOVES):
            if outcome is None:
                return None
            target = PREEMPTED if self._is_preempted else self._flow.target(self._label, outcome)
            self._note(target, outcome, step)
            if target not in self._flow.entries:
                self._child = None
                copy_out(self.data, self._outer, self._outputs)
                return target
            outcome = self._enter(target, step)
        raise TaskError(
            f"Flow '{self._path}' went through {MAX_MOVES} states without waiting, '{self._label}' among them.",
            fix="let one of them wait: yield wait(0.1).",
        )

    def _note(self, target: str, outcome: str, step: Step) -> None:
        step.moves.append({
            "t_ns": step.now_ns, "machine": self._path, "source": self._label, "target": target, "outcome": outcome,
            "held_s": (step.now_ns - self._since_ns) / NS_PER_S,
        })  # fmt: skip


def copy_in(path: str, outer: Mapping[str, Any], inputs: Mapping[str, str]) -> dict[str, Any]:
    """Return the data with which a container begins: copies of what its own container has."""
    return {
        name: data_copy(f"'{name}' of '{path}'", outer[theirs]) for name, theirs in inputs.items() if theirs in outer
    }


def copy_out(data: Mapping[str, Any], outer: dict[str, Any], outputs: Mapping[str, str]) -> None:
    """Give back what a container has made."""
    outer.update({theirs: data[name] for name, theirs in outputs.items() if name in data})
