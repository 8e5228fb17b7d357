"""State machines: what the interpreter costs compared with the same machine written by hand as `if`s.

Run by `snr bench machines`.
"""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Callable, Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

from harness import Benchmark, Outcome, Row, Skipped, compare, what_can_run

from snr_sim import Config, Endpoint, SimClock, SimRunner, handles
from snr_sim.behaviors import (
    Bridge,
    Drive,
    Interpreter,
    MachineFactory,
    Program,
    Read,
    after,
    machine,
    on,
    parse,
    state,
)
from snr_sim.behaviors.endpoint import StepLoopFactory
from snr_sim.recording.trace import FILE_NAME, TraceWriter
from snr_sim.scenario.program import program_header

STEP_NS = 1_000_000

# The explorer: ahead until something is near, then back for 0.3 s, then turn for 0.4 s.
NEAR_CM = 20.0
BACK_S, TURN_S = 0.3, 0.4


def range_cm(step: int) -> float:
    """Return what the distance sensor reads: every second something comes near for 20 ms."""
    return 10.0 if step % 1000 > 979 else 100.0


def is_near(m: Any) -> bool:
    return m.data("range") < NEAR_CM


def never(m: Any) -> Any:
    return m.data("zero")


def do_nothing(m: Any) -> None:
    return None


EXPLORER = machine(
    "explorer",
    "ahead",
    [
        state("ahead", on(is_near, to="back"), enter=do_nothing),
        state("back", after(BACK_S, to="turn"), enter=do_nothing),
        state("turn", after(TURN_S, to="ahead"), enter=do_nothing),
    ],
)
IDLE = machine(
    "idle", "a", [state("a", on(never, to="b"), on(never, to="b"), on(never, to="b"), after(1e6, to="b")), state("b")]
)
LRP_SWITCH = parse("""(var count := [0])
(machine switch
  (event near [robot.range.read() < 20])
  (state a (onentry [count = count + 1]) (onexit [robot.motor.start(5)]))
  (state b (onentry [count = count + 1]) (onexit [robot.motor.start(0)]))
  (on near a -> b)
  (on near b -> a))
(spawn switch a)""")
BRIDGE = Bridge({"range": Read("range")}, {"motor": Drive("motors", "left", -100.0, 100.0)})
SWITCH = machine(
    "switch",
    "a",
    [
        state("a", on(is_near, to="b"), enter=do_nothing, leave=do_nothing),
        state("b", on(is_near, to="a"), enter=do_nothing, leave=do_nothing),
    ],
)


class HandExplorer:
    """The explorer by hand."""

    def __init__(self, data: Callable[[str], Any]) -> None:
        self.data = data
        self.state, self.since_ns = "ahead", 0

    def step(self, now_ns: int) -> bool:
        """Return whether the state has changed."""
        if self.state == "ahead":
            if self.data("range") < NEAR_CM:
                return self.go("back", now_ns)
        elif self.state == "back":
            if now_ns - self.since_ns >= BACK_S * 1e9:
                return self.go("turn", now_ns)
        elif now_ns - self.since_ns >= TURN_S * 1e9:
            return self.go("ahead", now_ns)
        return False

    def go(self, state: str, now_ns: int) -> bool:
        self.state, self.since_ns = state, now_ns
        return True


class HandIdle:
    """Three conditions and a time-out by hand."""

    def __init__(self, data: Callable[[str], Any]) -> None:
        self.data = data
        self.state, self.since_ns = "a", 0

    def step(self, now_ns: int) -> bool:
        if self.state == "a" and (
            self.data("zero") or self.data("zero") or self.data("zero") or now_ns - self.since_ns >= 1e15
        ):
            self.state, self.since_ns = "b", now_ns
            return True
        return False


class HandSwitch:
    """A transition in each step by hand."""

    def __init__(self, data: Callable[[str], Any]) -> None:
        self.data = data
        self.state, self.since_ns = "a", 0

    def step(self, now_ns: int) -> bool:
        if self.data("range") < NEAR_CM:
            do_nothing(self)
            self.state, self.since_ns = "b" if self.state == "a" else "a", now_ns
            do_nothing(self)
            return True
        return False


class HandCommander:
    """The same with what the blocks in LRP do: a count, and a command within limits."""

    def __init__(self, data: Callable[[str], Any]) -> None:
        self.data = data
        self.state, self.since_ns, self.count = "a", 0, 0
        self.commands = {"motor": 0.0}

    def step(self, now_ns: int) -> bool:
        if self.data("range") < NEAR_CM:
            self.command("motor", 5.0 if self.state == "a" else 0.0)
            self.state, self.since_ns = "b" if self.state == "a" else "a", now_ns
            self.count += 1
            return True
        return False

    def command(self, name: str, value: float) -> None:
        if math.isnan(value):
            raise ValueError(name)
        self.commands[name] = min(max(value, -100.0), 100.0)


