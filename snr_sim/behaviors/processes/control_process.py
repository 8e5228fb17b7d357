"""A control process: a loop with an implementation of every state of a reference machine."""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
from types import GeneratorType
from typing import Any, Literal

from snr_sim.behaviors.flow.waits import Wait, wait
from snr_sim.core.loop import NEVER_S, Loop, LoopFactory
from snr_sim.core.source_location import describe_error
from snr_sim.prelude import tasks
from snr_sim.prelude.errors import ConfigError, ParameterError, TaskError
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.task import DataKey, Page, Task

ROUNDING_S = 1e-9
_ANSWER_S = 1.0  # how much longer than a movement its server may take to answer


class ObserverState:
    """Base of one state of one control process; a new object for each time that the state is entered.

        class Echo(ObserverState):
            def run_state(self):
                self.log_value(self.turns)
                yield wait(1.0)

    Args:
        parent: the control process.
        name: of the state.

    Attributes:
        turns: how often `run_state` has ended since the state was entered.
        entered_s: when it was entered.
        event, values: name and values of the event that led to it; empty at the beginning.
    """

    event: str = ""
    values: Sequence[Any] = ()

    def __init__(self, parent: ControlProcess, name: str) -> None:
        self.parent: ControlProcess = parent
        self.name: str = name
        self.turns: int = 0
        self.entered_s: float = parent.get_time_s()

    def enter(self) -> None:
        """Begin; called once."""

    def run_state(self) -> Generator[object, None, None] | None:
        """Do the work; called again and again while the state lasts. It may yield waits."""
        raise NotImplementedError(f"{type(self).__name__} has no run_state().")

    def exit(self) -> None:
        """End; called once."""

    def publish_event(self, name: str, values: Sequence[Any] = ()) -> None:
        """Send an event to the reference machine; it counts while this state lasts. The next state gets `values`."""
        self.parent.publish(name, values)

    def move(self, server: str = "move", **requests: Sequence[float]) -> Generator[Wait, None, bool]:
        """Move, until the state ends: `is_reached = yield from self.move(turn=(0.5, 2.0), lift=(1.0, 0.5))`.

        Args:
            server: name of the movement server; see `movement_parts`.
            requests: magnitude and duration [s] of each request, by its name; all begin together.

        Returns:
            Whether the goal was reached: not if it is rejected, preempted, or another one has not ended.
        """
        begun_s = self.get_time_s()
        sender, goal = [self.parent.name, begun_s], {name: list(one) for name, one in requests.items()}
        self.parent.schedule(tasks.event(f"{server}.start", [{"goal": goal, "sender": sender}]))
        over_s = begun_s + max((float(one[-1]) for one in requests.values()), default=0.0) + _ANSWER_S
        while self.get_time_s() <= over_s:
            try:
                yield wait(0.0)
            except GeneratorExit:
                self.parent.schedule(tasks.event(f"{server}.preempt"))
                raise
            data = self.get_data(server) or {"outcome": "", "userdata": {}}
            outcome, is_own = data["outcome"], data["userdata"].get("sender") == sender
            if is_own and outcome is not None:
                return bool(outcome == "reached")
            if not is_own and outcome is None:  # another movement
                return False
        return False

    def log_value(self, value: object) -> None:
        """Log a line: "[Process1] StateB 0"."""
        self.parent.log.info("[%s] %s %s", self.parent.name, self.name, value)

    def get_page(self, key: DataKey) -> Page | None:
        """Return the newest page of a key."""
        return self.parent.parent.get_page(key)

    def get_data(self, key: DataKey) -> Any:
        """Return the data of the newest page of a key, or None."""
        page = self.get_page(key)
        return None if page is None else page.data

    def store_data(self, key: DataKey, data: Any, process: bool = True) -> None:
        """Store data under a key."""
        self.parent.store_data(key, data, process)

    def get_time_s(self) -> float:
        """Return the node's time [s]."""
        return self.parent.get_time_s()


class ControlProcessFactory(LoopFactory):
    """Factory of a control process.

    Args:
        name: of it.
        of: name of the reference machine.
        states: the class of each state, by its name.
        executor: what calls it on the wall clock: a thread or a process.
        rate_hz: how often it looks at its waits, and calls `run_state`.

    Raises:
        ConfigError: a state is not a class of states.
    """

    def __init__(
        self,
        name: str,
        of: str,
        states: Mapping[str, type[ObserverState]],
        *,
        executor: Literal["thread", "process"] = "thread",
        rate_hz: float = 100.0,
    ) -> None:
        super().__init__()
        for key, one in states.items():
            if not (isinstance(one, type) and issubclass(one, ObserverState)):
                raise ConfigError(
                    f"State '{key}' of control process '{name}' is {one!r}.", fix="a class: class Echo(ObserverState)."
                )
            if one.run_state is ObserverState.run_state:
                raise ConfigError(
                    f"{one.__name__} of control process '{name}' has no run_state().", fix="def run_state(self):"
                )
        self.name: str = name
        self.of: str = of
        self.states: dict[str, type[ObserverState]] = dict(states)
        self.executor: Literal["thread", "process"] = executor
        self.rate_hz: float = rate_hz

    def get(self, parent: NodeApi) -> ControlProcess:
        """Return the loop."""
        return ControlProcess(self, parent, self.name, self.rate_hz)


