"""Checks of the lab "debug by replay". This file contains no answer.

Each finding names a line and its replacement. The grader runs the code with that repair alone on the failed landing's
inputs, and determines where its outputs first differ from the recording.
"""

from __future__ import annotations

import random
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from snr_sim import Page
from snr_sim.grading import Lab, ScenarioRun, Stimulus, Student, Verdict, check, failed, partial_credit, passed
from snr_sim.grading.remote.parsers import toml_in
from snr_sim.recording import InputRecord, PageRecord, TaskRecord, Trace, decode_value, read_trace
from snr_sim.recording.trace import FILE_NAME
from snr_sim.scenario import Request, prepare, run_recorded

STARTER = Path(__file__).parent / "starter"
KEPT = ("failed.py", "repairs.py", "repaired.py", "only_1.py", "only_2.py", "only_3.py")
SCENARIO, FAILED_SEED = "lander_vertical", 4
COMPONENTS = ("estimator", "planner", "throttler")
NUMBERS = (1, 2, 3)
SOFT_MPS = 2.1  # a touchdown
LOW_M, LOW_MPS = 27.0, 4.4  # below this, never faster than that
MAX_LINES = 4  # of a repair


@dataclass(frozen=True)
class Landing:
    """A flight, with some of the repairs."""

    seed: int
    without: int = 0

    @property
    def label(self) -> str:
        """What reports call it."""
        return f"seed {self.seed}" + (f", without repair {self.without}" if self.without else "")


@dataclass(frozen=True)
class Step:
    """A task that a component returned in the failed landing: in which record, and as the answer to which input."""

    seq: int
    time_s: float
    component: str
    name: str
    value: Any
    after: int


@lru_cache(maxsize=1)
def failed_landing() -> Trace:
    """Return the failed landing, simulated again with the code of the starter."""
    simulation = prepare(Request(SCENARIO, seed=FAILED_SEED, controller=str(STARTER / "failed.py")))
    with TemporaryDirectory() as folder:
        path = Path(folder) / FILE_NAME
        run_recorded(simulation, path)
        return read_trace(path)


def inputs_and_steps() -> tuple[list[Stimulus], list[Step]]:
    """Return what came in, and what the failed code returned."""
    given: list[Stimulus] = []
    steps: list[Step] = []
    for record in failed_landing().records:
        if isinstance(record, InputRecord) and record.type == "store_page":
            given.append(Stimulus(record.t, record.name, _page(bytes(record.values)).data))
        elif isinstance(record, (TaskRecord, PageRecord)):
            for by in record.handled:
                if by.component in COMPONENTS:
                    for one in by.returned:
                        data = _page(bytes(one.values)).data
                        steps.append(Step(record.seq, record.t, by.component, one.name, data, len(given) - 1))
    return given, steps


def _page(raw: bytes) -> Page:
    page = decode_value(raw, {"page": Page})[0]
    assert isinstance(page, Page)
    return page


def first_divergence(student: Student, file: str) -> Step | None:
    """Return what the failed code returned where this code first returns something else; None if it never does."""
    given, steps = inputs_and_steps()
    parameters = prepare(Request(SCENARIO, seed=FAILED_SEED)).scenario.parameters(FAILED_SEED)
    made = iter(student.run_inputs(file, given, robot="lander", parameters=parameters))
    for step in steps:
        now = next(made, None)
        if now is None or (now.after, now.component, now.name, now.value) != (
            step.after, step.component, step.name, step.value,
        ):  # fmt: skip
            return step
    return None


def findings(student: Student) -> list[dict[str, Any]]:
    """Return the findings in findings.toml; missing ones are empty.

    Raises:
        SubmissionError: it is not valid TOML.
    """
    found = student.parse("findings.toml", toml_in).get("finding")
    found = [one for one in found if isinstance(one, dict)] if isinstance(found, list) else []
    return [*found, {}, {}, {}][:3]


def _text(finding: dict[str, Any], name: str) -> str:
    value = finding.get(name, "")
    return value.strip("\n") if isinstance(value, str) else ""


@check(points=5, all_or_nothing=True)
def unchanged(student: Student) -> Verdict:
    """The failed code and the files that apply repairs are unchanged."""
    for name in KEPT:
        if student.source(name).split() != (STARTER / name).read_text().split():
            return failed(
                f"{name} has been changed. Restore the starter's: repairs belong in findings.toml.",
                expected=f"{name} of the starter",
                actual="a different file",
            )
    return passed()


