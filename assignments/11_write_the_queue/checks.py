"""Checks of lab 11: random operations on a queue, their cost, and a real node that uses it."""

from __future__ import annotations

import random
import time
from bisect import insort
from collections import deque
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

from snr_sim.grading import Lab, Student, Verdict, check, failed, passed
from snr_sim.grading.lab.submission import MAX_SOURCE_BYTES

from .grader.plain_queue import PlainQueue
from .grader.queue_bench import QueueBench
from .grader.restricted_code import find_forbidden_construct

FILE = "task_queue.py"
TERMINATE, KINDS = "terminate", ("event", "event", "store_page", "process_data")
ROOMY = 10_000
SMALL, LARGE, MANY, MORE = 40, 240, 20_000, 2000
MORE_WORK = 2.5  # for six times as many tasks: a logarithm makes 1.5 of it, looking through all of them makes 6


@dataclass(frozen=True)
class Seed:
    """Where a case's operations come from."""

    seed: int


def draw_case(rng: random.Random) -> list[Seed]:
    """A hidden case."""
    return [Seed(rng.getrandbits(63))]


def operations(rng: random.Random, count: int, priorities: list[int], puts: float = 0.55) -> list[list[Any]]:
    """Return operations in an order that was drawn; in the end all that is left is taken."""
    drawn: list[list[Any]] = []
    for i in range(count):
        if rng.random() < puts:
            kind = rng.choice(KINDS)
            drawn.append(["put", kind, f"{kind}_{i}", rng.choice(priorities)])
        else:
            drawn.append([rng.choice(["take", "take", "take", "len"])])
    return [*drawn, ["len"], *([["take"]] * (count // 5)), ["len"]]


def all_different(rng: random.Random, asked: list[list[Any]]) -> list[list[Any]]:
    """Return the operations with another priority in each put."""
    different = iter(rng.sample(range(-1000, 1000), len(asked)))
    return [[*one[:3], next(different)] if one[0] == "put" else one for one in asked]


def expected_results(max_tasks: int, asked: list[list[Any]]) -> list[Any]:
    """Return the right answers to some operations."""
    return QueueBench(SimpleNamespace(TaskQueue=PlainQueue)).answers(max_tasks, asked)


def first_wrong(student: Student, max_tasks: int, asked: list[list[Any]]) -> tuple[int, Any, Any] | None:
    """Return which answer of the student's is the first wrong one, with the right one and theirs; or None."""
    answers = student.create_object(FILE, QueueBench).ask("answers", max_tasks, asked, returns=list[str | int | None])
    pairs = zip(expected_results(max_tasks, asked), [*answers, *asked][: len(asked)], strict=True)  # missing is wrong
    return next(((i, a, b) for i, (a, b) in enumerate(pairs) if a != b or type(a) is not type(b)), None)


def expected_and_actual(asked: list[list[Any]], i: int, expected: Any, actual: Any) -> tuple[str, str]:
    """Return what an operation should have answered, and what it did."""
    what = f"{asked[i][0]}() number {i + 1}"
    return f"{what} gives {expected}", f"{actual}"


@check(points=5)
def is_plain(student: Student) -> Verdict:
    """It uses only lists, dicts, deque, heapq, bisect, math, and classes of the file."""
    what = student.parse(FILE, find_forbidden_construct, MAX_SOURCE_BYTES)
    if not what:
        return passed()
    return failed(
        "Use only lists, dicts, deque, heapq, bisect, math and your own classes: remove this construct.",
        "no access beyond the file",
        f"{FILE}, {what}",
    )


@check(points=10, visible=[Seed(1)], hidden=draw_case, needs=["is_plain"])
def keeps_order(student: Student, case: Seed) -> Verdict:
    """Tasks of one priority leave in the order in which they came."""
    asked = operations(random.Random(case.seed), 300, [0])
    wrong = first_wrong(student, ROOMY, asked)
    if wrong is None:
        return passed()
    i, expected, actual = wrong
    if asked[i] == ["len"]:
        hint = "len() must return the number of waiting tasks."
        return failed(hint, *expected_and_actual(asked, i, expected, actual))
    if asked[i][0] == "put":
        return failed(
            "The queue is not full, so put() must return None.",
            *expected_and_actual(asked, i, expected, actual),
        )
    if expected is None:
        return failed("take() must return None when no task waits.", *expected_and_actual(asked, i, expected, actual))
    newest = [one[2] for one in asked[:i] if one[0] == "put"][-1]
    hint = "That is not the task that has waited longest."
    if actual == newest:
        hint = "The newest task leaves first: that is a stack. In a queue the oldest task leaves first."
    elif isinstance(actual, str) and actual < expected:
        hint = "The alphabetically first task leaves, not the oldest: does a heap compare names here?"
    return failed(hint, *expected_and_actual(asked, i, expected, actual))


@check(points=15, visible=[Seed(1)], hidden=draw_case, needs=["is_plain"])
def urgent_first(student: Student, case: Seed) -> Verdict:
    """Higher priorities leave first, be they positive or negative."""
    rng = random.Random(case.seed)
    asked = all_different(rng, operations(rng, 400, [0]))
    wrong = first_wrong(student, ROOMY, asked)
    if wrong is None:
        return passed()
    i, expected, actual = wrong
    priority = {one[2]: one[3] for one in asked if one[0] == "put"}
    hint = "take() must return the waiting task of the highest priority."
    if expected in priority and actual in priority and priority[actual] < priority[expected]:
        hint = "A task of a higher priority was waiting: 10 before 9, and 0 before -3."
    return failed(hint, *expected_and_actual(asked, i, expected, actual))


@check(points=10, visible=[Seed(1)], hidden=draw_case, needs=["is_plain"])
def terminate_first(student: Student, case: Seed) -> Verdict:
    """Terminate leaves before all others, whatever its priority."""
    rng = random.Random(case.seed)
    asked: list[list[Any]] = []
    for i in range(20):  # each time some wait, then it comes, then some more; and it is taken first
        others = [["put", rng.choice(KINDS), f"task_{i}_{k}", 0] for k in range(rng.randrange(2, 6))]
        others.insert(rng.randrange(len(others)), ["put", TERMINATE, f"terminate_{i}", 0])
        asked += [*others, ["take"], ["take"]]
    asked = all_different(rng, asked)
    for one in asked:  # whatever it was put with
        if one[1:2] == [TERMINATE]:
            one[3] = rng.choice([-2000, 0, 2000])
    wrong = first_wrong(student, ROOMY, asked)
    if wrong is None:
        return passed()
    i, expected, actual = wrong
    hint = "With terminate tasks between them, the other tasks leave in a wrong order."
    if str(expected).startswith(TERMINATE):
        hint = "A terminate task was waiting: it must leave before all other tasks."
    return failed(hint, *expected_and_actual(asked, i, expected, actual))


@check(points=20, visible=[Seed(1)], hidden=draw_case, needs=["is_plain"])
def is_bounded(student: Student, case: Seed) -> Verdict:
    """A full queue drops the oldest task of the lowest priority, and returns it."""
    rng = random.Random(case.seed)
    max_tasks = rng.randrange(5, 12)
    asked = operations(rng, 400, [-5, 0, 3, 8], puts=0.75)
    wrong = first_wrong(student, max_tasks, asked)
    if wrong is None:
        return passed()
    i, expected, actual = wrong
    hint = "Another task should be waiting: which task had to be dropped when the queue was full?"
    if asked[i] == ["len"]:
        hint = "More tasks wait than max_tasks: a queue that grows without limit fills the robot's memory."
    if asked[i][0] == "put":
        hint = "The wrong task is dropped: drop the oldest of the lowest priority, even if it is the new one."
        if actual is None:
            hint = "The queue is full, and put() returns None: it must drop one task, and return it to the caller."
        elif actual == asked[i][2]:
            hint = (
                "The new task is dropped although an older one of the same or a lower priority waits. Drop the older."
            )
    return failed(hint, *expected_and_actual(asked, i, expected, actual))


@check(points=10, visible=[Seed(1)], hidden=draw_case, needs=["urgent_first"])
def forgets(student: Student, case: Seed) -> Verdict:
    """Tasks that have left free their memory: after 2000 operations no more is used than after 200."""
    rng = random.Random(case.seed)
    max_tasks = 20
    asked: list[list[Any]] = []
    for i in range(1000):  # ever other priorities: some leave at the top, and some at the bottom
        asked.append(["put", "event", f"e{i}", rng.choice([-1, 1]) * (1000 + i)])
        asked += [["take"]] * (rng.random() < 0.6)
    for up in (1, -1):  # every task that comes leaves again, at one end only
        asked += [one for i in range(500) for one in (["put", "event", f"f{i}", up * (5000 + i)], ["take"])]
    bench = student.create_object(FILE, QueueBench)
    *_, waiting = bench.ask("answers", max_tasks, [*asked, ["len"]], returns=list[str | int | None])
    if not isinstance(waiting, int) or waiting > max_tasks:
        return failed("More tasks wait than max_tasks, and are never dropped.", f"at most {max_tasks}", f"{waiting}")
    places = bench.ask("places", max_tasks, asked, returns=int)
    if places <= 20 * max_tasks + 200:
        return passed()
    return failed(
        "Tasks that have left still use memory: empty lines, or priorities in a heap without a task.",
        f"at most {20 * max_tasks + 200} places in lists, dicts and deques",
        f"{places}, with room for {max_tasks} tasks",
    )


@check(points=15, visible=[Seed(1)], hidden=draw_case, needs=["urgent_first"])
def is_quick(student: Student, case: Seed) -> Verdict:
    """With six times as many tasks one operation is hardly more work."""
    bench, rng = student.create_object(FILE, QueueBench), random.Random(case.seed)
    work = {}
    for size in (SMALL, LARGE):
        asked = [["put", "event", f"e{i}", rng.randrange(10_000)] for i in range(size)]
        asked += [["take"] if i % 2 else ["put", "event", f"f{i}", rng.randrange(10_000)] for i in range(size)]
        work[size] = bench.ask("work", size, asked, returns=float)
    if work[LARGE] <= MORE_WORK * work[SMALL] + 5.0:
        return check_many_tasks(student, rng) or passed(metrics={"work": work[LARGE]})
    return failed(
        "The work per operation grows with the number of tasks: pop(0), insert, sort, min, max and `in` scan a list.",
        f"with {LARGE} tasks at most {MORE_WORK:g} times the work of {SMALL}",
        f"{work[SMALL]:.0f} comparisons and moves with {SMALL} tasks, {work[LARGE]:.0f} with {LARGE}",
    )


def check_many_tasks(student: Student, rng: random.Random) -> Verdict | None:
    """Return what is wrong while very many tasks wait, or None.

    Comparisons of priorities that were converted to plain numbers are not counted. But a scan of 20 000 takes 100 times
    as long as a good operation. So CPU time decides, relative to that of a first-in, first-out queue here and now.
    """
    asked = [["put", "event", f"e{i}", rng.getrandbits(40)] for i in range(MANY)]
    more = [["put", "event", f"f{i}", rng.getrandbits(40)] if i % 2 else ["take"] for i in range(MORE)]
    bench = student.create_object(FILE, QueueBench)
    bench.ask("answers", MANY + MORE, asked)
    before_s = student.cpu_time_s
    actual = bench.ask("more_answers", more, budget_s=30.0)
    after_s = student.cpu_time_s
    waiting = sorted((one[3], -i, one[2]) for i, one in enumerate(asked))
    expected: list[str | None] = []
    for i, one in enumerate(more):
        if one[0] == "put":
            insort(waiting, (one[3], -MANY - i, one[2]))
        expected.append(None if one[0] == "put" else waiting.pop()[2])
    if actual != expected:
        return failed("With very many tasks, wrong tasks leave.", f"{MORE} right answers", "wrong answers")
    limit_s = 0.05 + fifo_cpu_time_s(asked)
    if before_s is None or after_s is None or after_s - before_s <= limit_s:
        return None
    return failed(
        "The time per operation grows with the number of tasks: an operation scans all of them.",
        f"{MORE} operations with {MANY} tasks in no more CPU time than {MANY} of a plain queue: {limit_s:.2f} s",
        f"{after_s - before_s:.2f} s",
    )


def fifo_cpu_time_s(asked: list[list[Any]]) -> float:
    """Return the CPU time in which a queue without priorities accepts some tasks, and returns them."""
    bench = QueueBench(SimpleNamespace(TaskQueue=Fifo))
    before_s = time.process_time()
    bench.answers(0, [*asked, *[["take"]] * len(asked)])
    return time.process_time() - before_s


class Fifo:
    """First come, first served."""

    def __init__(self, max_tasks: int) -> None:
        self._waiting: deque[Any] = deque()

    def __len__(self) -> int:
        return len(self._waiting)

    def put(self, task: Any, priority: int) -> None:
        """Add a task."""
        self._waiting.append(task)

    def take(self) -> Any:
        """Return the oldest task."""
        return self._waiting.popleft()


@check(points=15, visible=[Seed(1)], hidden=draw_case, needs=["is_plain"])
def drives_a_node(student: Student, case: Seed) -> Verdict:
    """A real node handles its tasks in the right order with this queue, and ends."""
    rng = random.Random(case.seed)
    names = [f"t{i}" for i in range(60)]
    answers = {
        name: [[rng.choice(["event", "process_data"]), other] for other in rng.sample(names[i + 1 :], min(2, 59 - i))]
        for i, name in enumerate(names)
    }
    first = [["event", name] for name in rng.sample(names[:12], 6)]
    bench, max_tasks = QueueBench(SimpleNamespace(TaskQueue=PlainQueue)), rng.choice([8, 15])
    order = bench.run_node(max_tasks, answers, first)["handled"]
    last = order[len(order) // 2]  # its handler ends the node, while others wait
    answers[last] = [*answers[last], [TERMINATE, "enough"]]
    expected = bench.run_node(max_tasks, answers, first)
    actual = student.create_object(FILE, QueueBench).ask(
        "run_node", max_tasks, answers, first, returns=dict[str, list[str]]
    )
    if actual == expected:
        return passed()
    order, theirs = expected["handled"], actual.get("handled", [])
    i = next((i for i, (a, b) in enumerate(zip(order, theirs, strict=False)) if a != b), min(len(order), len(theirs)))
    if order == theirs:
        hint = "The node handles the right tasks, but put() does not return the dropped ones."
        return failed(hint, f"{len(expected['dropped'])} dropped tasks", f"{len(actual.get('dropped', []))}")
    hint = "The node does not handle its tasks in the order of their priorities."
    if order[i : i + 1] == ["enough"]:
        hint = "The node should have ended here: terminate waits behind other tasks."
    return failed(hint, f"task {i + 1} is {order[i : i + 1]}", f"{theirs[i : i + 1]}")


lab = Lab(
    "Write the queue",
    files=[FILE],
    checks=[is_plain, keeps_order, urgent_first, terminate_first, is_bounded, forgets, is_quick, drives_a_node],
    leaderboard={"is_quick.work": "asc"},
)
