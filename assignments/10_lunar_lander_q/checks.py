"""What lab 10 is graded by: functions one by one, exactly; then what they learn, and what was handed in."""

from __future__ import annotations

import random
import zipfile
from dataclasses import dataclass
from typing import Any

import msgspec

from snr_sim.grading import Lab, Student, Verdict, check, failed, partly, passed
from snr_sim.grading.lab.verdicts import Misbehaved
from snr_sim.learning.batch_training import ENVIRONMENT
from snr_sim.learning.q_table import QTable
from snr_sim.prelude.errors import RecordingError

from .grader.evidence import Change, Evidence, Rows, changed, count_of, table_of
from .grader.learning import ByTable, Flights, Trained, as_policy, fly, train
from .grader.pilot import ACTIONS, Pilot, Table, Transition
from .grader.q_rule import Ledger, diagnosis, why_not

LEGS_MPS = 3.05
FILE, POLICY = "q_lander.py", "policy.npz"
MOST_BYTES, MOST_SHOWN = 1_000_000, 1000
MET = 12  # transitions are drawn between as many states; one more leads to itself
HOVERS = (
    "It hovers until its two minutes are over. What does your reward pay for: being on the ground, or being up there?"
)


class Chosen(msgspec.Struct):
    """What choose() did."""

    actions: list[int]
    table: Rows


@dataclass(frozen=True)
class Seed:
    """Where a case's chance comes from."""

    seed: int


@dataclass(frozen=True)
class Starts:
    """So many starts, drawn from a seed."""

    count: int
    seed: int


SEEN = Starts(10, 1)


@dataclass(frozen=True)
class Elsewhere:
    """A flight where the Moon or the engine is not as usual; gravity and thrust as shares."""

    gravity: float
    thrust: float
    seed: int


def one(rng: random.Random) -> list[Seed]:
    """A hidden case."""
    return [Seed(rng.getrandbits(63))]


def three(rng: random.Random) -> list[Seed]:
    """Three hidden cases."""
    return [one(rng)[0] for _ in range(3)]


# -- the state --------------------------------------------------------------------------------------------------------


@check(points=10, visible=[Seed(1)], hidden=one)
def encodes(student: Student, case: Seed) -> Verdict:
    """encode() tells high from low, and rising from falling."""
    pilot, rng = student.host(FILE, Pilot), random.Random(case.seed)
    if count_of(pilot) == 1:
        return failed("STATES is 1: then it does the same everywhere. Cut heights and velocities into intervals.")
    speeds = [-60.0 + 0.5 * i for i in range(161)]
    for _ in range(6):
        height = 10.0 ** rng.uniform(-0.5, 3.0)
        states, again = (pilot.ask("encode", [height] * len(speeds), speeds, returns=list[int]) for _ in range(2))
        if states != again or len(states) != len(speeds):
            return failed("encode() gives another number for the same two numbers: it must go by them alone.")
        if len(set(states)) < 2:
            return failed(
                "At one height encode() does not tell any velocity from another.",
                "2 states or more from -60 to 20 m/s",
                "1 state",
            )
        folded = came_back(states)
        if folded is not None:
            return failed(
                "Two velocities far apart are one state, with other states between them: did the sign get lost? abs()?",
                "each state is one interval of velocities",
                f"{speeds[folded[0]]:g} and {speeds[folded[1]]:g} m/s are state {states[folded[1]]}",
            )
    heights = [0.3 * 1.1**i for i in range(88)]
    if len(set(pilot.ask("encode", heights, [-5.0] * len(heights), returns=list[int]))) < 2:
        return failed("encode() does not tell any height from another: at -5 m/s, 0.3 m and 1300 m are one state.")
    return passed()


def came_back(states: list[int]) -> tuple[int, int] | None:
    """Returns two places of one state that was left in between, or None."""
    last: dict[int, int] = {}
    for i, state in enumerate(states):
        if state in last and last[state] != i - 1:
            return last[state], i
        last[state] = i
    return None


# -- what is done -----------------------------------------------------------------------------------------------------