@check(points=10, visible=NUMBERS, needs=["unchanged"])
def filled_in(student: Student, number: int) -> Verdict:
    """The finding has the wrong line, the right one, and the cause, and its repair is short."""
    finding = findings(student)[number - 1]
    was, instead, cause = (_text(finding, name) for name in ("was", "instead", "cause"))
    times = (STARTER / "failed.py").read_text().count(was) if was.strip() else 0
    if not was.strip() or not instead.strip():
        return failed(f"Finding {number} has no repair yet.", "a line in `was`, another in `instead`", "nothing")
    if times != 1:
        return failed(
            "Copy the whole line into `was`, with the spaces before it: it must occur once in failed.py.",
            expected="once",
            actual=f"{times} times",
        )
    if max(len(text.splitlines()) for text in (was, instead)) > MAX_LINES:
        return failed("The repair has too many lines: which line was wrong?", f"at most {MAX_LINES} lines")
    if not 4 <= len(cause.split()) <= 40 or "\n" in cause:
        return failed(
            "Describe in `cause`, in one line, what is wrong.", "4 to 40 words", f"{len(cause.split())} words"
        )
    return passed(note=cause)


@check(points=30, visible=NUMBERS, needs=["unchanged"])
def diverges(student: Student, number: int) -> Verdict:
    """The finding names where a replay with its repair alone first differs, and which component that is."""
    step = first_divergence(student, f"only_{number}.py")
    if step is None:
        return failed(
            "With this repair alone the outputs are those of the recording: it changes nothing in that landing.",
            expected="a divergence",
            actual="identical",
        )
    found = findings(student)
    finding = found[number - 1]
    same = [other for other in NUMBERS if found[other - 1].get("component") == step.component]
    if len(same) > 1:
        return failed(
            f"Findings {' and '.join(map(str, same))} both change what the {step.component} returns. Each component "
            "has one mistake: one of the two repairs compensates for a mistake of another component.",
            expected="three components",
            actual=step.component,
        )
    right_seq, right_component = finding.get("seq") == step.seq, finding.get("component") == step.component
    if right_seq and right_component:
        return passed()
    if right_component:
        return partial_credit(
            0.5,
            f"`snr replay RUN --with only_{number}.py` prints the first divergence: that is not where the commands "
            "begin to differ, nor where it crashed.",
            expected="the seq of the first divergence",
            actual=f"seq {str(finding.get('seq'))[:20]}",
        )
    return partial_credit(
        0.5 if right_seq else 0.0,
        "Another component is the first whose result differs: which one does the replay name?",
        expected="its name",
        actual=str(finding.get("component"))[:40],
    )


def misses(run: ScenarioRun) -> list[str]:
    """Return which of the mission's rules a flight broke."""
    broken = [] if run.success else [f"the outcome was '{run.outcome}', not 'landed'"]
    touchdown = run.metrics.get("touchdown") or {}
    speed_mps = abs(touchdown.get("vertical_mps", 0.0))
    if run.success and speed_mps > SOFT_MPS:
        broken.append(f"the touchdown speed was {speed_mps:.1f} m/s (limit {SOFT_MPS:g} m/s)")
    low_mps = max((-one["vertical_mps"] for _, one in run.truth() if one["altitude_m"] < LOW_M), default=0.0)
    if low_mps > LOW_MPS:
        broken.append(f"the speed below {LOW_M:g} m was {low_mps:.1f} m/s (limit {LOW_MPS:g} m/s)")
    return broken


def _landings(count: int) -> Any:
    return lambda rng: [Landing(rng.getrandbits(63)) for _ in range(count)]


@check(points=40, visible=[Landing(FAILED_SEED), Landing(7)], hidden=_landings(8), needs=["unchanged"])
def lands(student: Student, case: Landing) -> Verdict:
    """With all repairs it keeps the mission's three rules."""
    broken = misses(student.run_scenario(SCENARIO, seed=case.seed, controller="repaired.py"))
    if not broken:
        return passed()
    return failed(
        "With all three repairs the landing still breaks a rule: read the pages estimate, plan and engine at the time "
        "where it goes wrong.",
        expected="the three rules",
        actual="; ".join(broken),
    )


def _left_out(rng: random.Random) -> list[Landing]:
    return [Landing(rng.getrandbits(63), without) for without in NUMBERS]


@check(
    points=15,
    visible=[Landing(FAILED_SEED, without) for without in NUMBERS],
    hidden=_left_out,
    needs=["lands"],
)
def each_is_needed(student: Student, case: Landing) -> Verdict:
    """Without any one of the repairs the mission fails: each corrects a mistake."""
    kept = ",".join(str(one) for one in NUMBERS if one != case.without)
    if misses(student.run_scenario(SCENARIO, seed=case.seed, controller="repaired.py", options={"repairs": kept})):
        return passed()
    return failed(
        f"Without repair {case.without} the landing breaks no rule either: it does not correct a mistake.",
        expected="a rule broken",
        actual="none broken",
    )


lab = Lab(
    "Debug by replay",
    files=[*KEPT, "findings.toml"],
    checks=[unchanged, filled_in, diverges, lands, each_is_needed],
)
