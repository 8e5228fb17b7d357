"""A state of a flow: a function that may wait, and ends with an outcome."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Mapping
from types import GeneratorType
from typing import TYPE_CHECKING, Any, Protocol

from snr_sim.behaviors.context import NS_PER_S
from snr_sim.behaviors.flow.userdata import Userdata, keys_of
from snr_sim.behaviors.flow.waits import Preempted, Step, Wait
from snr_sim.core.endpoint import Endpoint
from snr_sim.core.handlers import as_tasks
from snr_sim.core.source_location import after_line, location_in, location_of
from snr_sim.prelude.errors import ConfigError, TaskError, UnknownNameError, suggest
from snr_sim.prelude.task import DataKey, Task

if TYPE_CHECKING:
    import numpy as np

PREEMPTED = "preempted"  # the outcome of what was preempted
MAX_YIELDS = 10_000  # without a wait: then it is a loop without end


def check_outcomes(outcomes: object, who: str) -> None:
    """Check that outcomes are a tuple: of a text the letters would be taken.

    Raises:
        ConfigError: they are not, or there are none.
    """
    if not isinstance(outcomes, tuple) or not outcomes:
        raise ConfigError(f"{who} has the outcomes {outcomes!r}.", fix='outcomes=("done",), with the comma.')


class Behavior(Protocol):
    """A state, or a container of states."""

    outcomes: tuple[str, ...]
    input_keys: tuple[str, ...]
    output_keys: tuple[str, ...]

    def check(self, path: str) -> None:
        """Check what is inside.

        Raises:
            ConfigError: it cannot run; the message names the place.
        """

    def children(self) -> Mapping[str, Behavior]:
        """Return what is inside, by label."""

    def execution(self, path: str, data: dict[str, Any], remapping: Mapping[str, str], owner: Endpoint) -> Execution:
        """Return one execution that works on the data of its container."""


def walk(path: str, behavior: Behavior) -> Iterator[tuple[str, Behavior]]:
    """Yield a behavior and all that are inside it, with their paths."""
    yield path, behavior
    for label, child in behavior.children().items():
        yield from walk(f"{path}/{label}", child)


class Execution(Protocol):
    """One execution of a state or a container; each call returns its outcome, or None while it continues."""

    def begin(self, step: Step) -> str | None:
        """Begin."""

    def step(self, step: Step) -> str | None:
        """Continue with what a step brings."""

    def preempt(self, step: Step) -> str | None:
        """End within the deadline; a second call changes nothing."""

    def close(self) -> None:
        """End at once."""

    def waits(self) -> list[Wait]:
        """Return what it waits for."""

    def active(self) -> dict[str, str]:
        """Return the active label of each container, by path, outermost first."""


class State:
    """Base of states. Its author writes `run` and declares what it uses.

        class Grab(State):
            outcomes, input_keys, output_keys = ("held", "missed"), ("target",), ("grip_n",)

            def run(self, userdata):
                yield self.store_data_task("gripper", {"closing": True})
                reading = yield page("grip", timeout_s=2.0)
                if reading is None:
                    return "missed"
                userdata.grip_n = reading["force_n"]
                return "held"

    A node has its own copy of each state, which keeps its attributes from one execution to the next.
    """

    outcomes: tuple[str, ...] = ("done",)
    input_keys: tuple[str, ...] = ()
    output_keys: tuple[str, ...] = ()

    _owner: Endpoint | None = None

    def run(self, userdata: Userdata) -> Generator[Any, Any, str] | str:
        """Do the work: yield tasks to send, and waits; return an outcome. Without `yield`, it ends at once."""
        raise NotImplementedError(f"{type(self).__name__} has no run().")

    @property
    def owner(self) -> Endpoint:
        """The component that runs the flow.

        Raises:
            ConfigError: it is not in a node.
        """
        if self._owner is None:
            raise ConfigError(f"{type(self).__name__} is not in a node yet.", fix="use pages and time in run() only.")
        return self._owner

    def store_data_task(self, key: DataKey, data: Any, process: bool = True) -> Task:
        """Return the task that stores data under a key."""
        return self.owner.store_data_task(key, data, process)

    def get_data(self, key: DataKey) -> Any:
        """Return the data of the newest page of a key, or None."""
        return self.owner.get_data(key)

    def get_age_s(self, key: DataKey) -> float:
        """Return the age of that page [s]; infinite without one."""
        return self.owner.get_age_s(key)

    def get_time_s(self) -> float:
        """Return the node's time [s]."""
        return self.owner.get_time_s()

    @property
    def rng(self) -> np.random.Generator:
        """The flow's random numbers."""
        return self.owner.rng

    def check(self, path: str) -> None:
        """Check that it declares outcomes and has a `run`."""
        check_outcomes(self.outcomes, f"'{path}'")
        if type(self).run is State.run:
            raise ConfigError(f"{type(self).__name__} at '{path}' has no run().", fix="def run(self, userdata):")

    def children(self) -> Mapping[str, Behavior]:
        """Return nothing."""
        return {}

    def execution(self, path: str, data: dict[str, Any], remapping: Mapping[str, str], owner: Endpoint) -> Execution:
        """Return one execution."""
        self._owner = owner
        inputs, outputs = keys_of(self.input_keys, remapping), keys_of(self.output_keys, remapping)
        return StateExecution(self, path, Userdata(data, inputs, outputs, f"State '{path}'"))