@check(points=15, visible=[Seed(1)], hidden=one)
def chooses(student: Student, case: Seed) -> Verdict:
    """choose() takes the best of what was tried, explores as often as epsilon says, and changes nothing."""
    pilot, rng = student.host(FILE, Pilot), random.Random(case.seed)
    count = count_of(pilot)
    table = drawn_table(count, rng)
    states = [rng.randrange(count) for _ in range(200)]

    def choices(epsilon: float, seed: int, of: list[int] = states) -> list[int]:
        answer = pilot.ask("choices", table.plain(), of, epsilon, seed, returns=Chosen)
        if (answer.table.values, answer.table.visits) != (table.values, table.visits):
            raise Misbehaved("choose() has changed the table.", "choose() looks, and update() learns: not both in one.")
        if len(answer.actions) != len(of):
            raise Misbehaved("There is not an action for each state.", "Return one action.")
        actions: list[int] = answer.actions
        return actions

    greedy = choices(0.0, 1)
    if greedy != choices(0.0, 1):
        return failed(
            "Same table, same states, same chance, and yet another action: choose() must go by its arguments."
        )
    if any(choices(0.0, seed) != greedy for seed in range(2, 6)):
        return failed(
            "With epsilon 0 it still explores. An evaluation with chance in it does not tell what was learned."
        )
    for state, action in zip(states, greedy, strict=True):
        if action != table.best[state]:
            return failed(why_not(table, state, action), f"{table.best[state]}", f"{action}" + shown(table, state))
    everywhere = choices(1.0, 6, states * 5)
    if min(everywhere.count(action) for action in range(ACTIONS)) < 170:
        return failed("With epsilon 1 each action should come equally often: rng.randrange(ACTIONS).")
    often = choices(0.4, 7, states * 5)
    share = sum(a == b for a, b in zip(often, greedy * 5, strict=True)) / len(often)
    if not 0.63 < share < 0.77:  # 0.7, and nearly five standard deviations to either side
        return failed(
            "With epsilon 0.4 it does not explore four times in ten.",
            "the best action in 70 % (60 %, and a quarter of 40 %)",
            f"{share:.0%}",
        )
    return passed()


def drawn_table(states: int, rng: random.Random) -> Ledger:
    """Returns a table with negative values, ties, and actions that nobody has tried."""
    table = Table(states)
    for state in range(states):
        for action in range(ACTIONS):
            if rng.random() < 0.7:
                table.visits[state][action] = rng.randrange(1, 40)
                table.values[state][action] = float(rng.choice([-8, -4, -4, -2, -1, 1, 3])) * rng.choice(
                    [1.0, 1.0, 1.5]
                )
    return Ledger(states, table)


def shown(table: Table, state: int) -> str:
    """Returns a row of a table in words."""
    return f", of values {table.values[state]} with visits {table.visits[state]}"


# -- what is learned --------------------------------------------------------------------------------------------------


@check(points=20, visible=[Seed(1)], hidden=lambda rng: three(rng)[:2])
def updates(student: Student, case: Seed) -> Verdict:
    """update() learns from 40 transitions exactly what Q-learning learns."""
    pilot, rng = student.host(FILE, Pilot), random.Random(case.seed)
    table = with_a_new_action(drawn_table(max(MET + 1, count_of(pilot)), rng))
    transitions = [*(drawn_transition(rng) for _ in range(39)), Transition(MET, 1, -1.0, MET, False, False)]
    right = Ledger(len(table.values), table)
    right.learn(transitions)
    in_a_row = replayed(pilot, table, transitions)
    for transition, now in zip(transitions, each_replayed(pilot, table, transitions), strict=True):
        alone = Ledger(len(table.values), table)
        alone.learn([transition])
        if alone.differs(now) is not None:
            return failed(diagnosis(table, transition, alone, now), *numbers(transition, alone, now))
    if right.differs(in_a_row) is not None:
        return failed("Each transition alone is learned rightly, but not all in a row: what does it keep in between?")
    return passed()


def replayed(pilot: Any, before: Table, transitions: list[Transition]) -> Table:
    """Returns what the student makes of a table by some transitions, one after the other."""
    rows = pilot.ask("replay", before.plain(), [list(one) for one in transitions], returns=Rows)
    return table_of(rows, len(before.values))


def each_replayed(pilot: Any, before: Table, transitions: list[Transition]) -> list[Table]:
    """Returns what the student makes of a table by each of some transitions alone."""
    plain = before.plain()
    changes = pilot.ask("replay_each", plain, [list(one) for one in transitions], returns=list[list[Change]])
    if len(changes) != len(transitions):
        raise Misbehaved("It did not tell what each transition changes.", "Leave alone what asks update().")
    return [changed(Table.of(plain), cells) for cells in changes]


