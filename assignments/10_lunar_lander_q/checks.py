"""Checks of lab 10: each function exactly; then what they learn, and the submitted policy."""

from __future__ import annotations

import random
from dataclasses import dataclass
from typing import Any

import msgspec

from snr_sim.errors import RecordingError
from snr_sim.grading import Lab, Student, SubmissionError, Verdict, check, failed, partial_credit, passed
from snr_sim.learning import QTable
from snr_sim.learning.batch_training import ENVIRONMENT

from .grader.evidence import Change, Evidence, Rows, apply_changes, count_of, table_of
from .grader.learning import LandingStats, TablePolicy, TrainingResult, policy_table, simulate_landings, train
from .grader.pilot import ACTIONS, StudentPolicy, Table, Transition
from .grader.q_rule import ReferenceTable, choice_error, diagnosis

LEGS_MPS = 3.05
FILE, POLICY = "q_lander.py", "policy.npz"
MAX_BYTES, MAX_SHOWN = 1_000_000, 1000
MET = 12  # transitions are drawn between as many states; one more leads to itself
HOVERS = "It hovers until its two minutes are over. Does your reward() pay for landing, or for staying in the air?"


class Chosen(msgspec.Struct):
    """What choose() did."""

    actions: list[int]
    table: Rows


@dataclass(frozen=True)
class Seed:
    """Seed of a case's random numbers."""

    seed: int


@dataclass(frozen=True)
class Starts:
    """So many starts, drawn from a seed."""

    count: int
    seed: int


SEEN = Starts(10, 1)


@dataclass(frozen=True)
class PlantVariation:
    """A flight with changed gravity and thrust; both as factors."""

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
    """encode() distinguishes high from low, and rising from falling."""
    pilot, rng = student.create_object(FILE, StudentPolicy), random.Random(case.seed)
    if count_of(pilot) == 1:
        return failed(
            "STATES is 1: then its action is the same everywhere. Divide heights and velocities into intervals."
        )
    speeds = [-60.0 + 0.5 * i for i in range(161)]
    for _ in range(6):
        height = 10.0 ** rng.uniform(-0.5, 3.0)
        states, again = (pilot.ask("encode", [height] * len(speeds), speeds, returns=list[int]) for _ in range(2))
        if states != again or len(states) != len(speeds):
            return failed("encode() returns another state for the same arguments: it must depend on them alone.")
        if len(set(states)) < 2:
            return failed(
                "At one height encode() returns the same state for all velocities.",
                "2 states or more from -60 to 20 m/s",
                "1 state",
            )
        folded = find_repeated_state(states)
        if folded is not None:
            return failed(
                "Two velocities far apart have one state, with other states between them: is the sign lost, by abs()?",
                "each state is one interval of velocities",
                f"{speeds[folded[0]]:g} and {speeds[folded[1]]:g} m/s are state {states[folded[1]]}",
            )
    heights = [0.3 * 1.1**i for i in range(88)]
    states = pilot.ask("encode", heights, [-5.0] * len(heights), returns=list[int])
    if len(states) != len(heights):
        return failed(f"encode() returns {len(states)} states for {len(heights)} heights.")
    if len(set(states)) < 2:
        return failed("encode() returns the same state for all heights: at -5 m/s, 0.3 m and 1300 m are one state.")
    return passed()


def find_repeated_state(states: list[int]) -> tuple[int, int] | None:
    """Return two indices of one state with other states in between, or None."""
    last: dict[int, int] = {}
    for i, state in enumerate(states):
        if state in last and last[state] != i - 1:
            return last[state], i
        last[state] = i
    return None


# -- what is done -----------------------------------------------------------------------------------------------------


