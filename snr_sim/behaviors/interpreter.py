"""The interpreter of programs: pure, so that its caller decides what time it is and what can be read.

    (now_ns, signal) --> step --> changes of state, and what the blocks returned

One step, for each machine that runs, outermost first:

1. The transitions of its state are tried in the order of the program. The first whose signal, time and condition are
   given is taken: the state is left (machines inside it first, the last spawned first), and the target is entered. So
   an emergency stop of an outer machine does not wait for what is inside it.
2. If none is taken, the state's `during` blocks are executed, then the machines inside it take their step.

A machine takes one transition in a step, except that a state with an `eps` transition is looked at again as soon as a
transition has entered it. A signal counts in the step that it causes, and not again in such a chain. Time-outs count
from the entry of the state, so a transition cancels them by leaving it.

Time is whole nanoseconds: a time-out of 0.1 s is exact.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import msgspec

from snr_sim.behaviors.bound import BoundMachine, BoundProgram, BoundState, BoundTransition, Call
from snr_sim.behaviors.bridge import Bridge, Robot
from snr_sim.behaviors.checks import exits_at_top
from snr_sim.behaviors.context import MAX_CHAIN, MAX_WORK, FixedPages, MachineContext, Owner, plain_value
from snr_sim.behaviors.context import NS_PER_S as NS_PER_S
from snr_sim.behaviors.editing import Edited, Plan, parts_of, plan, values_after
from snr_sim.behaviors.explain import Evaluations, evaluations_for
from snr_sim.behaviors.program import Block, Program, ProgramError
from snr_sim.prelude.errors import ConfigError, UnknownNameError, suggest
from snr_sim.prelude.task import DataKey

if TYPE_CHECKING:
    import numpy as np

# Without a clock, a condition that holds already when its state is entered is looked at so long after that, as with a
# clock of 100 Hz: at once, two states that lead to each other would stop the time.
SETTLE_NS = 10_000_000
_CHAIN = range(MAX_CHAIN)


class Change(msgspec.Struct, frozen=True, gc=False):
    """A machine has changed its state.

    Args:
        t_ns: when.
        machine: path of the machine, such as "mission/passing/scan".
        kind: as of the transition; 'spawn' for a machine that begins; 'stop' for one that was ended by an error or an
            edit; 'edit' for one whose state an edit has removed.
        name: of the transition.
        source, target: states; empty if it did not run before, or does not run now.
        held_ns: how long it was in the source.
        line: of the transition in the program; 0 if unknown.
    """

    t_ns: int
    machine: str
    kind: str
    name: str
    source: str
    target: str
    held_ns: int
    line: int


class RunProblem(msgspec.Struct):
    """An exception in a block, or a chain of transitions that was cut. `count`: how often; the rest is of the first."""

    t_ns: int
    machine: str
    line: int
    block: str
    message: str
    count: int = 1


class Interpreter:
    """Runs a program. Nothing happens but in its methods, on the thread that calls them.

    Args:
        program: its machines.
        pages: what can be read: a component, or data by key.
        bridge: the parts of the robot that blocks of text name.
        rng: for blocks that need random numbers.
        evaluations: keeps what each condition finds; see `explain.py`.

    Raises:
        ProgramError: a machine at the top has an exit.

    Attributes:
        outputs: what the blocks of the last step returned other than None, each after its function, in order.
        left: (path, state, time in it [ns]) of each state that was left in the last step.
        ignored: number of signals that no active state waits for, by name.
        problems: exceptions in blocks, by block; with `on_error` 'fail' they are raised instead. Also a rule of the
            program that does not hold.
        past_problems: those of programs before an edit.
        breaks: lines of the program by which the last step is to be followed by a pause.
    """

    def __init__(
        self,
        program: Program,
        pages: Owner | Mapping[DataKey, Any] | None = None,
        *,
        bridge: Bridge | None = None,
        rng: np.random.Generator | None = None,
        evaluations: Evaluations | None = None,
    ) -> None:
        if problems := exits_at_top(program.spawns):
            raise ProgramError(problems)
        self.program: Program = program
        owner = FixedPages({} if pages is None else pages) if pages is None or isinstance(pages, Mapping) else pages
        self.context: MachineContext = MachineContext(owner, rng)
        self.robot: Robot | None = None
        if bridge is not None:
            context = self.context
            self.robot = Robot(bridge, owner, lambda: context.in_state_s)
        self.outputs: list[tuple[Callable[[Any], Any], Any]] = []
        self.left: list[tuple[str, str, int]] = []
        self.ignored: dict[str, int] = {}
        self.problems: dict[tuple[int, str], RunProblem] = {}
        self.past_problems: dict[tuple[int, str, str], RunProblem] = {}
        self.breaks: list[int] = []
        self._violated: set[int] = set()  # numbers of rules that did not hold after the last step
        self._changes: list[Change] = []
        self._failed: list[BoundMachine] = []
        self._is_answered = False
        self._fails = program.on_error == "fail"
        self._evaluations = evaluations_for(program) if evaluations is None else evaluations
        self._bound = BoundProgram(program, self.robot, self._evaluations)
        self._running: list[BoundMachine] = []

    # -- driving it ---------------------------------------------------------------------------------------------------

    def spawn(self, now_ns: int) -> list[Change]:
        """Begin: enter the initial states of all machines at the top. Return the changes."""
        self._begin(now_ns, ())
        self._spawn_top()
        return self._changes

    def _spawn_top(self) -> None:
        """Spawn the machines at the top that do not run yet, and end the step."""
        for machine, initial in self._bound.top:
            if machine.state is None:
                self._spawn(self._running, machine, initial)
        self._stop_failed()
        self._check_rules()

    def step(self, now_ns: int, signal: str | None = None, values: Sequence[Any] = ()) -> list[Change]:
        """Take one step; return the changes, in order.

        Args:
            now_ns: time; not before that of the last step.
            signal: name of the event that causes the step, if one does.
            values: what it carries.

        Raises:
            Exception: any of a block, if the program says `on_error` 'fail'.
        """
        self._begin(now_ns, values)
        self._is_answered = False
        for machine in self._running:
            self._step(machine, signal)
        if signal is not None and not self._is_answered:
            self.ignored[signal] = self.ignored.get(signal, 0) + 1
        if self._failed:
            self._stop_failed()
        if self._bound.rules:
            self._check_rules()
        return self._changes

    def next_ns(self, *, is_new: bool) -> int | None:
        """Return when the next step is due if there is no clock, and no signal or page before; None if never.

        It is due at the next time-out, when a reading that decides becomes too old, and to repeat a command.

        Args:
            is_new: whether a state was entered in the last step.
        """
        context, found, parts = self.context, list[int](), set[str]()
        now_ns = context.now_ns
        for condition in (rule.condition for rule, _ in self._bound.rules if rule.condition is not None):
            parts |= condition.reads
        for machine in self._walk():
            context.machine, rows = machine, () if machine.state is None else machine.state.plain
            for definition, due in (arrow[:2] for _, _, arrow in rows):
                blocks = (definition.condition, definition.after_ns)
                parts.update(*(one.reads for one in blocks if isinstance(one, Block)))
                try:
                    after_ns = due(context) if callable(due) else due or 0
                except Exception:
                    continue
                due_ns = machine.since_ns + after_ns
                if due_ns > now_ns or is_new:
                    found.append(due_ns if due_ns > now_ns else now_ns + SETTLE_NS)
        delay_s = math.inf if self.robot is None else self.robot.next_s(parts)
        return min([*found, now_ns + round(delay_s * NS_PER_S)] if delay_s < math.inf else found, default=None)

    def _begin(self, now_ns: int, values: Sequence[Any]) -> None:
        context = self.context
        context.now_ns = now_ns
        context.signal = values
        context.work = MAX_WORK
        self._changes = []
        if self.left:
            self.left = []
        if self.outputs:
            self.outputs = []
        if context.logged:
            context.logged = []

    def _stop_failed(self) -> None:
        while self._failed:
            machine = self._failed.pop()
            if machine.state is not None:
                self._stop(machine, "error")
                if self.robot is not None:
                    self.robot.stop()

    def _check_rules(self) -> None:
        """Note what must always hold and does not, once each time that it begins; find the states to pause in."""
        self.breaks = []
        if not self._running:
            return
        entered = {state for _, state in self.entered}
        for number, (rule, holds) in enumerate(self._bound.rules):
            if rule.kind == "break" and rule.name not in entered:
                continue
            self.context.machine = self._running[0]
            try:
                is_true = holds is None or bool(holds(self.context))
            except Exception as error:
                if self._fails:
                    raise
                self._add_problem(self._running[0], rule.place.line, rule.name, f"{type(error).__name__}: {error}")
                continue
            line = rule.place.line
            if rule.kind == "break":
                if is_true:
                    self.breaks.append(line)
            elif is_true:
                self._violated.discard(number)
            elif number not in self._violated:
                self._violated.add(number)
                self._add_problem(self._running[0], line, rule.name, "it must always hold, and does not.")

    # -- one step -----------------------------------------------------------------------------------------------------

    def _step(self, machine: BoundMachine, signal: str | None) -> BoundMachine | None:
        """Take a machine's step; return the machine around it that has moved by an exit, if one has."""
        state = machine.state
        assert state is not None
        context = self.context
        context.machine = machine
        rows = state.plain
        if signal is not None and signal in state.by_signal:
            rows = state.by_signal[signal]
            self._is_answered = True
        elapsed_ns = context.now_ns - machine.since_ns
        for after_ns, condition, arrow in rows:
            if after_ns is not None and elapsed_ns < after_ns:
                continue
            if condition is None:
                return self._take(machine, arrow)
            try:
                if condition(context):
                    return self._take(machine, arrow)
            except Exception as error:
                self._report(machine, arrow[0].condition or arrow[0].after_ns, error)
        if state.during:
            self._run(machine, state.during)
        for inner in machine.running:
            moved = self._step(inner, signal)
            if moved is not None:
                return None if moved is machine else moved
        return None

    def _take(self, machine: BoundMachine, arrow: BoundTransition) -> BoundMachine | None:
        """Take a transition and those that follow at once; return the machine around it that has moved, if one has."""
        now_ns = self.context.now_ns
        mover, outermost = machine, None
        for _ in _CHAIN:
            _, _, effect, kind, name, target_name, line = arrow
            if kind == "exit":
                assert mover.parent is not None  # see `exits_at_top`
                mover = outermost = mover.parent
            source, held_ns = mover.state, now_ns - mover.since_ns
            assert source is not None
            while mover.running:  # this and what follows is also in `_end`: a call of it takes 4 % of a transition
                self._end(mover.running[-1])
            if source.leave:
                self._run(mover, source.leave)
            self.left.append((mover.path, source.name, held_ns))
            if effect:
                self._run(mover, effect)
            mover.state = target = mover.states[target_name]
            mover.since_ns = now_ns
            self._changes.append(Change(now_ns, mover.path, kind, name, source.name, target_name, held_ns, line))
            self._enter(mover, target)
            following = self._enabled(mover, target) if target.chains else None
            if following is None:
                return outermost
            arrow = following
        self._add_problem(mover, line, name, f"more than {MAX_CHAIN} transitions in one step")
        return outermost

    def _enabled(self, machine: BoundMachine, state: BoundState) -> BoundTransition | None:
        """Return the transition that a state takes at once after it was entered, if any."""
        context = self.context
        context.machine = machine
        for after_ns, condition, arrow in state.plain:
            if after_ns is not None and after_ns > 0:
                continue
            try:
                if condition is None or condition(context):
                    return arrow
            except Exception as error:
                self._report(machine, arrow[0].condition or arrow[0].after_ns, error)
        return None

    def _enter(self, machine: BoundMachine, state: BoundState) -> None:
        for calls, spawned in state.enter:
            self._run(machine, calls)
            if spawned is not None:
                self._spawn(machine.running, *spawned)

    def _spawn(self, running: list[BoundMachine], machine: BoundMachine, initial: str) -> None:
        running.append(machine)
        now_ns = self.context.now_ns
        machine.state = state = machine.states[initial]
        machine.since_ns = now_ns
        self._changes.append(
            Change(now_ns, machine.path, "spawn", "spawn", "", initial, 0, machine.definition.place.line)
        )
        self._enter(machine, state)

    def _end(self, machine: BoundMachine) -> tuple[str, int]:
        """Leave the state of a machine, which then does not run; return the state and the time in it [ns].

        The machines inside it are ended first, the last spawned first.
        """
        state, held_ns = machine.state, self.context.now_ns - machine.since_ns
        assert state is not None
        while machine.running:
            self._end(machine.running[-1])
        self._run(machine, state.leave)
        self.left.append((machine.path, state.name, held_ns))
        machine.state = None
        (self._running if machine.parent is None else machine.parent.running).remove(machine)
        return state.name, held_ns

    def _stop(self, machine: BoundMachine, cause: str) -> None:
        """End a machine, because of an error in one of its blocks or because of an edit."""
        name, held_ns = self._end(machine)
        line = 0 if cause == "edit" else machine.definition.place.line
        self._changes.append(Change(self.context.now_ns, machine.path, "stop", cause, name, "", held_ns, line))

    # -- blocks -------------------------------------------------------------------------------------------------------

    def _run(self, machine: BoundMachine, calls: Iterable[Call]) -> None:
        """Execute blocks."""
        context = self.context
        context.machine = machine
        for call, block in calls:
            try:
                output = call(context)
            except Exception as error:
                if self._fails:
                    raise
                self._report(machine, block, error)
            else:
                if output is not None:
                    self.outputs.append((call, output))

    def _report(self, machine: BoundMachine, block: Any, error: Exception) -> None:
        if self._fails:
            raise error
        self._add_problem(machine, block.place.line, block.line, f"{type(error).__name__}: {error}")
        if self.program.on_error == "stop" and machine not in self._failed:
            self._failed.append(machine)

    def _add_problem(self, machine: BoundMachine, line: int, text: str, message: str) -> None:
        known = self.problems.get((line, text))
        if known is not None:
            known.count += 1
        else:
            self.problems[(line, text)] = RunProblem(self.context.now_ns, machine.path, line, text, message)

    # -- looking at it ------------------------------------------------------------------------------------------------

    @property
    def active(self) -> dict[str, str]:
        """The state of each machine that runs, by path; outer ones first."""
        return {one.path: one.state.name for one in self._walk() if one.state is not None}

    @property
    def entered(self) -> list[tuple[str, str]]:
        """The machines that have entered a state in the last step, by path, and the state, in order."""
        return [(one.machine, one.target) for one in self._changes if one.target]

    @property
    def since_ns(self) -> dict[str, int]:
        """When each machine that runs entered its state."""
        return {one.path: one.since_ns for one in self._walk()}

    @property
    def variables(self) -> dict[str, Any]:
        """All variables by path, such as "mission.gate". From any thread."""
        bound = self._bound  # an edit on another thread replaces it
        return {path: bound.slots[place] for path, place in bound.places.items()}

    def set(self, path: str, value: Any) -> None:
        """Set a variable.

        Raises:
            UnknownNameError: there is none of that path.
            ParameterError: a variable cannot have this value.
        """
        if path not in self._bound.places:
            raise UnknownNameError(f"There is no variable '{path}'.", fix=suggest(path, self._bound.places))
        self._bound.slots[self._bound.places[path]] = plain_value(path, value)

    def edit(self, program: Program, now_ns: int) -> tuple[Edited, list[Change]]:
        """Continue with another program; return what happened to each machine, and the changes of state.

        First what goes is left, with its own exit blocks; then the states and variables that have the same identity are
        taken over; then what is new is entered. See `editing.py`.

        Raises:
            ProgramError: a machine at the top has an exit; then nothing has happened.
        """
        if problems := exits_at_top(program.spawns):
            raise ProgramError(problems)
        self._begin(now_ns, ())
        old, new = self._bound, BoundProgram(program, self.robot, self._evaluations)
        made = plan(self._running, new)
        gone = {path for one in made.stopped for path in (inner.path for inner in one.walk())}
        for machine in reversed(made.stopped):
            self._stop(machine, "edit")
        left = {machine.path: self._end(machine) for machine, _, _ in reversed(made.restarted)}
        renamed = {_inside(before): f"{after.path}/{name}/" for before, after, name in made.kept}
        for problem in self.problems.values():  # of a block of the old program
            known = self.past_problems.setdefault((problem.line, problem.block, problem.message), problem)
            known.count += 0 if known is problem else problem.count
        self.problems = {}
        notes = values_after(old, new, renamed)
        self._take_over(program, new, made)
        before_parts, parts = parts_of(old), {part for found in parts_of(new).values() for part in found}
        unused = sorted({part for path in gone for part in before_parts[path]} - parts)
        if unused and self.robot is not None:  # only machines that have gone commanded them
            self.robot.stop(*unused)
        for before, machine, initial in made.restarted:
            line, (source, held_ns) = machine.definition.place.line, left[before.path]
            self._changes.append(Change(now_ns, machine.path, "edit", "edit", source, initial, held_ns, line))
            machine.state, machine.since_ns = machine.states[initial], now_ns
            self._enter(machine, machine.states[initial])
        self._violated = set()
        self._spawn_top()
        edited = Edited(
            [after.path for _, after, _ in made.kept],
            [after.path for _, after, _ in made.restarted],
            sorted(gone),
            [*made.notes, *notes],
        )
        return edited, self._changes

    def _take_over(self, program: Program, new: BoundProgram, made: Plan) -> None:
        """Continue in the same states of another program."""
        self._running = []
        for before, machine, name in made.kept:
            machine.state, machine.since_ns = machine.states[name], before.since_ns
        for _, machine, initial in made.restarted:
            machine.state = machine.states[initial]  # it is entered later
        for machine in new.machines.values():  # in the order in which they are spawned, outer ones first
            if machine.state is not None:
                (self._running if machine.parent is None else machine.parent.running).append(machine)
        self.program, self._bound = program, new
        self._fails = program.on_error == "fail"

    def delay(self, duration_ns: int) -> None:
        """Let all times of entry be later by a duration in which the machines stood still."""
        for one in self._walk():
            one.since_ns += duration_ns

    def _walk(self) -> Iterator[BoundMachine]:
        for machine in self._running:
            yield from machine.walk()

    def snapshot(self) -> dict[str, Any]:
        """Return all that the next steps depend on, as JSON values."""
        return {
            "sha256": self.program.sha256,
            "active": [[one.path, one.state.name, one.since_ns] for one in self._walk() if one.state is not None],
            "variables": self.variables,
            "rng": None if self.context.has_no_rng else self.context.rng.bit_generator.state,
            "robot": None if self.robot is None else self.robot.snapshot(),
            "problems": [msgspec.structs.asdict(one) for one in self.problems.values()],
            "violated": sorted(self._violated),
            "ignored": dict(self.ignored),
        }

    def restore(self, snapshot: Mapping[str, Any]) -> None:
        """Continue from a snapshot of the same program; no block is executed.

        Raises:
            ConfigError: it is of another program.
        """
        if snapshot["sha256"] != self.program.sha256:
            raise ConfigError(
                "The snapshot is of another program.", fix="restore it with the program it was made with."
            )
        for path, value in snapshot["variables"].items():
            self.set(path, value)
        if snapshot["rng"] is not None:
            self.context.rng.bit_generator.state = snapshot["rng"]
        if self.robot is not None:
            self.robot.restore(snapshot["robot"])
        found = [RunProblem(**one) for one in snapshot["problems"]]
        self.problems = {(one.line, one.block): one for one in found}
        self._violated, self.ignored = set(snapshot["violated"]), dict(snapshot["ignored"])
        for one in self._bound.machines.values():
            one.state, one.running = None, []
        self._running = []
        for path, name, since_ns in snapshot["active"]:
            machine = self._bound.machines[path]
            machine.state, machine.since_ns = machine.states[name], since_ns
            (self._running if machine.parent is None else machine.parent.running).append(machine)


def _inside(machine: BoundMachine) -> str:
    """Return the beginning of the paths of what is inside the state of a machine that runs."""
    assert machine.state is not None
    return f"{machine.path}/{machine.state.name}/"