def with_a_new_action(table: Ledger) -> Ledger:
    """Returns the same table, but that in one state all was bad so far, and action 1 was not tried."""
    table.values[MET], table.visits[MET] = [-4.0, 0.0, -2.0, -8.0], [3, 0, 5, 2]
    return Ledger(len(table.values), table)


def drawn_transition(rng: random.Random) -> Transition:
    """Returns a transition between the first states; every third ends an episode."""
    end = rng.choice(["", "", "", "terminated", "truncated", ""])
    state, next_state = rng.sample(range(MET), 2)
    return Transition(
        state,
        rng.randrange(ACTIONS),
        round(rng.uniform(-3.0, 3.0), 2),
        next_state,
        end == "terminated",
        end == "truncated",
    )


def numbers(step: Transition, right: Table, now: Table) -> tuple[str, str]:
    """Returns what the value should be, and what it is."""
    return tuple(f"values[state][action] = {table.values[step.state][step.action]:.6g}" for table in (right, now))  # type: ignore[return-value]


# -- what was handed in -----------------------------------------------------------------------------------------------


def policy_of(student: Student) -> QTable | None:
    """Returns the table that was handed in; None if there is none.

    Raises:
        Misbehaved: it cannot be used.
    """
    path = (student.folder / POLICY).resolve()
    if not path.is_file() or not path.is_relative_to(student.folder):
        return None
    with path.open("rb") as file:
        begin = file.read(2)
    if begin[:1] == b"\x80":
        raise Misbehaved(
            f"{POLICY} is a pickle.",
            "Whoever opens a pickle runs what is in it, so nobody here does. learn.py saves numbers alone.",
        )
    if path.stat().st_size > MOST_BYTES:
        raise Misbehaved(f"{POLICY} has {path.stat().st_size} bytes.", f"A table has less than {MOST_BYTES} bytes.")
    try:
        with zipfile.ZipFile(path) as archive:
            size = sum(member.file_size for member in archive.infolist())
    except (zipfile.BadZipFile, OSError):
        raise Misbehaved(
            f"{POLICY} is no npz file, or only a part of one.",
            "Let learn.py write it again, and copy all of it."
            if begin == b"PK"
            else "Hand in what learn.py has saved.",
        ) from None
    if size > MOST_BYTES:
        raise Misbehaved(f"{POLICY} unpacks to {size} bytes.", f"A table has less than {MOST_BYTES} bytes.")
    try:
        table = QTable.load(path, ENVIRONMENT)
    except RecordingError as error:
        wrong = str(error).replace(str(path), POLICY)[:MOST_SHOWN]
        raise Misbehaved(wrong, "Hand in what learn.py has saved, unchanged.") from None
    if len(table.discretiser.names) != 2 or len(table.actions) != ACTIONS:
        raise Misbehaved(
            f"{POLICY} is about {', '.join(table.discretiser.names)}, with {len(table.actions)} actions.",
            f"It is flown by altitude_m and velocity_mps, with {ACTIONS} actions.",
        )
    return table


@check(points=5)
def policy_file(student: Student) -> Verdict:
    """policy.npz is a table of numbers, of less than a megabyte."""
    table = policy_of(student)
    if table is None:
        return failed(
            "There is no policy.npz: python learn.py makes it. Without it, what q_lander.py learns here flies."
        )
    return passed()


def pilot_of(student: Student) -> tuple[ByTable, Evidence | None]:
    """Returns who flies: the table that was handed in, or what is learned here; and of that the evidence."""
    table = policy_of(student)
    if table is not None:
        return ByTable(table), None
    evidence, _ = trained(student, 0)
    return ByTable(as_policy(evidence)), evidence


def trained(student: Student, seed: int) -> tuple[Evidence, Trained]:
    """Returns what is learned in a training of the file, and how that went.

    Raises:
        Misbehaved: it does not train.
    """
    pilot = student.host(FILE, Pilot)
    evidence = Evidence(pilot, seed)
    took = train(pilot, seed, evidence=evidence)
    return evidence, took


def confirm(student: Student, evidence: Evidence | None) -> None:
    """Makes sure, before there are points for it, that what flew is what the student's functions make.

    Raises:
        Misbehaved: update() has learned something else, or encode() says something else in a new process.
    """
    if evidence is not None:
        evidence.check_update()
        student.close()
        evidence.check_states(student.host(FILE, Pilot))