def steps_of(make: Callable[[dict[str, Any]], Any], count: int, *, is_moving: bool) -> Benchmark:
    """Steps of a machine, 1 ms apart."""

    def prepare() -> Callable[[], Any]:
        pages = {"range": 10.0 if not is_moving else 100.0, "zero": False}
        step = make(pages).step

        def run() -> None:
            if is_moving:
                for i in range(count):
                    pages["range"] = range_cm(i)
                    step(i * STEP_NS)
            else:
                for i in range(count):
                    step(i * STEP_NS)

        return run

    return prepare


def interpreted(program: Program) -> Callable[[dict[str, Any]], Any]:
    def make(pages: dict[str, Any]) -> Interpreter:
        interpreter = Interpreter(program, pages, bridge=BRIDGE)
        interpreter.spawn(0)
        return interpreter

    return make


class HandEndpoint(Endpoint):
    """The explorer by hand as a component: it reports its state when it changes."""

    @handles(event="explorer.step")
    def on_step(self, task: Any) -> Any:
        now_ns = round(self.get_time_s() * 1e9)
        if self.explorer.step(now_ns):
            return self.store_data_task("explorer", {"state": self.explorer.state})
        return None

    def begin(self) -> None:
        self.explorer = HandExplorer(self.get_data)


class Ranges(Endpoint):
    """Stores the reading at each step of the machine in which it changes."""

    def begin(self) -> None:
        self.schedule(self.store_data_task("range", 100.0))

    @handles(event="explorer.step")
    def on_step(self, task: Any) -> Any:
        self.count = getattr(self, "count", -1) + 1
        if self.count % 1000 in (0, 980):
            return self.store_data_task("range", range_cm(self.count))
        return None


def run_of(component: Any, seconds: float, *, is_recorded: bool) -> Benchmark:
    """A run in lock step at 1000 steps a second."""

    def prepare() -> Callable[[], Any]:
        clock = SimClock()
        config = Config(factories={"r": [Ranges.factory(), StepLoopFactory("explorer", 1000.0), component]})
        folder = tempfile.TemporaryDirectory()
        recorder = None
        if is_recorded:
            recorder = TraceWriter(Path(folder.name) / FILE_NAME, program_header(["r"], config, __file__, clock))
        runner = SimRunner(config, clock=clock, recorder=recorder, until_s=seconds, log_notes=False)

        def run() -> None:
            try:
                runner.run()
            finally:
                if recorder is not None:
                    recorder.close()
                folder.cleanup()

        return run

    return prepare


def large_text(states: int, number: int) -> str:
    """Return a program of many states; `number` is in one of its blocks."""
    forms = [
        f"(state s{i} (onentry [count = count + {number if i == 7 else i}]) (running [total = total + {i} * 0.5]))"
        f"(on [count > {i} and total < {1000 + i}] s{i} -> s{(i + 1) % states})(ontime {100 + i} s{i} -> s0)"
        for i in range(states)
    ]
    return f"(machine m (var count := [0]) (var total := [0.0]) {' '.join(forms)})(spawn m s0)"


def editing(is_quick: bool) -> Iterator[Row]:
    """Yield how long it takes to parse a program, one of which a line has changed, and to continue with it."""
    rounds = 3 if is_quick else 15
    parse_ms, again_ms, edit_ms = [], [], []
    for i in range(rounds):
        texts = [large_text(200, 1000 * i + k).replace("total <", f"total < {i} +") for k in (1, 2)]
        times = [time.process_time()]
        programs = []
        for text in texts:
            programs.append(parse(text))
            times.append(time.process_time())
        interpreter = Interpreter(programs[0])
        interpreter.spawn(0)
        times.append(time.process_time())
        interpreter.edit(programs[1], 0)
        times.append(time.process_time())
        parse_ms.append(1e3 * (times[1] - times[0]))
        again_ms.append(1e3 * (times[2] - times[1]))
        edit_ms.append(1e3 * (times[4] - times[3]))
    yield Row("parse 200 states in LRP, nothing known", min(parse_ms), "ms")
    yield Row("parse them again, one block of them changed", min(again_ms), "ms", limit=60.0)
    yield Row("continue with the changed program", min(edit_ms), "ms", limit=2.0)


class Near:
    """What the machines of other packages belong to: their condition is that of `SWITCH`."""

    def __init__(self) -> None:
        self.pages = {"range": 10.0}

    def is_near(self) -> bool:
        return self.pages["range"] < NEAR_CM