@check(points=15, visible=[Seed(1)], hidden=one)
def chooses(student: Student, case: Seed) -> Verdict:
    """choose() takes the best of what was tried, explores as often as epsilon specifies, and changes nothing."""
    pilot, rng = student.create_object(FILE, StudentPolicy), random.Random(case.seed)
    count = count_of(pilot)
    table = random_table(count, rng)
    states = [rng.randrange(count) for _ in range(200)]

    def choices(epsilon: float, seed: int, of: list[int] = states) -> list[int]:
        answer = pilot.ask("choices", table.plain(), of, epsilon, seed, returns=Chosen)
        if (answer.table.values, answer.table.visits) != (table.values, table.visits):
            raise SubmissionError(
                "choose() has changed the table.", "choose() only reads the table; update() changes it."
            )
        if len(answer.actions) != len(of):
            raise SubmissionError("choose() did not return an action for each state.", "Return one action.")
        actions: list[int] = answer.actions
        return actions

    greedy = choices(0.0, 1)
    if greedy != choices(0.0, 1):
        return failed(
            "choose() returned another action for the same table, state and rng: it must depend on its arguments alone."
        )
    if any(choices(0.0, seed) != greedy for seed in range(2, 6)):
        return failed("With epsilon 0 it still explores. Then an evaluation does not measure what was learned.")
    for state, action in zip(states, greedy, strict=True):
        if action != table.best[state]:
            return failed(
                choice_error(table, state, action), f"{table.best[state]}", f"{action}" + describe_row(table, state)
            )
    everywhere = choices(1.0, 6, states * 5)
    if min(everywhere.count(action) for action in range(ACTIONS)) < 170:
        return failed("With epsilon 1 each action should be equally frequent: rng.randrange(ACTIONS).")
    often = choices(0.4, 7, states * 5)
    share = sum(a == b for a, b in zip(often, greedy * 5, strict=True)) / len(often)
    if not 0.63 < share < 0.77:  # 0.7, and nearly five standard deviations to either side
        return failed(
            "With epsilon 0.4 it must explore in 40 % of the calls.",
            "the best action in 70 % (60 %, and a quarter of 40 %)",
            f"{share:.0%}",
        )
    return passed()


def random_table(states: int, rng: random.Random) -> ReferenceTable:
    """Return a table with negative values, ties, and untried actions."""
    table = Table(states)
    for state in range(states):
        for action in range(ACTIONS):
            if rng.random() < 0.7:
                table.visits[state][action] = rng.randrange(1, 40)
                table.values[state][action] = float(rng.choice([-8, -4, -4, -2, -1, 1, 3])) * rng.choice(
                    [1.0, 1.0, 1.5]
                )
    return ReferenceTable(states, table)


def describe_row(table: Table, state: int) -> str:
    """Return a row of a table as text."""
    return f", of values {table.values[state]} with visits {table.visits[state]}"


# -- what is learned --------------------------------------------------------------------------------------------------


@check(points=20, visible=[Seed(1)], hidden=lambda rng: three(rng)[:2])
def updates(student: Student, case: Seed) -> Verdict:
    """update() learns from 40 transitions exactly what Q-learning learns."""
    pilot, rng = student.create_object(FILE, StudentPolicy), random.Random(case.seed)
    table = with_a_new_action(random_table(max(MET + 1, count_of(pilot)), rng))
    transitions = [*(random_transition(rng) for _ in range(39)), Transition(MET, 1, -1.0, MET, False, False)]
    right = ReferenceTable(len(table.values), table)
    right.learn(transitions)
    in_a_row = replayed(pilot, table, transitions)
    for transition, now in zip(transitions, each_replayed(pilot, table, transitions), strict=True):
        alone = ReferenceTable(len(table.values), table)
        alone.learn([transition])
        if alone.differs(now) is not None:
            return failed(diagnosis(table, transition, alone, now), *numbers(transition, alone, now))
    if right.differs(in_a_row) is not None:
        return failed("Each transition alone is learned correctly, but not all in a row: what does it keep in between?")
    return passed()


def replayed(pilot: Any, before: Table, transitions: list[Transition]) -> Table:
    """Return what the student makes of a table by some transitions, one after the other."""
    rows = pilot.ask("replay", before.plain(), [list(one) for one in transitions], returns=Rows)
    return table_of(rows, len(before.values))