@check(points=25, visible=[SEEN], hidden=lambda rng: [Starts(100, case.seed) for case in three(rng)])
def lands(student: Student, case: Starts) -> Verdict:
    """The policy lands: all points from 95 of 100 starts, none below 50."""
    pilot, evidence = pilot_of(student)
    flown = fly(pilot, case.seed, case.count)
    if flown.share > 0.5:
        confirm(student, evidence)
    metrics = {"landed": flown.share} | ({"fuel_kg": flown.fuel_kg} if any(flown.landed) else {})
    if flown.share >= 0.95:
        return passed(metrics=metrics)
    hint = why_down(flown, evidence)
    is_low = evidence is None and flown.share < 0.75
    if is_low and fly(pilot, SEEN.seed, SEEN.count).share > flown.share + 0.2:
        hint = "It lands the starts that you can see and not others: it was trained on what it is tested with."
    return partly((flown.share - 0.5) / 0.45, hint, "95 of 100 or more", told(flown), metrics)


def why_down(flown: Flights, evidence: Evidence | None) -> str:
    """Returns what to think about when landings fail."""
    if evidence is not None:
        if evidence.states == 1:
            return "STATES is 1, so it does the same wherever it is, and nothing that it learns can land. Step 1 first."
        if not any(any(tries[1:]) for tries in evidence.ledger.visits):
            return "Only action 0 was ever tried: epsilon() asks for no chance, so nothing else can be found out."
        if not any(map(any, evidence.ledger.values)):
            return "All rewards were 0, so there was nothing to learn: what does reward() pay for?"
    if flown.outcomes["timeout"] > 0.1 * len(flown.landed):
        return HOVERS
    often = " The average is slow enough, and too many are not." if flown.touchdown_mps <= LEGS_MPS else ""
    return (
        f"It comes down at {flown.touchdown_mps:.1f} m/s on average; the legs take {LEGS_MPS}.{often} "
        "Finer states near the ground?"
    )


def told(flown: Flights) -> str:
    """Returns what came of flights, in words."""
    return ", ".join(f"{count} {outcome}" for outcome, count in flown.outcomes.items())


@check(points=15, visible=[Seed(1)], hidden=three, needs=["encodes", "chooses", "updates"], all_or_nothing=True)
def learns(student: Student, case: Seed) -> Verdict:
    """Trained here, for 80 000 steps, the file lands 80 of 100 starts: from every seed, in one of two trainings."""
    for again in (0, 2):
        evidence, took = trained(student, case.seed + again)
        flown = fly(ByTable(as_policy(evidence)), case.seed + again + 1, 100)
        if not 0.0 < flown.share < 0.8:
            break  # else it may have been bad luck, as one good training in a thousand has; but not two of them
    if flown.share >= 0.8:
        confirm(student, evidence)
        return passed(metrics={"landed_after_training": flown.share})
    hint = why_down(flown, evidence)
    if sum(took.landed[-100:]) > 60:
        hint += " (In training it landed more often than in this test.)"
    return failed(hint, "80 of 100 or more", f"{told(flown)}, after {took.episodes} episodes")


@check(
    points=10,
    visible=[Elsewhere(1.1, 0.9, 1)],
    hidden=lambda rng: [Elsewhere(g, t, rng.getrandbits(63)) for g in (0.9, 1.1) for t in (0.9, 1.1)],
)
def is_sturdy(student: Student, case: Elsewhere) -> Verdict:
    """It also lands where gravity and thrust are a tenth more or less: all points from 75 of 100, none below 40."""
    pilot, evidence = pilot_of(student)
    flown = fly(pilot, case.seed, 100, case.gravity, case.thrust)
    if flown.share > 0.4:
        confirm(student, evidence)
    if flown.share >= 0.75:
        return passed()
    return partly((flown.share - 0.4) / 0.35, why_down(flown, evidence), "75 of 100 or more", told(flown))


lab = Lab(
    "Lunar lander: Q-learning",
    files=[FILE],  # and policy.npz, which may be missing
    checks=[encodes, chooses, updates, policy_file, lands, learns, is_sturdy],
    refused={"snr_sim.learning": "it is this lab, solved"},
    leaderboard={"lands.fuel_kg": "asc"},
)