# Each returns what takes one guarded transition of the same two states.


def of_transitions() -> Callable[[], Any]:
    import transitions

    near = Near()
    arrows = [
        {"trigger": "go", "source": a, "dest": b, "conditions": near.is_near} for a, b in (("a", "b"), ("b", "a"))
    ]
    transitions.Machine(near, ["a", "b"], initial="a", transitions=arrows, auto_transitions=False)
    return near.go  # type: ignore[attr-defined, no-any-return]


def of_statemachine() -> Callable[[], Any]:
    from statemachine import State, StateMachine

    class Switch(StateMachine):
        a, b = State(initial=True), State()
        go = a.to(b, cond="is_near") | b.to(a, cond="is_near")

    machine = Switch(Near())
    return lambda: machine.send("go")


def of_sismic() -> Callable[[], Any]:
    from sismic.interpreter import Interpreter as Sismic
    from sismic.io.datadict import import_from_dict

    states = [
        {"name": a, "transitions": [{"event": "go", "guard": "near.is_near()", "target": b}]}
        for a, b in (("a", "b"), ("b", "a"))
    ]
    root = {"name": "root", "initial": "a", "states": states}
    theirs = Sismic(
        import_from_dict({"statechart": {"name": "switch", "root state": root}}), initial_context={"near": Near()}
    )
    theirs.execute()

    def step() -> None:
        theirs.queue("go")
        theirs.execute_once()

    return step


def neighbours(count: int, rounds: int) -> Iterator[Outcome]:
    """Yield what a guarded transition takes in other packages."""

    def repeated(make: Callable[[], Callable[[], Any]]) -> Benchmark:
        def prepare() -> Callable[[], Any]:
            step = make()

            def run() -> None:
                for _ in range(count):
                    step()

            return run

        return prepare

    ours = steps_of(interpreted(SWITCH), count, is_moving=False)
    for package, make in (
        ("transitions", of_transitions), ("python-statemachine", of_statemachine), ("sismic", of_sismic),
    ):  # fmt: skip

        def row(package: str = package, make: Callable[[], Any] = make) -> Iterator[Row]:
            make()
            found = compare(ours, repeated(make), rounds=rounds)
            ours_us, theirs_us = (1e6 * one_s / count for one_s in found.shortest_s)
            name = f"a guarded transition of {package} {version(package)}"
            yield Row(name, theirs_us, "us", baseline=ours_us, compared_to="ours", ratio=found.ratios[1])

        yield from what_can_run(f"a guarded transition of {package}", row)
    yield Skipped("a guarded transition of smach", "it is part of ROS, and in no package index")


def measure(is_quick: bool) -> Iterator[Outcome]:
    """Yield the rows."""
    yield from editing(is_quick)
    yield from neighbours(500 if is_quick else 5000, 3 if is_quick else 7)
    count, rounds = (20_000, 3) if is_quick else (100_000, 15)
    for name, hand, program, is_moving, limit in (
        ("a step: three conditions and a time-out, none due", HandIdle, IDLE, False, 4.0),
        ("a step of the explorer, 1000 steps a second", HandExplorer, EXPLORER, True, 4.5),
        ("a transition: condition, exit block, entry block", HandSwitch, SWITCH, False, 8.0),
        ("a transition in LRP: reads, commands, assigns", HandCommander, LRP_SWITCH, False, 8.0),
        ("the same, beside one by hand that neither commands nor assigns", HandSwitch, LRP_SWITCH, False, None),
    ):
        by_hand = steps_of(lambda pages, hand=hand: hand(pages.get), count, is_moving=is_moving)
        found = compare(by_hand, steps_of(interpreted(program), count, is_moving=is_moving), rounds=rounds)
        hand_us, ours_us = (1e6 * one_s / count for one_s in found.shortest_s)
        yield Row(
            name, ours_us, "us", baseline=hand_us, compared_to="by hand", ratio=found.ratios[1], ratio_limit=limit
        )
    seconds = 5.0 if is_quick else 30.0
    for name, is_recorded, limit in (("in lock step", False, 1.5), ("in lock step, recorded", True, 1.3)):
        found = compare(
            run_of(HandEndpoint.factory("explorer"), seconds, is_recorded=is_recorded),
            run_of(MachineFactory(EXPLORER, "explorer"), seconds, is_recorded=is_recorded),
            rounds=rounds,
        )
        hand_us, ours_us = (1e6 * one_s / (1000.0 * seconds) for one_s in found.shortest_s)
        yield Row(
            f"the explorer as an endpoint {name}, per step", ours_us, "us", baseline=hand_us,
            compared_to="by hand", ratio=found.ratios[1], ratio_limit=limit,
        )  # fmt: skip