def each_replayed(pilot: Any, before: Table, transitions: list[Transition]) -> list[Table]:
    """Return what the student makes of a table by each of some transitions alone."""
    plain = before.plain()
    changes = pilot.ask("replay_each", plain, [list(one) for one in transitions], returns=list[list[Change]])
    if len(changes) != len(transitions):
        raise SubmissionError(
            "It did not report the changes of each transition.", "Do not modify the code that calls update()."
        )
    return [apply_changes(Table.of(plain), cells) for cells in changes]


def with_a_new_action(table: ReferenceTable) -> ReferenceTable:
    """Return the same table, but that in one state all was bad so far, and action 1 was not tried."""
    table.values[MET], table.visits[MET] = [-4.0, 0.0, -2.0, -8.0], [3, 0, 5, 2]
    return ReferenceTable(len(table.values), table)


def random_transition(rng: random.Random) -> Transition:
    """Return a transition between the first states; every third ends an episode."""
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
    """Return what the value should be, and what it is."""
    return tuple(f"values[state][action] = {table.values[step.state][step.action]:.6g}" for table in (right, now))  # type: ignore[return-value]


# -- what was submitted -----------------------------------------------------------------------------------------------


def policy_of(student: Student) -> QTable | None:
    """Return the submitted table; None if there is none.

    Raises:
        SubmissionError: it cannot be used.
    """
    path = (student.folder / POLICY).resolve()
    if not path.is_file() or not path.is_relative_to(student.folder):
        return None
    with path.open("rb") as file:
        begin = file.read(1)
    if begin == b"\x80":
        raise SubmissionError(
            f"{POLICY} is a pickle.",
            "Loading a pickle can run any code, so it is not loaded. Submit the file of learn.py: it contains numbers.",
        )
    try:
        table = QTable.load(path, ENVIRONMENT, max_bytes=MAX_BYTES)
    except RecordingError as error:
        wrong = str(error).replace(str(path), POLICY)[:MAX_SHOWN]
        raise SubmissionError(wrong, "Submit the file that learn.py has saved, and copy all of it.") from None
    if len(table.discretiser.names) != 2 or len(table.actions) != ACTIONS:
        raise SubmissionError(
            f"{POLICY} uses {', '.join(table.discretiser.names)}, with {len(table.actions)} actions.",
            f"It must use altitude_m and velocity_mps, with {ACTIONS} actions.",
        )
    return table


@check(points=5)
def policy_file(student: Student) -> Verdict:
    """policy.npz is a table of numbers, of less than a megabyte."""
    table = policy_of(student)
    if table is None:
        return failed(
            "There is no policy.npz: create it with python learn.py. Without it, the grader trains q_lander.py itself."
        )
    return passed()


def pilot_of(student: Student) -> tuple[TablePolicy, Evidence | None]:
    """Return the policy: the submitted table, or one that is trained here, with its evidence."""
    table = policy_of(student)
    if table is not None:
        return TablePolicy(table), None
    evidence, _ = trained(student, 0)
    return TablePolicy(policy_table(evidence)), evidence


def trained(student: Student, seed: int) -> tuple[Evidence, TrainingResult]:
    """Return what is learned in a training of the file, and how that went.

    Raises:
        SubmissionError: it does not train.
    """
    pilot = student.create_object(FILE, StudentPolicy)
    evidence = Evidence(pilot, seed)
    took = train(pilot, seed, evidence=evidence)
    return evidence, took


def confirm(student: Student, evidence: Evidence | None) -> None:
    """Check, before points are given, that the policy used is the result of the student's functions.

    Raises:
        SubmissionError: the results of update(), or of encode() in a new process, differ.
    """
    if evidence is not None:
        evidence.check_update()
        student.close()
        evidence.check_states(student.create_object(FILE, StudentPolicy))


