"""Random tests of state machines: stories of signals, readings and times, and what must be true after each step.

program --> StoryChoices --> failing_story --> the shortest story that fails, as a test: `snr machine try FILE`
                 |-> random_stories --> hypothesis, in a suite
                 `-> MachineStory --> Interpreter
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from snr_sim.behaviors.bridge import DRIVE_FUNCTIONS, READ_FUNCTIONS, Bridge, Drive, Read
from snr_sim.behaviors.context import FixedPages
from snr_sim.behaviors.imports import texts_of
from snr_sim.behaviors.interpreter import Interpreter
from snr_sim.behaviors.language import parse
from snr_sim.behaviors.program import Program, ProgramError
from snr_sim.prelude.errors import MissingExtraError
from snr_sim.prelude.rng import rng_for
from snr_sim.prelude.task import DataKey

if TYPE_CHECKING:
    from hypothesis.stateful import RuleBasedStateMachine

NS_PER_MS = 1_000_000
STEP_MS = 10.0  # by which a random wait misses a time-out
MAX_STEPS = 30  # of a random story
FAR = 1000.0  # what is read at most, if nothing says what can be
Choose: TypeAlias = Callable[[Sequence[Any]], Any]  # takes one of a sequence
Call: TypeAlias = tuple[str, tuple[Any, ...]]  # of a method of a story: its name and its arguments
_PART = re.compile(r"\brobot\.(\w+)\.(\w+)")
_NUMBER = re.compile(r"(?<![\w.])\d+(?:\.\d+)?(?![\w.])")


class _Readings(FixedPages):
    """Pages that a story sets, with their ages."""

    def __init__(self) -> None:
        self.times_ns: dict[DataKey, int] = {}
        self.now_ns = 0
        self._values: dict[DataKey, Any] = {}
        super().__init__(self._values)

    def set(self, key: DataKey, value: Any) -> None:
        self._values[key], self.times_ns[key] = value, self.now_ns

    def get_age_s(self, key: DataKey) -> float:
        return (self.now_ns - self.times_ns[key]) / 1e9 if key in self.times_ns else math.inf


class MachineStory:
    """Runs a program step by step, and checks after each step what must always be true.

    That is: each rule `(always ...)` of the program; every machine is in one state, and runs only in the state around
    it; no state was entered in the future; from a snapshot, the same step does the same.

    Args:
        program: what `parse` or `machine(...)` returns; or an LRP file, which has no `(actions ...)`.
        is_strict: whether an exception in a block is a failure.

    Raises:
        AssertionError: by each method: the step leads to what must not be.
    """

    def __init__(self, program: Program | Path, *, is_strict: bool = False) -> None:
        self.program: Program = _program_in(program) if isinstance(program, Path) else program
        self.calls: list[Call] = []
        self._is_strict = is_strict
        self._readings = _Readings()
        self._bridge = _bridge_of(self.program)
        self._ours, self._twin = self._interpreter(), self._interpreter()
        self._step(lambda one: one.spawn(0))

    @property
    def interpreter(self) -> Interpreter:
        """What runs the program."""
        return self._ours

    @property
    def now_ns(self) -> int:
        """The time since the story began [ns]."""
        return self._readings.now_ns

    def wait(self, ms: float) -> None:
        """Let time pass [ms], then take a step."""
        self._note("wait", ms)
        self._readings.now_ns += round(ms * NS_PER_MS)
        self._step(self._stepped())

    def signal(self, name: str, *values: Any) -> None:
        """Take a step in which a signal is given."""
        self._note("signal", name, *values)
        self._step(self._stepped(name, values))

    def read(self, name: DataKey, value: Any) -> None:
        """Set what a part of the robot reads, in an LRP program, or the data of a page; then take a step."""
        self._note("read", name, value)
        self._readings.set(name, value)
        self._step(self._stepped())

    def set(self, path: str, value: Any) -> None:
        """Set a variable, as the event "<name>.set" does."""
        self._note("set", path, value)
        self._step(lambda one: one.set(path, value))

    def pause(self, ms: float) -> None:
        """Stand still for a time [ms]: no time-out advances."""
        self._note("pause", ms)
        self._readings.now_ns += round(ms * NS_PER_MS)
        self._step(lambda one: one.delay(round(ms * NS_PER_MS)))

    def save_again(self) -> None:
        """Edit a text in which a comment alone is new: states and variables must be kept."""
        self._note("save_again")
        before = self._ours.active, self._ours.since_ns, self._ours.variables
        text = f"{self._ours.program.text}\n; saved again"
        program = parse(text, None, self.program.files, self.program.actions)
        self._ours.edit(program, self._readings.now_ns)
        self._twin = self._interpreter()
        self._twin.edit(program, self._readings.now_ns)
        assert (self._ours.active, self._ours.since_ns, self._ours.variables) == before, "an edit lost a state"
        self._check()

    def _interpreter(self) -> Interpreter:
        return Interpreter(self.program, self._readings, bridge=self._bridge, rng=rng_for(0, "story"))

    def _note(self, method: str, *values: Any) -> None:
        self.calls.append((method, values))

    def _stepped(self, signal: str | None = None, values: Sequence[Any] = ()) -> Callable[[Interpreter], Any]:
        return lambda one: one.step(self._readings.now_ns, signal, values)

    def _step(self, act: Callable[[Interpreter], Any]) -> None:
        """Do the same with the program and, from a snapshot, with its twin."""
        self._twin.restore(json.loads(json.dumps(self._ours.snapshot())))
        assert act(self._ours) == act(self._twin), "from a snapshot, the step does something else"
        assert self._ours.snapshot() == self._twin.snapshot(), "from a snapshot, the step leads somewhere else"
        self._check()

    def _check(self) -> None:
        ours = self._ours
        for path, state in ours.active.items():
            around, _, _ = path.rpartition("/")
            machine, _, place = around.rpartition("/")
            assert not around or ours.active.get(machine) == place, f"'{path}' runs outside its state"
            assert ours.since_ns[path] <= self._readings.now_ns, f"'{path}' has entered '{state}' in the future"
        rules = {rule.name for rule in ours.program.rules}
        for one in ours.problems.values():
            if one.block in rules or self._is_strict:
                raise AssertionError(f"Line {one.line}, {one.block}: {one.message}")


def _program_in(file: Path) -> Program:
    text = file.read_text(encoding="utf-8")

    def read_text(name: str) -> str | None:
        path = file.parent / name
        return path.read_text(encoding="utf-8") if path.is_file() else None

    return parse(text, None, texts_of(text, read_text))


def _bridge_of(program: Program) -> Bridge:
    """Return a bridge of the parts that a program names: a page for each that is read, and no limits."""
    used = [found for text in (program.text, *program.files.values()) for found in _PART.findall(text)]
    return Bridge(
        {part: Read(part) for part, verb in used if verb in READ_FUNCTIONS},
        {part: Drive(f"{part} command", part, -math.inf, math.inf) for part, verb in used if verb in DRIVE_FUNCTIONS},
    )


class StoryChoices:
    """What may happen next in a story of a program: a signal; a reading; time to shortly before, at and after each
    time-out; a pause; an edit.

    Readings are None, the limits of the bridge or 1000, and numbers at and around those in the text, also negative.

    Args:
        program: to be tested.
        bridge: of the robot, for the limits of what is read.
        readings: of a program in Python: values for each page.
        sets: values that may be given to variables, by path.
        is_strict: whether an exception in a block is a failure.
    """

    def __init__(
        self,
        program: Program,
        *,
        bridge: Bridge | None = None,
        readings: Mapping[DataKey, Sequence[Any]] | None = None,
        sets: Mapping[str, Sequence[Any]] | None = None,
        is_strict: bool = False,
    ) -> None:
        self._program = program
        self._is_strict = is_strict
        self._numbers = sorted({float(one) if "." in one else int(one) for one in _NUMBER.findall(program.text)} | {0})
        self.readings: list[tuple[DataKey, Any]] = [
            (name, value) for name, values in (readings or {}).items() for value in values
        ]
        self.readings += [
            (name, value)
            for name in _bridge_of(program).reads
            for value in _values(None if bridge is None else bridge.reads.get(name), self._numbers)
        ]
        self._signals = program.signals()
        self._assigned = [(path, value) for path, values in (sets or {}).items() for value in values]
        self._waits_ms = sorted({ms for ms in (*_time_outs_ms(program, self._numbers), STEP_MS) if ms > 0})
        self._kinds = ["wait", "pause"]
        self._kinds += ["signal"] * bool(self._signals) + ["read"] * bool(self.readings)
        self._kinds += ["set"] * bool(self._assigned) + ["save_again"] * _is_text(program)

    def begin(self) -> MachineStory:
        """Return a new story."""
        return MachineStory(self._program, is_strict=self._is_strict)

    def step(self, story: MachineStory, choose: Choose) -> None:
        """Take one step of a story."""
        kind = choose(self._kinds)
        if kind == "wait":
            story.wait(self._wait_ms(story, choose))
        elif kind == "pause":
            story.pause(choose(self._waits_ms))
        elif kind == "signal":
            story.signal(choose(self._signals), *(choose(self._numbers) for _ in range(choose((0, 1, 2)))))
        elif kind == "read":
            story.read(*choose(self.readings))
        elif kind == "set":
            story.set(*choose(self._assigned))
        else:
            story.save_again()

    def _wait_ms(self, story: MachineStory, choose: Choose) -> float:
        """Return the time until a time-out of one of the machines, or until shortly before or after it."""
        since_ns = choose(list(story.interpreter.since_ns.values()) or [0])
        after_ms: float = choose(self._waits_ms)
        left_ms = after_ms + choose((0.0, -STEP_MS, STEP_MS)) - (story.now_ns - since_ns) / NS_PER_MS
        return left_ms if left_ms > 0 else after_ms


def random_stories(choices: StoryChoices) -> type[RuleBasedStateMachine]:
    """Return hypothesis' state machine of a program; its attribute `TestCase` is a test of a suite.

    Raises:
        MissingExtraError: hypothesis is not installed.
    """
    try:
        from hypothesis import strategies as st
        from hypothesis.stateful import RuleBasedStateMachine, rule
    except ImportError:
        raise MissingExtraError("hypothesis", "testing") from None

    class Stories(RuleBasedStateMachine):
        """Random stories of one program."""

        def __init__(self) -> None:
            super().__init__()
            self.story = choices.begin()

        @rule(data=st.data())
        def step(self, data: st.DataObject) -> None:
            choices.step(self.story, lambda options: data.draw(st.sampled_from(options)))

    return Stories


def _is_text(program: Program) -> bool:
    try:
        return parse(program.text, None, program.files, program.actions).sha256 == program.sha256
    except ProgramError:
        return False


def _values(read: Read | None, numbers: list[float]) -> list[Any]:
    """Return what a part may read: None first, as the simplest."""
    low, high = (-math.inf, math.inf) if read is None else (read.low, read.high)
    ends = {max(low, -FAR), min(high, FAR)}
    found = {sign * number + shift for number in numbers for sign in (1, -1) for shift in (-1, 0, 1)} | ends
    return [None, *sorted((one for one in found if low <= one <= high), key=abs)]


def _time_outs_ms(program: Program, numbers: list[float]) -> list[float]:
    """Return the time-outs of a program; if one is computed, also all numbers in its text."""
    times = [one.after_ns for _, spawn in program.walk() for one in spawn.machine.transitions]
    known = [one / NS_PER_MS for one in times if isinstance(one, int)]
    return known if len(known) == len([one for one in times if one is not None]) else [*known, *numbers]


def failing_story(choices: StoryChoices, cases: int) -> tuple[list[Call], Exception] | None:
    """Return the calls of a random story that fails, and its exception; None if none does. No call can be left out.

    Args:
        choices: of the program.
        cases: how many stories are tried: the same ones each time.
    """
    rng = rng_for(0, "stories")
    for _ in range(cases):
        story = None
        try:
            story = choices.begin()
            for _ in range(int(rng.integers(1, MAX_STEPS, endpoint=True))):
                choices.step(story, lambda options: options[int(rng.integers(len(options)))])
        except Exception as error:
            return _shortened(choices.begin, [] if story is None else story.calls, error)
    return None


def _shortened(begin: Callable[[], MachineStory], calls: list[Call], error: Exception) -> tuple[list[Call], Exception]:
    """Simplify a story as long as it fails."""
    i = len(calls)
    while i > 0:
        i -= 1
        for shorter in _shorter(calls, i):
            found = _failure(begin, shorter)
            if found is not None:
                calls, error = found
                i = len(calls)
                break
    return calls, error


def _shorter(calls: list[Call], i: int) -> Iterator[list[Call]]:
    """Yield calls without one, or with the values of its signal left out, or with one wait instead of two."""
    name, values = calls[i]
    before, after = calls[:i], calls[i + 1 :]
    yield before + after
    if name == "signal" and values[1:]:
        yield [*before, (name, values[:1]), *after]
    if name == "wait" and after and after[0][0] == "wait":
        yield [*before, (name, (values[0] + after[0][1][0],)), *after[1:]]


def _failure(begin: Callable[[], MachineStory], calls: list[Call]) -> tuple[list[Call], Exception] | None:
    """Return the calls until the story fails, and how; None if it does not."""
    story = begin()
    try:
        for name, values in calls:
            getattr(story, name)(*values)
    except Exception as error:
        return story.calls, error
    return None


def as_test(calls: list[Call], name: str, imports: str, program: str, *, is_strict: bool) -> str:
    """Return a story as the text of a test.

    Args:
        calls: of its methods.
        name: of its function.
        imports: a line that imports what is named in `program`.
        program: the expression that is the program.
        is_strict: of the story.
    """
    lines = [
        imports, "", "from snr_sim.testing import MachineStory", "", "", f"def test_{name}() -> None:",
        f"    story = MachineStory({program}{', is_strict=True' if is_strict else ''})",
        *(f"    story.{method}({', '.join(map(repr, values))})" for method, values in calls),
    ]  # fmt: skip
    return "\n".join([*lines, ""])
