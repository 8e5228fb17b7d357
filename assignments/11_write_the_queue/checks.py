"""What lab 11 is graded by: drawn questions to a queue, how much work it does, and a real node that it drives."""

from __future__ import annotations

import random
import time
from bisect import insort
from collections import deque
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

from snr_sim.grading import Lab, Student, Verdict, check, failed, passed
from snr_sim.grading.lab.student import MAX_SOURCE_BYTES

from .grader.plain_code import what_is_not_plain
from .grader.plain_queue import PlainQueue
from .grader.queue_bench import QueueBench

FILE = "task_queue.py"
TERMINATE, KINDS = "terminate", ("event", "event", "store_page", "process_data")
ROOMY = 10_000
SMALL, LARGE, MANY, MORE = 40, 240, 20_000, 2000
MORE_WORK = 2.5  # for six times as many tasks: a logarithm makes 1.5 of it, looking through all of them makes 6


@dataclass(frozen=True)
class Seed:
    """Where a case's operations come from."""

    seed: int


def one(rng: random.Random) -> list[Seed]:
    """A hidden case."""
    return [Seed(rng.getrandbits(63))]


def operations(rng: random.Random, count: int, priorities: list[int], puts: float = 0.55) -> list[list[Any]]:
    """Returns operations in an order that was drawn; in the end all that is left is taken."""
    drawn: list[list[Any]] = []
    for i in range(count):
        if rng.random() < puts:
            kind = rng.choice(KINDS)
            drawn.append(["put", kind, f"{kind}_{i}", rng.choice(priorities)])
        else:
            drawn.append([rng.choice(["take", "take", "take", "len"])])
    return [*drawn, ["len"], *([["take"]] * (count // 5)), ["len"]]


def all_different(rng: random.Random, asked: list[list[Any]]) -> list[list[Any]]:
    """Returns the operations with another priority in each put."""
    different = iter(rng.sample(range(-1000, 1000), len(asked)))
    return [[*one[:3], next(different)] if one[0] == "put" else one for one in asked]


def right(most: int, asked: list[list[Any]]) -> list[Any]:
    """Returns the right answers to some operations."""
    return QueueBench(SimpleNamespace(TaskQueue=PlainQueue)).answers(most, asked)


def first_wrong(student: Student, most: int, asked: list[list[Any]]) -> tuple[int, Any, Any] | None:
    """Returns which answer of the student's is the first wrong one, with the right one and theirs; or None."""
    answers = student.host(FILE, QueueBench).ask("answers", most, asked, returns=list[str | int | None])
    pairs = zip(right(most, asked), [*answers, *asked][: len(asked)], strict=True)  # what is missing is wrong
    return next(((i, a, b) for i, (a, b) in enumerate(pairs) if a != b or type(a) is not type(b)), None)


def told(asked: list[list[Any]], i: int, wanted: Any, came: Any) -> tuple[str, str]:
    """Returns what an operation should have answered, and what it did."""
    what = f"{asked[i][0]}() number {i + 1}"
    return f"{what} gives {wanted}", f"{came}"


@check(points=5)
def is_plain(student: Student) -> Verdict:
    """It is a queue of your own: lists, dicts, deque, heapq, bisect, math, and classes that stand in the file."""
    what = student.parse(FILE, what_is_not_plain, MAX_SOURCE_BYTES)
    if not what:
        return passed()
    return failed(
        "A queue needs lists, dicts, deque, heapq, bisect, classes of your own: leave out what reaches further.",
        "nothing that reaches out of the file",
        f"{FILE}, {what}",
    )


@check(points=10, visible=[Seed(1)], hidden=one, needs=["is_plain"])
def keeps_order(student: Student, case: Seed) -> Verdict:
    """Tasks of one priority leave in the order in which they came."""
    asked = operations(random.Random(case.seed), 300, [0])
    wrong = first_wrong(student, ROOMY, asked)
    if wrong is None:
        return passed()
    i, wanted, came = wrong
    if asked[i] == ["len"]:
        return failed("len() is not how many tasks wait.", *told(asked, i, wanted, came))
    if asked[i][0] == "put":
        return failed(
            "put() returns the task that has to leave, and here nobody has to: None.", *told(asked, i, wanted, came)
        )
    if wanted is None:
        return failed("take() returns None when no task waits.", *told(asked, i, wanted, came))
    newest = [one[2] for one in asked[:i] if one[0] == "put"][-1]
    hint = "That is not the task that has waited longest."
    if came == newest:
        hint = "The newest task leaves first: that is a stack. In a queue the oldest one does."
    elif isinstance(came, str) and came < wanted:
        hint = "Not the oldest task leaves but the first of the alphabet: does a heap compare names here?"
    return failed(hint, *told(asked, i, wanted, came))


@check(points=15, visible=[Seed(1)], hidden=one, needs=["is_plain"])
def urgent_first(student: Student, case: Seed) -> Verdict:
    """Higher priorities leave first, be they positive or negative."""
    rng = random.Random(case.seed)
    asked = all_different(rng, operations(rng, 400, [0]))
    wrong = first_wrong(student, ROOMY, asked)
    if wrong is None:
        return passed()
    i, wanted, came = wrong
    priority = {one[2]: one[3] for one in asked if one[0] == "put"}
    hint = "That is not the task whose turn it is: the one of the highest priority that waits."
    if wanted in priority and came in priority and priority[came] < priority[wanted]:
        hint = "A task of a higher priority was waiting: 10 before 9, and 0 before -3."
    return failed(hint, *told(asked, i, wanted, came))


@check(points=10, visible=[Seed(1)], hidden=one, needs=["is_plain"])
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
    i, wanted, came = wrong
    hint = "With terminate tasks between them the others come in a wrong order."
    if str(wanted).startswith(TERMINATE):
        hint = "A terminate task was waiting: a robot that is told to end does not finish its queue first."
    return failed(hint, *told(asked, i, wanted, came))


@check(points=20, visible=[Seed(1)], hidden=one, needs=["is_plain"])
def is_bounded(student: Student, case: Seed) -> Verdict:
    """A full queue lets the oldest of the lowest priority go, and says which."""
    rng = random.Random(case.seed)
    most = rng.randrange(5, 12)
    asked = operations(rng, 400, [-5, 0, 3, 8], puts=0.75)
    wrong = first_wrong(student, most, asked)
    if wrong is None:
        return passed()
    i, wanted, came = wrong
    hint = "Another task should be waiting by now: which one had to leave, when the queue was full?"
    if asked[i] == ["len"]:
        hint = "More tasks wait than may: a queue that grows without end fills the robot's memory."
    if asked[i][0] == "put":
        hint = (
            "The wrong task leaves the full queue: it is the oldest of the lowest priority, be it the new one itself."
        )
        if came is None:
            hint = (
                "The queue is full, and put() returns nobody: one task has to leave, and whoever called is told which."
            )
        elif came == asked[i][2]:
            hint = "The new task is turned away, though an older one of no higher priority waits. News counts more."
    return failed(hint, *told(asked, i, wanted, came))


@check(points=10, visible=[Seed(1)], hidden=one, needs=["urgent_first"])
def forgets(student: Student, case: Seed) -> Verdict:
    """What has left leaves nothing behind: after 2000 operations no more memory is held than after 200."""
    rng = random.Random(case.seed)
    most = 20
    asked: list[list[Any]] = []
    for i in range(1000):  # ever other priorities: some leave at the top, and some at the bottom
        asked.append(["put", "event", f"e{i}", rng.choice([-1, 1]) * (1000 + i)])
        asked += [["take"]] * (rng.random() < 0.6)
    for up in (1, -1):  # every task that comes leaves again, at one end only
        asked += [one for i in range(500) for one in (["put", "event", f"f{i}", up * (5000 + i)], ["take"])]
    bench = student.host(FILE, QueueBench)
    *_, waiting = bench.ask("answers", most, [*asked, ["len"]], returns=list[str | int | None])
    if not isinstance(waiting, int) or waiting > most:
        return failed("More tasks wait than may, and are never forgotten.", f"at most {most}", f"{waiting}")
    places = bench.ask("places", most, asked, returns=int)
    if places <= 20 * most + 200:
        return passed()
    return failed(
        "Something is left behind by tasks that are long gone: empty lines, or priorities in a heap that nobody has.",
        f"at most {20 * most + 200} places in lists, dicts and deques",
        f"{places}, with room for {most} tasks",
    )


@check(points=15, visible=[Seed(1)], hidden=one, needs=["urgent_first"])
def is_quick(student: Student, case: Seed) -> Verdict:
    """With six times as many tasks one operation is hardly more work."""
    bench, rng = student.host(FILE, QueueBench), random.Random(case.seed)
    work = {}
    for size in (SMALL, LARGE):
        asked = [["put", "event", f"e{i}", rng.randrange(10_000)] for i in range(size)]
        asked += [["take"] if i % 2 else ["put", "event", f"f{i}", rng.randrange(10_000)] for i in range(size)]
        work[size] = bench.ask("work", size, asked, returns=float)
    if work[LARGE] <= MORE_WORK * work[SMALL] + 5.0:
        return goes_on(student, rng) or passed(metrics={"work": work[LARGE]})
    return failed(
        "The more tasks wait, the more work each is: pop(0), insert, sort, min, max and `in` go through a whole list.",
        f"with {LARGE} tasks at most {MORE_WORK:g} times the work of {SMALL}",
        f"{work[SMALL]:.0f} comparisons and moves with {SMALL} tasks, {work[LARGE]:.0f} with {LARGE}",
    )


def goes_on(student: Student, rng: random.Random) -> Verdict | None:
    """Returns what is wrong while very many tasks wait, or None.

    Who makes plain numbers of priorities compares them unseen. But to look through 20 000 takes a hundred times as long
    as a good operation. So CPU time tells, as the kernel counts it, beside what a line at a baker's takes here and now.
    """
    asked = [["put", "event", f"e{i}", rng.getrandbits(40)] for i in range(MANY)]
    more = [["put", "event", f"f{i}", rng.getrandbits(40)] if i % 2 else ["take"] for i in range(MORE)]
    bench = student.host(FILE, QueueBench)
    bench.ask("answers", MANY + MORE, asked)
    before_s = student.worked_s
    came = bench.ask("more_answers", more, budget_s=30.0)
    after_s = student.worked_s
    waiting = sorted((one[3], -i, one[2]) for i, one in enumerate(asked))
    wanted: list[str | None] = []
    for i, one in enumerate(more):
        if one[0] == "put":
            insort(waiting, (one[3], -MANY - i, one[2]))
        wanted.append(None if one[0] == "put" else waiting.pop()[2])
    if came != wanted:
        return failed("With very many tasks others leave than with few.", f"{MORE} right answers", "others")
    limit_s = 0.05 + of_a_line_s(asked)
    if before_s is None or after_s is None or after_s - before_s <= limit_s:
        return None
    return failed(
        "The more tasks wait, the longer each takes: something looks through all of them.",
        f"{MORE} operations with {MANY} tasks in no more CPU time than {MANY} of a plain line: {limit_s:.2f} s",
        f"{after_s - before_s:.2f} s",
    )


def of_a_line_s(asked: list[list[Any]]) -> float:
    """Returns the CPU time in which a line that is deaf to priorities takes some tasks in, and gives them back."""
    bench = QueueBench(SimpleNamespace(TaskQueue=Line))
    before_s = time.process_time()
    bench.answers(0, [*asked, *[["take"]] * len(asked)])
    return time.process_time() - before_s


class Line:
    """First come, first served."""

    def __init__(self, most: int) -> None:
        self._waiting: deque[Any] = deque()

    def __len__(self) -> int:
        return len(self._waiting)

    def put(self, task: Any, priority: int) -> None:
        """Lets a task in."""
        self._waiting.append(task)

    def take(self) -> Any:
        """Returns the oldest."""
        return self._waiting.popleft()


@check(points=15, visible=[Seed(1)], hidden=one, needs=["is_plain"])
def drives_a_node(student: Student, case: Seed) -> Verdict:
    """A real node handles its tasks in the right order with this queue, and ends."""
    rng = random.Random(case.seed)
    names = [f"t{i}" for i in range(60)]
    answers = {
        name: [[rng.choice(["event", "process_data"]), other] for other in rng.sample(names[i + 1 :], min(2, 59 - i))]
        for i, name in enumerate(names)
    }
    first = [["event", name] for name in rng.sample(names[:12], 6)]
    bench, most = QueueBench(SimpleNamespace(TaskQueue=PlainQueue)), rng.choice([8, 15])
    order = bench.run_node(most, answers, first)["handled"]
    last = order[len(order) // 2]  # whoever handles this ends the node, while others wait
    answers[last] = [*answers[last], [TERMINATE, "enough"]]
    wanted = bench.run_node(most, answers, first)
    came = student.host(FILE, QueueBench).ask("run_node", most, answers, first, returns=dict[str, list[str]])
    if came == wanted:
        return passed()
    order, theirs = wanted["handled"], came.get("handled", [])
    i = next((i for i, (a, b) in enumerate(zip(order, theirs, strict=False)) if a != b), min(len(order), len(theirs)))
    if order == theirs:
        hint = "The node handles the right tasks, but put() does not return those that had to leave."
        return failed(hint, f"{len(wanted['dropped'])} tasks that had to leave", f"{len(came.get('dropped', []))}")
    hint = "The node handles its tasks in another order than their priorities say."
    if order[i : i + 1] == ["enough"]:
        hint = "The node should have ended here: terminate waits behind others."
    return failed(hint, f"task {i + 1} is {order[i : i + 1]}", f"{theirs[i : i + 1]}")


lab = Lab(
    "Write the queue",
    files=[FILE],
    checks=[is_plain, keeps_order, urgent_first, terminate_first, is_bounded, forgets, is_quick, drives_a_node],
    leaderboard={"is_quick.work": "asc"},
)