class StateExecution:
    """One execution of a state."""

    def __init__(self, state: State, path: str, userdata: Userdata) -> None:
        self._state, self._path, self._userdata = state, path, userdata
        self._generator: Generator[Any, Any, str] | None = None
        self._wait = Wait("time")
        self._ends_ns: float = 0.0
        self._closes_ns: float | None = None  # once it is preempted

    def begin(self, step: Step) -> str | None:
        """Call `run`."""
        made: Any = self._state.run(self._userdata)
        if not isinstance(made, GeneratorType):
            return self._outcome(made)
        self._generator = made
        return self._advance(step, lambda: made.send(None))

    def step(self, step: Step) -> str | None:
        """Continue if what it waits for has come."""
        generator, wait = self._generator, self._wait
        assert generator is not None
        if self._closes_ns is not None and step.now_ns >= self._closes_ns:
            self.close()
            return PREEMPTED
        if wait.kind == step.kind and wait.name == step.name:
            return self._advance(step, lambda: generator.send(step.value))
        if wait.condition is not None and wait.condition():
            return self._advance(step, lambda: generator.send(True))
        if step.now_ns >= self._ends_ns:
            return self._advance(step, lambda: generator.send(None))
        return None

    def preempt(self, step: Step) -> str | None:
        """Raise `Preempted` where it waits."""
        generator = self._generator
        if generator is None or self._closes_ns is not None:
            return None
        self._closes_ns = step.now_ns + step.preempt_deadline_s * NS_PER_S
        return self._advance(step, lambda: generator.throw(Preempted()))

    def close(self) -> None:
        """Close the generator: its `finally` blocks are executed."""
        if self._generator is not None:
            self._generator.close()

    def waits(self) -> list[Wait]:
        """Return what it waits for."""
        return [self._wait]

    def active(self) -> dict[str, str]:
        """Return nothing: its container names it."""
        return {}

    def _advance(self, step: Step, resume: Any) -> str | None:
        """Resume the generator until it waits or ends."""
        generator = self._generator
        assert generator is not None
        is_preempted = self._closes_ns is not None
        try:
            for _ in range(MAX_YIELDS):
                yielded = resume()
                if isinstance(yielded, Wait):
                    self._wait = yielded
                    self._ends_ns = step.now_ns + yielded.timeout_s * NS_PER_S
                    return None
                step.tasks += self._tasks(yielded)
                resume = generator.__next__
        except StopIteration as end:
            return PREEMPTED if is_preempted else self._outcome(end.value)
        except Preempted:
            if not is_preempted:
                raise
            return PREEMPTED
        raise TaskError(
            self._at_line(f"State '{self._path}' has yielded {MAX_YIELDS} times without waiting."),
            fix="yield wait(0.1), or page(...), in the loop.",
        )

    def _tasks(self, yielded: Any) -> list[Task]:
        try:
            owner: Any = self._state.owner
            return list(as_tasks(yielded, owner, self._state.run))
        except TaskError:
            raise TaskError(
                self._at_line(f"State '{self._path}' yielded {yielded!r:.80}, which is neither a task nor a wait."),
                fix='yield self.store_data_task(...), page("key"), event("name") or wait(0.5).',
            ) from None

    def _outcome(self, value: Any) -> str:
        if value in self._state.outcomes and isinstance(value, str):
            return value
        text = f"State '{self._path}' ended with {value!r:.80}, which is not one of its outcomes."
        raise UnknownNameError(
            after_line(location_of(self._state.run), text), fix=suggest(str(value), self._state.outcomes, "they are")
        )

    def _at_line(self, text: str) -> str:
        """Return a text after the line that the generator is at."""
        frame = None if self._generator is None else self._generator.gi_frame  # type: ignore[attr-defined]
        return text if frame is None else after_line(location_in(frame.f_code, frame.f_lineno), text)