class ControlProcess(Loop):
    """Follows the page of a reference machine: begins and ends states with it, and runs the present one."""

    factory: ControlProcessFactory

    def __init__(self, factory: ControlProcessFactory, parent: NodeApi, name: str, max_tick_rate_hz: float) -> None:
        super().__init__(factory, parent, name, max_tick_rate_hz)
        self.executor: Literal["thread", "process"] = factory.executor
        self.wakes_on: tuple[DataKey, ...] = (factory.of,)
        self._state: ObserverState | None = None
        self._epoch = 0  # of the state that it is in, or has ended
        self._has_ended = False
        self._reported = 0  # epoch whose end it has reported
        self._generator: Generator[object, None, None] | None = None
        self._until_s = 0.0
        self._is_uninterrupted = False
        self._is_crashed = False
        self._left = 0  # the last request to leave that it has answered

    def loop(self) -> None:
        """Follow the reference machine, then run the state."""
        page = self.parent.get_page(self.factory.of)
        if page is not None:
            self._look_at(page.data)
        period_s = 1.0 / self.max_tick_rate_hz if self.max_tick_rate_hz else 0.0
        is_waiting = self._generator is not None and self._until_s > self.get_time_s() + period_s
        if not self.parent.is_in_lock_step:  # there it costs nothing to keep the rate, and recorded runs did
            self.next_tick_at_s = NEVER_S if not self._is_running else self._until_s if is_waiting else None

    @property
    def _is_running(self) -> bool:
        return self._state is not None and not self._has_ended and not self._is_crashed

    def _look_at(self, data: Mapping[str, Any]) -> None:
        leave = data["leaving"].get(self.name, 0)
        if self._is_crashed:
            if leave <= self._left:
                return
            self._is_crashed, self._state, self._generator = False, None, None  # it may be attached again
        try:
            self._follow(data, leave)
        except Exception as error:
            self._is_crashed = True
            text = describe_error(error, f"in {type(self._state).__name__} of control process '{self.name}'")
            self.schedule(tasks.event(f"{self.factory.of}.crashed", [self.name, text]))

    def _follow(self, data: Mapping[str, Any], leave: int) -> None:
        epoch, phase, is_attached = data["epoch"], data["phase"], self.name in data["attached"]
        is_running = self._is_running
        if is_running and (phase != "running" or epoch != self._epoch or not is_attached):
            if not self._may_end():
                return
            self._end()
            is_running = False
        if not is_attached:
            self._epoch = 0  # if it is attached again in the same state, it begins again
            if leave > self._left:
                self._left = leave
                self.schedule(tasks.event(f"{self.factory.of}.left", [self.name, leave]))
        elif phase == "ending" and not is_running:
            self._report_end(epoch)
        elif phase == "running":
            if epoch != self._epoch:
                self._begin(data)
            if not self._has_ended:
                self._run()

    def _begin(self, data: Mapping[str, Any]) -> None:
        name = data["state"]
        self._epoch, self._has_ended = data["epoch"], False
        self.log.debug("[%s] Entering %s reference state", self.name, name)
        self._state = state = self.factory.states[name](self, name)
        state.event, state.values = data["event"], data["values"]
        state.enter()

    def _run(self) -> None:
        """Call `run_state`, or continue it if its wait is over."""
        state = self._state
        assert state is not None
        if self._generator is None:
            made = state.run_state()
            if not isinstance(made, GeneratorType):
                state.turns += 1
                return
            self._generator = made
        elif self.get_time_s() < self._until_s - ROUNDING_S:
            return
        try:
            self._wait_for(next(self._generator))
        except StopIteration:
            self._generator = None
            state.turns += 1

    def _wait_for(self, yielded: object) -> None:
        if not isinstance(yielded, Wait) or yielded.kind != "time":
            raise TaskError(f"run_state() yielded {yielded!r:.80}.", fix="yield wait(0.5).")
        self._until_s = self.get_time_s() + yielded.timeout_s
        self._is_uninterrupted = yielded.is_uninterrupted

    def _may_end(self) -> bool:
        """Return whether it is not in a wait that cannot be given up."""
        is_over = self._generator is None or self.get_time_s() >= self._until_s - ROUNDING_S
        return is_over or not self._is_uninterrupted

    def _end(self) -> None:
        state = self._state
        assert state is not None
        self._has_ended = True
        if self._generator is not None:
            self._generator.close()
            self._generator = None
        state.exit()

    def _report_end(self, epoch: int) -> None:
        """Report once in each epoch that the state has ended, or was never begun."""
        if self._reported != epoch:
            self._reported = epoch
            self.schedule(tasks.event(f"{self.factory.of}.ended", [self.name, epoch]))

    def publish(self, name: str, values: Sequence[Any] = ()) -> None:
        """Send an event of the present epoch.

        Raises:
            ParameterError: the name is not text.
        """
        if not isinstance(name, str) or not name:
            raise ParameterError(f"An event is named {name!r}.", fix='self.publish_event("FOUND").')
        self.schedule(tasks.event(f"{self.factory.of}.publish", [name, self.name, self._epoch, *values]))

    def on_death(self, message: str) -> Task:
        """Return the event by which the reference machine does what `on_stuck` says."""
        return tasks.event(f"{self.factory.of}.crashed", [self.name, message, True])

    def halt(self) -> None:
        """End the state."""
        if self._is_running:
            self._end()
