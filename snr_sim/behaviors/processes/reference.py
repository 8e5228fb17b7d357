"""The reference machine: it takes events and changes its state, once all who follow it have ended the old one.

Its guarantees, for control processes in lock step, on threads and in processes:

- No control process begins a state while another is in the one before: all end, then all begin.
- Each event that is accepted causes one transition, in the order of arrival; none is lost. One that a control process
  published in a state that is over by now is dropped, and reported.
- A control process that does not end its state in time is named, and `on_stuck` decides what follows.

An epoch is a number that counts states entered. A transition from epoch 4 to 5:

    event                             from any component, or published by a control process in epoch 4
      -> page {epoch 4, "ending"}     each control process ends its state
      <- event ended [name, 4]        from each
      -> page {epoch 5, "running"}    each begins its new state; the next event is taken

Source: Kooi (2018), sections 7.3 to 7.6. There the service of events has one slot, so of two quick ones one is lost.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any, Literal, NamedTuple, NoReturn, TypeAlias, get_args

import msgspec

from snr_sim.behaviors.context import NS_PER_S
from snr_sim.behaviors.endpoint import StepLoop, StepLoopFactory
from snr_sim.behaviors.flow.event_state import EventState
from snr_sim.behaviors.flow.flow import Flow
from snr_sim.behaviors.flow.userdata import check_known
from snr_sim.behaviors.interpreter import Interpreter
from snr_sim.behaviors.processes.control_process import ROUNDING_S, ControlProcess, ControlProcessFactory
from snr_sim.behaviors.program import Program
from snr_sim.behaviors.tables import machine, on, state
from snr_sim.core.endpoint import Endpoint, EndpointFactory
from snr_sim.core.factory import ComponentFactory
from snr_sim.core.loop import NEVER_S
from snr_sim.prelude import tasks
from snr_sim.prelude.errors import ComponentFailedError, ConfigError, ParameterError, suggest
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.task import DataKey, SomeTasks, Task, TaskId, TaskType

OnStuck: TypeAlias = Literal["fail", "detach", "failsafe"]
States: TypeAlias = Mapping[str, Mapping[str, str]]  # from each state by event to the next
NOOP = "NOOP"  # an event without effect, as in Kooi's program
HANDLED = ("publish", "ended", "left", "crashed", "attach", "detach", "stop", "step")  # events, besides those of states


def reference_parts(
    states: States | Program | Flow,
    initial: str = "",
    name: str = "reference",
    *,
    observers: Sequence[str] = (),
    stop_timeout_s: float = 2.0,
    on_stuck: OnStuck = "fail",
    step_hz: float = 100.0,
) -> list[ComponentFactory]:
    """Return the factories of a reference machine and of the clock for its deadlines; see `ReferenceFactory`."""
    made = ReferenceFactory(
        states, initial, name, observers=observers, stop_timeout_s=stop_timeout_s, on_stuck=on_stuck
    )
    return [ReferenceClockFactory(name, step_hz), made]


class ReferenceClockFactory(StepLoopFactory):
    """Factory of the clock of a reference machine."""

    def get(self, parent: NodeApi) -> ReferenceClock:
        """Return the loop."""
        return ReferenceClock(self, parent, f"{self.name}_clock", self.step_hz)


class ReferenceClock(StepLoop):
    """Schedules the steps of a reference machine; a thread sleeps while the machine waits for no control process."""

    def __init__(self, factory: ReferenceClockFactory, parent: NodeApi, name: str, max_tick_rate_hz: float) -> None:
        super().__init__(factory, parent, name, max_tick_rate_hz)
        self.wakes_on: tuple[DataKey, ...] = (factory.name,)
        self._next_s = 0.0

    def loop(self) -> None:
        """Schedule a step at most once a period; the page of the machine decides whether more are needed."""
        now_s = self.get_time_s()
        if now_s >= self._next_s:
            self._next_s = now_s + 1.0 / self.max_tick_rate_hz - ROUNDING_S
            super().loop()
        page = self.parent.get_page(self.factory.name)
        is_waiting = page is not None and page.data["phase"] == "ending"
        if not self.parent.is_in_lock_step:  # see `ControlProcess.loop`
            self.next_tick_at_s = None if is_waiting else NEVER_S


class ReferenceFactory(EndpointFactory):
    """Factory of a reference machine.

    Args:
        states: for each state, the state that follows each event; or a program of one machine, by `machine(...)` or
            `parse(...)`, whose transitions wait for events alone; or a flow of `EventState`s, whose own outcomes are
            states, too, that nothing leaves.
        initial: in which it begins; that of the program or flow, or the first, if not given.
        name: of the component, of its page, and the beginning of its events' names.
        observers: names of the control processes that it waits for.
        stop_timeout_s: how long a control process may take to end a state.
        on_stuck: what follows if it takes longer, or crashes: 'fail' ends the node; 'detach' continues without it;
            'failsafe' does so, too, and stores page "failsafe" before.

    Raises:
        ProgramError: a state that is named does not exist.
        ConfigError: the program or flow has more than states and events.
        ParameterError: the time is not positive, the policy is unknown, or an observer is named twice.
    """

    def __init__(
        self,
        states: States | Program | Flow,
        initial: str = "",
        name: str = "reference",
        *,
        observers: Sequence[str] = (),
        stop_timeout_s: float = 2.0,
        on_stuck: OnStuck = "fail",
    ) -> None:
        super().__init__()
        if on_stuck not in get_args(OnStuck):
            raise ParameterError(f"on_stuck is {on_stuck!r}.", fix=suggest(str(on_stuck), get_args(OnStuck)))
        if not 0.0 < stop_timeout_s < float("inf"):
            raise ParameterError(f"stop_timeout_s is {stop_timeout_s!r}.", fix="seconds, such as 2.0.")
        if isinstance(observers, str) or len(set(observers)) != len(observers):
            raise ParameterError(f"observers is {observers!r}.", fix="a list of names, each once.")
        if isinstance(states, Program):
            program, states = states, _states_of(states)
            initial = initial or program.spawns[0].initial
        elif isinstance(states, Flow):
            initial, states = initial or states.initial, _states_of_flow(states)
        initial = initial or next(iter(states), "")
        rows = [state(one, *(on(event, to=target) for event, target in then.items())) for one, then in states.items()]
        self.program = machine(name, initial, rows)
        self.states: dict[str, dict[str, str]] = {one: dict(then) for one, then in states.items()}
        self.initial: str = initial
        self.name: str = name
        self.observers: tuple[str, ...] = tuple(observers)
        self.stop_timeout_s: float = stop_timeout_s
        self.on_stuck: OnStuck = on_stuck

    def get(self, parent: NodeApi) -> Reference:
        """Return the component."""
        return Reference(self, parent, self.name)


def _states_of(program: Program) -> States:
    """Return the states and events of a program.

    Raises:
        ConfigError: it has more than these, which nothing would execute, or not one machine.
    """
    machines = [spawn.machine for _, spawn in program.walk()]
    states = [one for each in machines for one in each.states]
    arrows = [one for each in machines for one in each.transitions]
    blocks = [one for each in states for one in (*each.enter, *each.during, *each.leave)]
    what = (
        f"{len(machines)} machines" if len(machines) != 1
        else "a transition that waits for no event" if any(one.signal is None for one in arrows)
        else "blocks" if blocks or any(one.effect for one in arrows)
        else "rules" if program.rules else ""
    )  # fmt: skip
    if what:
        raise ConfigError(
            f"The program of a reference machine has {what}; it may have one machine with states and events alone.",
            fix="let the states of a control process do the work, and publish an event.",
        )
    return {
        # Of several transitions by one event the first is taken.
        one.name: {str(arrow.signal): arrow.target for arrow in reversed(list(machines[0].transitions_of(one.name)))}
        for one in states
    }


def _states_of_flow(flow: Flow) -> States:
    """Return the states and events of a flow, and its outcomes as states.

    Raises:
        ConfigError: a state does work, or is a container; or the flow cannot run.
    """
    flow.check(flow.name)
    found: dict[str, dict[str, str]] = {}
    for label, one in flow.children().items():
        if not isinstance(one, EventState):
            raise ConfigError(
                f"State '{label}' of flow '{flow.name}' is a {type(one).__name__}; a reference machine only has states "
                "that wait for events.",
                fix="EventState('FOUND', 'LOST'); let the states of a control process do the work.",
            )
        found[label] = {event: flow.target(label, event) for event in one.outcomes}
    return found | {target: {} for then in found.values() for target in then.values() if target not in found}


class _Event(NamedTuple):
    """An event that waits for its turn; of one from outside, source is "" and epoch None."""

    name: str
    source: str
    epoch: int | None
    values: list[Any]


class Reference(Endpoint):
    """A reference machine. Its page has `state`, `epoch`, `phase` (running, ending or stopped), `event` and `values` of
    the event that led to the state, `attached`, and `leaving`: a number for each control process that is to end its
    state because it is attached no more.

    It handles the events of its states, and:

        <name>.publish [event, source, epoch, ...]
                                                an event of a control process, in one of its epochs, and its values
        <name>.ended [source, epoch]            a control process has ended its state
        <name>.left [source, number]            one that is attached no more has done so
        <name>.crashed [source, text, is_dead]  one has raised an exception, or its process has died
        <name>.attach [source], .detach         one begins to follow, in the present state and once it has left; or
                                                follows no more
        <name>.stop                             all end; nothing follows

    It sends "<name>.transition" for each change, and "<name>.dropped" [event, source, epoch, reason] for each event
    without one.
    """

    factory: ReferenceFactory

    def __init__(self, factory: ReferenceFactory, parent: NodeApi, name: str) -> None:
        super().__init__(factory, parent, name)
        self.epoch: int = 0
        self.phase: Literal["running", "ending", "stopped"] = "running"
        self.attached: list[str] = list(factory.observers)
        self._interpreter = Interpreter(factory.program)
        self._queue: deque[_Event] = deque()
        self._waiting: list[str] = []  # for these to end
        self._cause: _Event | None = None  # of the transition that has begun; None: a stop
        self._entered_by, self._entered_with = "", list[Any]()
        self._leaving: dict[str, int] = {}
        self._leaves = 0  # how many there have been
        self._joining: list[str] = []  # those that are attached as soon as they have left
        self._dead: set[str] = set()
        self._deadline_s = 0.0
        signals = {event for then in factory.states.values() for event in then}
        own = [f"{name}.{what}" for what in ("transition", "dropped", *HANDLED)]
        self.optional_events = [*own, *signals, NOOP]  # most come by `publish`
        self.task_handlers = {
            **{(TaskType.event, event): self.on_event for event in sorted({*signals, NOOP})},
            **{(TaskType.event, f"{name}.{what}"): getattr(self, f"on_{what}") for what in HANDLED},
        }

    @property
    def state(self) -> str:
        """The present state."""
        return self._interpreter.active.get(self.factory.name, self.factory.initial)

    def begin(self) -> None:
        """Enter the initial state.

        Raises:
            ConfigError: a control process does not exist, or does not have every state, or follows nothing.
        """
        for name in self.factory.observers:
            self._check(name)
        for name, one in self._factories().items():
            if one.of not in self.parent.components:
                self._refuse_of(name, one.of)
        for problem in self.factory.program.warnings:
            self.parent.add_note(problem.message)
        self._interpreter.spawn(self._now_ns())
        self.epoch = 1
        self.schedule([self._page_task()])

    def _check(self, name: str) -> None:
        known = self._factories()
        check_known(name, known, f"'{self.name}' waits for '{name}', which is not a control process of this node.")
        found = known[name]
        if found.of != self.name:
            self._refuse_of(name, found.of)
        have, needed = found.states, self.factory.states
        missing = [one for one in needed if one not in have]
        surplus = [one for one in have if one not in needed]
        if missing or surplus:
            what = f"has no state '{missing[0]}'" if missing else f"has the state '{surplus[0]}'"
            fix = suggest((missing or surplus)[0], have if missing else needed)
            raise ConfigError(f"Control process '{name}' {what}, unlike '{self.name}'.", fix=fix)

    def _refuse_of(self, name: str, of: str) -> NoReturn:
        what = f"Control process '{name}' has of='{of}', which is not the reference machine that it is to follow."
        raise ConfigError(what, fix=f"of={self.name!r}.")

    def _factories(self) -> dict[str, ControlProcessFactory]:
        """Return the factories of the node's control processes by name; a replay has no components of loops."""
        made = [one.factory for one in self.parent.components.values() if isinstance(one, ControlProcess)]
        configured = self.parent.factories if self.parent.is_replay else ()
        found = [*made, *(one for one in configured if isinstance(one, ControlProcessFactory))]
        return {one.name: one for one in found}

    # -- events -------------------------------------------------------------------------------------------------------

    def on_event(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Take an event from outside."""
        return self._take(_Event(task.name, "", None, list(task.val_list)))

    def on_publish(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Take an event of a control process."""
        found = self._values(task, str, str, int)
        if found is None:
            return None
        name, source, epoch = found
        return self._take(_Event(name, source, epoch, list(task.val_list[3:])))

    def _values(self, task: Task, *kinds: type) -> list[Any] | None:
        """Return the first values of an event, of these types; note that it was rejected, and return None, if they are
        others: anyone may send an event."""
        values = task.val_list[: len(kinds)]
        if [type(value) for value in values] == list(kinds):
            return values
        expected = ", ".join(kind.__name__ for kind in kinds)
        self.parent.add_note(f"'{task.name}' {task.val_list!r:.200} was rejected: it takes [{expected}].")
        return None

    def _take(self, event: _Event) -> list[Task]:
        if event.name == NOOP:
            self.log.debug("%s: %s", self.name, NOOP)
            return []
        if self._cause is None and self.phase != "running":
            return [self._dropped(event, "the machine was stopped")]
        self._queue.append(event)
        return self._next()

    def _next(self) -> list[Task]:
        """Begin the transition of the next event that causes one."""
        found: list[Task] = []
        while self._queue and self.phase == "running":
            event = self._queue.popleft()
            if event.epoch is not None and event.epoch != self.epoch:
                found.append(self._dropped(event, "its state is over"))
            elif event.name not in self.factory.states[self.state]:
                self._check_event(event.name)
                found.append(self._dropped(event, f"no transition in {self.state}"))
            else:
                self._cause = event
                found += self._end_state()
        return found

    def _check_event(self, name: str) -> None:
        known = {event for then in self.factory.states.values() for event in then}
        if name not in known:
            self.parent.add_note(f"'{self.name}' has no event '{name}': {suggest(name, sorted(known))}")

    def _dropped(self, event: _Event, reason: str) -> Task:
        self.log.debug("%s: %s of %r was dropped: %s", self.name, event.name, event.source, reason)
        return tasks.event(f"{self.name}.dropped", [event.name, event.source, event.epoch, reason])

    # -- the barrier --------------------------------------------------------------------------------------------------

    def _end_state(self) -> list[Task]:
        """Let all control processes end their state."""
        self.phase = "ending"
        self._waiting = list(self.attached)
        self._deadline_s = self.get_time_s() + self.factory.stop_timeout_s
        return [self._page_task(), *self._pass_barrier()]

    def on_ended(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Note that a control process has ended its state."""
        values = self._values(task, str, int)
        if values is None:
            return None
        source, epoch = values
        if self.phase != "ending" or epoch != self.epoch or source not in self._waiting:
            return None
        self._waiting.remove(source)
        return self._pass_barrier()

    def on_left(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Note that a control process which is attached no more has ended its state; attach it if it is to be again."""
        values = self._values(task, str, int)
        if values is None or self._leaving.get(values[0]) != values[1]:
            return None
        name = values[0]
        del self._leaving[name]
        if name in self._joining:
            self._joining.remove(name)
            self.attached.append(name)
        return [self._page_task()]

    def _pass_barrier(self) -> list[Task]:
        """Enter the next state, if no control process is in the old one any more."""
        if self._waiting or self.phase != "ending":
            return []
        if self._cause is None:
            self.phase = "stopped"
            return [self._page_task()]
        cause, before = self._cause, self.state
        changes = self._interpreter.step(self._now_ns(), cause.name)
        self.log.info("State machine transitioning '%s':'%s'-->'%s'", before, cause.name, self.state)
        self.epoch += 1
        self.phase = "running"
        self._entered_by, self._entered_with = cause.name, cause.values
        found = [
            # Of lines there are none: the table is made in this file.
            tasks.event(f"{self.name}.transition", [msgspec.structs.asdict(one) | {"line": 0}])
            for one in changes
        ]
        return [*found, self._page_task(), *self._next()]

    def on_step(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Look at the deadline."""
        if self.phase != "ending" or self.get_time_s() < self._deadline_s:
            return None
        stuck = ", ".join(f"'{name}'" for name in self._waiting)
        why = f"{stuck} did not end state '{self.state}' within {self.factory.stop_timeout_s:g} s."
        return self._go_on_without(list(self._waiting), why)

    def on_crashed(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Handle an exception in a control process."""
        values = self._values(task, str, str)
        if values is None:
            return None
        source, text = values
        if len(task.val_list) > 2 and task.val_list[2] is True:
            self._dead.add(source)
        if source not in self.attached:
            self.parent.add_note(f"'{source}' does not follow '{self.name}', and failed. {text}")
            return None
        return self._go_on_without([source], f"'{source}' failed in state '{self.state}'. {text}")

    def _go_on_without(self, names: Sequence[str], why: str) -> list[Task]:
        """Do what `on_stuck` says.

        Raises:
            ComponentFailedError: that is to fail.
        """
        if self.factory.on_stuck == "fail":
            raise ComponentFailedError(why, self.parent.name, self.name)
        self.parent.add_note(f"{self.name}: {why} It was detached.")
        found = [self.store_data_task("failsafe", True)] if self.factory.on_stuck == "failsafe" else []
        for name in names:
            found += self._detach(name)
        return found

    def on_attach(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Let a control process follow from now on; a barrier that has begun does not wait for it."""
        values = self._values(task, str)
        if values is None or values[0] in (*self.attached, *self._joining):
            return None
        (name,) = values
        try:
            self._check(name)
            if name in self._dead:
                raise ConfigError("its process has died.", fix="start the node again.")
        except ConfigError as error:
            self.parent.add_note(f"'{task.name}' ['{name}'] was rejected: {error}")
            return None
        if name in self._leaving:
            self._joining.append(name)
            return None
        self.attached.append(name)
        return [self._page_task()]

    def on_detach(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Let a control process follow no more."""
        values = self._values(task, str)
        if values is not None and values[0] in self._joining:
            self._joining.remove(values[0])
        return None if values is None or values[0] not in self.attached else self._detach(values[0])

    def _detach(self, name: str) -> list[Task]:
        has_ended = self.phase == "stopped" or (self.phase == "ending" and name not in self._waiting)
        if not has_ended and name not in self._dead:
            self._leaves += 1
            self._leaving[name] = self._leaves
        self.attached = [one for one in self.attached if one != name]
        self._waiting = [one for one in self._waiting if one != name]
        return [self._page_task(), *self._pass_barrier()]

    def on_stop(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Let all end their state; none follows. A transition that has begun leads nowhere any more."""
        if self.phase == "stopped":
            return None
        lost = [*([self._cause] if self._cause is not None and self.phase == "ending" else []), *self._queue]
        self._cause = None
        self._queue.clear()
        found = [self._dropped(event, "the machine was stopped") for event in lost]
        return found if self.phase == "ending" else [*found, *self._end_state()]

    def _now_ns(self) -> int:
        return round(self.get_time_s() * NS_PER_S)

    def _page_task(self) -> Task:
        data: dict[str, Any] = {
            "state": self.state, "epoch": self.epoch, "phase": self.phase, "attached": list(self.attached),
            "leaving": dict(self._leaving), "event": self._entered_by, "values": self._entered_with,
        }  # fmt: skip
        return self.store_data_task(self.name, data)