@check(points=25, visible=[SEEN], hidden=lambda rng: [Starts(100, case.seed) for case in three(rng)])
def lands(student: Student, case: Starts) -> Verdict:
    """The policy lands: all points from 95 of 100 starts, none below 50."""
    pilot, evidence = pilot_of(student)
    stats = simulate_landings(pilot, case.seed, case.count)
    if stats.share > 0.5:
        confirm(student, evidence)
    metrics = {"landed": stats.share} | ({"fuel_kg": stats.fuel_kg} if any(stats.landed) else {})
    if stats.share >= 0.95:
        return passed(metrics=metrics)
    hint = crash_hint(stats, evidence)
    is_low = evidence is None and stats.share < 0.75
    if is_low and simulate_landings(pilot, SEEN.seed, SEEN.count).share > stats.share + 0.2:
        hint = "It lands from the visible starts, but not from others: it was trained on its test cases."
    return partial_credit((stats.share - 0.5) / 0.45, hint, "95 of 100 or more", outcome_text(stats), metrics)


def crash_hint(stats: LandingStats, evidence: Evidence | None) -> str:
    """Return a hint for failed landings."""
    if evidence is not None:
        if evidence.states == 1:
            return "STATES is 1, so its action is the same everywhere, and it cannot learn to land. Do step 1 first."
        if not any(any(tries[1:]) for tries in evidence.reference.visits):
            return "Only action 0 was ever tried: epsilon() is 0, so it never explores."
        if not any(map(any, evidence.reference.values)):
            return "All rewards were 0, so there was nothing to learn: what does reward() return?"
    if stats.outcomes["timeout"] > 0.1 * len(stats.landed):
        return HOVERS
    often = " The average is slow enough, but too many landings are not." if stats.touchdown_mps <= LEGS_MPS else ""
    return (
        f"It touches down at {stats.touchdown_mps:.1f} m/s on average (limit {LEGS_MPS} m/s).{often} "
        "Try finer states near the ground."
    )


def outcome_text(stats: LandingStats) -> str:
    """Return the number of flights per outcome, as text."""
    return ", ".join(f"{count} {outcome}" for outcome, count in stats.outcomes.items())


@check(points=15, visible=[Seed(1)], hidden=three, needs=["encodes", "chooses", "updates"], all_or_nothing=True)
def learns(student: Student, case: Seed) -> Verdict:
    """Trained by the grader for 80 000 steps, it lands 80 of 100 starts: for every seed, in one of two trainings."""
    for again in (0, 2):
        evidence, took = trained(student, case.seed + again)
        stats = simulate_landings(TablePolicy(policy_table(evidence)), case.seed + again + 1, 100)
        if not 0.0 < stats.share < 0.8:
            break  # otherwise train once more: one good training in 1000 fails, but hardly two in a row
    if stats.share >= 0.8:
        confirm(student, evidence)
        return passed(metrics={"landed_after_training": stats.share})
    hint = crash_hint(stats, evidence)
    if sum(took.landed[-100:]) > 60:
        hint += " (In training it landed more often than in this test.)"
    return failed(hint, "80 of 100 or more", f"{outcome_text(stats)}, after {took.episodes} episodes")


@check(
    points=10,
    visible=[PlantVariation(1.1, 0.9, 1)],
    hidden=lambda rng: [PlantVariation(g, t, rng.getrandbits(63)) for g in (0.9, 1.1) for t in (0.9, 1.1)],
)
def is_sturdy(student: Student, case: PlantVariation) -> Verdict:
    """It also lands where gravity and thrust are a tenth more or less: all points from 75 of 100, none below 40."""
    pilot, evidence = pilot_of(student)
    stats = simulate_landings(pilot, case.seed, 100, case.gravity, case.thrust)
    if stats.share > 0.4:
        confirm(student, evidence)
    if stats.share >= 0.75:
        return passed()
    return partial_credit(
        (stats.share - 0.4) / 0.35, crash_hint(stats, evidence), "75 of 100 or more", outcome_text(stats)
    )


lab = Lab(
    "Lunar lander: Q-learning",
    files=[FILE],  # and policy.npz, which may be missing
    checks=[encodes, chooses, updates, policy_file, lands, learns, is_sturdy],
    refused={"snr_sim.learning": "it is this lab, solved"},
    leaderboard={"lands.fuel_kg": "asc"},
)
