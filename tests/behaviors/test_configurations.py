"""The search through configurations: what it does not reach no run reaches, and what it reaches some run does."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
import typer
from hypothesis import assume, given
from hypothesis import strategies as st

from snr_sim.behaviors import Bridge, Drive, Interpreter, Read, configurations, machine, on, parse, state
from snr_sim.behaviors.configurations import MAX_CONFIGURATIONS, Found, search
from snr_sim.behaviors.coverage import Coverage
from snr_sim.behaviors.explore import Explored, explore
from snr_sim.behaviors.program import Program
from snr_sim.cli.machine import machine as machine_verb
from tests.slowness import slowness

BRIDGE = Bridge({"x": Read("x")}, {"motor": Drive("motors", "left", -1.0, 1.0)})
MS = 1_000_000

# Two machines that look before they enter, and enter a step later.
RACE = """(var inside := [0])
(machine left
  (event go)
  (state out) (state asking)
  (state in (onentry [inside = inside + 1]) (onexit [inside = inside - 1]))
  (on [inside == 0] out -> asking free)
  (on go asking -> in)
  (on [robot.x.read() > 2] in -> out))
(machine right
  (event also)
  (state out) (state asking)
  (state in (onentry [inside = inside + 1]) (onexit [inside = inside - 1]))
  (on [inside == 0] out -> asking free_too)
  (on also asking -> in enters)
  (on also in -> out))
(always one_inside [inside <= 1])
(spawn left out) (spawn right out)
"""


def explored(text: str) -> Explored:
    return explore(parse(text))


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 1000 configurations there are too many."""
    monkeypatch.setattr(configurations, "MAX_CONFIGURATIONS", 1000)


def kinds(text: str) -> list[tuple[str, str]]:
    return [(one.kind, one.name) for one in explored(text).findings]


def test_race_between_two_machines_is_found_by_its_shortest_word() -> None:
    (finding,) = explored(RACE).findings
    assert (finding.kind, finding.name, finding.place.line) == ("violated", "one_inside", 16)
    assert finding.message == "'one_inside' can be false: inside = 2."
    assert finding.word == ("free", "free_too", "enters", "asking->in")


def test_machine_that_looks_and_enters_at_once_has_no_race() -> None:
    sound = RACE.replace("-> asking free", "-> in free").replace("-> asking free_too", "-> in free_too")
    assert [kind for kind, _ in kinds(sound)] == ["unreachable", "unreachable"]  # `asking`, twice


def test_signal_that_moves_two_machines_moves_both() -> None:
    both = """(var a := [0]) (var b := [0])
    (machine m (event go) (state x (onentry [a = 0])) (state y (onentry [a = 1])) (on go x -> y) (on go y -> x))
    (machine n (event go) (state x (onentry [b = 0])) (state y (onentry [b = 1])) (on go x -> y) (on go y -> x))
    (always equal [a == b]) (spawn m x) (spawn n x)"""
    assert kinds(both) == []
    assert kinds(both.replace("(on go y -> x))\n    (always", "(on [b == 1] y -> x))\n    (always")) == [
        ("violated", "equal")
    ]


COUNTS = """(var n := [0])
(machine m
  (event go)
  (state a (onentry [n = n + 1]))
  (state b) (state late)
  (on [n >= 3] a -> late)
  (on go a -> b)
  (on go b -> a)
  (on [n == 7 and robot.x.read() > 1] a -> b never)
  (on go late -> a))
(spawn m a)
"""


def test_values_of_variables_decide_what_is_reached() -> None:
    found = explored(COUNTS.replace("n + 1", "min(n + 1, 4)"))
    assert [(one.kind, one.name) for one in found.findings] == [("never", "never")]
    assert found.configurations == 8
    assert kinds(COUNTS.replace("n = n + 1", "n = 2 - n"))[0] == ("unreachable", "late")


@pytest.mark.usefixtures("few")
def test_variable_with_too_many_values_is_left_out_and_named() -> None:
    found = explored(COUNTS.replace("(spawn m a)", "(always few [n < 5]) (spawn m a)"))
    assert found.left_out == ("n",)
    assert [(one.kind, one.name) for one in found.findings] == [("violated", "few")]  # before it was left out
    assert found.configurations == 3


@pytest.mark.usefixtures("few")
def test_one_variable_that_is_left_out_does_not_blind_another() -> None:
    text = """(var n := [0]) (var is_open := [False])
    (machine m (event go)
      (state a (running [n = n + 1])) (state b) (state c)
      (on [n == 5 and robot.x.read() > 1] a -> b) (on [is_open] a -> c) (on go b -> a) (on go c -> a))
    (spawn m a)"""
    found = explored(text)
    assert found.left_out == ("n",)
    assert ("unreachable", "c") in [(one.kind, one.name) for one in found.findings]


def many_machines(enters: str) -> str:
    machines = "".join(
        f"(machine m{i} (state a{enters}) (state b) (on [n >= 0 and robot.x.read() > {i}] a -> b) (on [n >= 0] b -> a))"
        for i in range(30)
    )
    return f"(var n := [0]) {machines} {' '.join(f'(spawn m{i} a)' for i in range(30))}"


def test_step_of_many_machines_with_too_many_results_ends_in_time() -> None:
    begun_s = time.process_time()
    found = explored(many_machines(" (onentry [n = 1 - n])"))
    assert time.process_time() - begun_s < 3.0 * slowness()
    assert (found.findings, found.left_out) == ([], ("n",))


def test_machines_that_share_a_constant_are_searched_one_after_the_other() -> None:
    found = explored(many_machines(""))
    assert (found.findings, found.left_out, found.configurations) == ([], (), 60)


def test_rule_of_a_reading_is_undecided() -> None:
    text = "(var n := [0])" + SIMPLE + "(always near [n == 0 or robot.x.read() > 3]) (always far [n < 2]) (spawn m a)"
    found = explored(text)
    assert (found.findings, found.undecided) == ([], ("near",))


SIMPLE = """(machine m (event go)
  (state a (onentry [n = 0])) (state b (onentry [n = 1])) (on go a -> b) (on go b -> a))"""


def test_idle_steps_that_change_a_variable_are_on_the_way() -> None:
    text = "(var n := [0])" + SIMPLE.replace("(onentry [n = 1])", "(running [n = min(n + 1, 3)])")
    (finding,) = explored(text + "(always few [n < 3]) (spawn m a)").findings
    assert finding.word == ("a->b", "step", "step", "step")


@pytest.mark.parametrize(
    ("assigned", "found"),
    [
        ("n = 1 if robot.x.read() > 3 else 0", []),
        ("n = 2 if robot.x.read() is None else 0", ["unreachable"]),
        ("n = robot.x.read()", []),
        ("n = int(robot.x.age_ms())", []),
        ("n = 1 if random() < 0.5 else 0", []),
        ("n = 1 if in_state_ms > 5 else 0", []),
        ("n = 1 if now_ms % 7 == 3 else 0", []),
        ("n = len(signal)", []),
        ("n = f'{robot.x.read()}' == '1'", []),
        ("n = 0 if robot.x.read() > 3 else 3 - 3", ["unreachable"]),
        ("n = [1, 0][robot.x.read() * 0]", []),
        ("x = robot.x.read() + 1\n n = 1", []),  # fails without a reading
        ("robot.motor.start(robot.x.read())\n n = 1", []),
        ("n = 1\n n = 1 // 0", ["unreachable"]),  # always undone
    ],
)
def test_block_with_unknown_values_has_every_possible_result(assigned: str, found: list[str]) -> None:
    text = f"""(var n := [0])
    (machine m (event go) (event out)
      (state a (onexit [{assigned}])) (state b) (state c)
      (on go a -> b) (on [n == 1] b -> c) (on go b -> a) (on out c -> a))
    (spawn m a)"""
    assert sorted({kind for kind, _ in kinds(text)} - {"never"}) == found


def test_function_of_a_python_file_may_return_anything() -> None:
    text = """(actions "x.py") (var n := [0])
    (machine m (event go) (state a (onexit [n = count()])) (state b) (state c)
      (on go a -> b) (on [n == 5] b -> c) (on go b -> a) (on go c -> a))
    (spawn m a)"""
    assert explore(parse(text, actions={"x.py": {"count": lambda: 1}})).findings == []
    assert ("unreachable", "c") in kinds(text.replace('(actions "x.py")', "").replace("count()", "1"))


def test_variables_of_a_function_in_python_are_not_followed() -> None:
    def opens(m: Any) -> None:
        m.variables["is_open"] = True

    made = machine(
        "m", "a", [state("a", on("go", to="b"), leave=opens), state("b", on("go", to="a"))],
        variables={"is_open": False},
    )  # fmt: skip
    assert search(made).counts == {}
    assert explore(made).findings == []


def test_time_outs_are_taken_in_their_order() -> None:
    text = """(var n := [1])
    (machine m (event go)
      (state a) (state b) (state c)
      (on [n == 1] a -> c) (ontime 300 a -> b) (ontime 100 c -> a) (ontime 200 c -> b late) (on go b -> a))
    (spawn m a)"""
    assert set(kinds(text)) == {("unreachable", "b"), ("never", "a->b"), ("only_time", "c"), ("hidden", "late")}
    assert ("unreachable", "b") not in kinds(text.replace("200 c", "[200 * n] c"))


def test_circle_of_transitions_at_once_ends() -> None:
    text = """(var n := [0]) (machine m (event go)
      (state a (onentry [n = (n + 1) % 5])) (state b) (state c)
      (on go c -> a) (on [n == 3 and robot.x.read() > 1] a -> c) (eps a -> b) (eps b -> a))
    (spawn m c)"""
    found = explored(text)
    assert ("eps_cycle", "a") in [(one.kind, one.name) for one in found.findings]
    assert found.configurations > 5


def test_machine_that_an_error_ends_is_not_followed() -> None:
    text = "(var n := [0])" + SIMPLE + "(always few [n < 1]) (spawn m a)"
    assert kinds(text) == [("violated", "few")]
    assert explored("(onerror stop)" + text).undecided == ("few",)


@pytest.mark.slow
def test_hundred_thousand_configurations_take_three_seconds() -> None:
    text = """(var n := [0]) (var k := [0])
    (machine m
      (event go) (event back)
      (state a (onentry [n = (n + 1) % 3300])) (state b (onentry [k = (k + 1) % 10])) (state c)
      (on go a -> b) (on [n > 5 and robot.x.read() < 3] a -> c) (on [robot.x.read() < 4] b -> a)
      (on [k == 3] b -> c) (ontime 300 c -> a) (on back * -> a))
    (spawn m a)"""
    program = parse(text)
    begun_s = time.process_time()
    found = explore(program)
    assert time.process_time() - begun_s < 3.0 * slowness()
    assert (found.left_out, found.findings) == ((), [])
    assert 0.95 * MAX_CONFIGURATIONS < found.configurations <= MAX_CONFIGURATIONS


@pytest.mark.usefixtures("few")
def test_verb_prints_ways_rules_and_what_is_left_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "m.lrp"
    text = SIMPLE.replace("(onentry [n = 1])", "(running [n = min(n + 1, 3)]) (onexit [k = k + 1])")
    file.write_text(
        f"(var n := [0]) (var k := [0]) {text}\n(always few [n < 3]) (always far [k < 10 ** 6]) (spawn m a)"
    )
    with pytest.raises(typer.Exit):
        machine_verb("explore", str(file))
    shown = capsys.readouterr().out
    assert "m.lrp:3: 'few' can be false: n = 3.\n    shortest way there: a->b, step (3 times)\n" in shown
    assert "whether 'far' always holds depends on readings or on variables that are not followed\n" in shown
    assert "not followed, as they have too many values: k\n" in shown
    with pytest.raises(typer.Exit):
        machine_verb("explore", str(file), as_json=True)
    assert '"left_out": ["k"]' in capsys.readouterr().out


# -- compared with the interpreter ------------------------------------------------------------------------------------

BLOCKS = (
    "p = (p + 1) % 3", "q = p", "p = 0", "q = 1 - q", "p = 2 if q == 1 else p", "if q == 0:\n  p = 1\n  q = 1",
    "for i in range(p):\n  q = i",
)  # fmt: skip
BLOCKS_THAT_READ = (*BLOCKS, "p = 1 if robot.x.read() is not None and robot.x.read() > 1 else 0", "q = robot.x.read()")
CONDITIONS = ("p == 1", "p > q", "q == 1 and p == 0", "p == 2")
CONDITIONS_THAT_READ = (*CONDITIONS, "robot.x.read() > 1 and p == 2", "robot.x.read() is None or q > p")
TIMES_MS = (0, 10, 20)


@st.composite
def machine_texts(draw: Any, name: str, depth: int, around: list[str], reads: bool) -> str:
    names = ["a", "b", "c"][: draw(st.integers(1, 3))]
    blocks, conditions = (BLOCKS_THAT_READ, CONDITIONS_THAT_READ) if reads else (BLOCKS, CONDITIONS)
    forms = ["(event go)", "(event stop)"]
    for one in names:
        clauses = [
            f"({kind} [{draw(st.sampled_from(blocks))}])"
            for kind in ("onentry", "running", "onexit")
            if draw(st.integers(0, 2)) == 0
        ]
        for inner in [f"{name}{one}{i}" for i in range(draw(st.integers(0, 2)) if depth else 0)]:
            clauses.append(draw(machine_texts(inner, depth - 1, names, reads)))
            clauses.append(f"(onentry (spawn {inner} a))")
        forms.append(f"(state {one} {' '.join(clauses)})")
    kinds = ["go", "stop", "condition", "condition", "eps"] + (["time"] if reads else []) + (["exit"] if around else [])
    for i in range(draw(st.integers(0, 5))):
        kind = draw(st.sampled_from(kinds))
        cause = {
            "eps": "eps", "time": f"ontime {draw(st.sampled_from(TIMES_MS))}", "go": "on go", "stop": "on stop",
            "condition": f"on [{draw(st.sampled_from(conditions))}]",
            "exit": f"exit [{draw(st.sampled_from(conditions))}]",
        }[kind]  # fmt: skip
        source = draw(st.sampled_from(names if kind == "exit" else ["*", *names]))
        forms.append(f"({cause} {source} -> {draw(st.sampled_from(around if kind == 'exit' else names))} {name}t{i})")
    return f"(machine {name} {' '.join(forms)})"


@st.composite
def texts(draw: Any, *, reads: bool) -> str:
    names = ["m", "n"][: draw(st.integers(1, 2))]
    made = [draw(machine_texts(name, 1, [], reads)) for name in names]
    conditions = CONDITIONS_THAT_READ if reads else CONDITIONS
    rules = [f"(always r{i} [not ({draw(st.sampled_from(conditions))})])" for i in range(draw(st.integers(0, 2)))]
    return "\n".join(["(var p := [0]) (var q := [0])", *made, *rules, *(f"(spawn {name} a)" for name in names)])


@dataclass
class Seen:
    """What the interpreter has done: states entered, transitions taken, and rules that did not hold."""

    program: Program
    counted: Coverage = field(default_factory=Coverage)
    entered: set[tuple[str, str]] = field(default_factory=set)
    violated: set[str] = field(default_factory=set)

    def add(self, interpreter: Interpreter) -> None:
        self.entered |= set(interpreter.entered)
        rules = {rule.name for rule in self.program.rules}
        self.violated |= {one.block for one in interpreter.problems.values()} & rules

    @property
    def taken(self) -> set[tuple[str, str, str]]:
        return {(path, name, arrow) for (path, name, arrow, _), row in self.counted.tallies.items() if row.taken}


def taken_in(program: Program, found: Found) -> set[tuple[str, str, str]]:
    machines = {path: spawn.machine for path, spawn in program.walk()}
    return {(path, name, list(machines[path].transitions_of(name))[i].name) for path, name, i in found.taken}


def followed(found: Found, rows: set[Any]) -> set[Any]:
    """Return those rows that belong to machines which the search has followed."""
    tops = {name for names in found.counts for name in names}
    return {row for row in rows if row[0].split("/")[0] in tops}


@pytest.mark.hypothesis
@given(
    texts(reads=True),
    st.lists(
        st.tuples(st.sampled_from([1, 10, 20]), st.sampled_from([None, 0, 2]), st.sampled_from([None, "go", "stop"])),
        max_size=25,
    ),
)
def test_excluded_states_and_transitions_happen_in_no_run(
    text: str, steps: list[tuple[int, int | None, str | None]]
) -> None:
    program, pages = parse(text), dict[str, Any]()
    found, seen = search(program), Seen(program)
    interpreter = Interpreter(program, pages, bridge=BRIDGE, evaluations=seen.counted)
    interpreter.spawn(0)
    seen.add(interpreter)
    now_ns = 0
    for passed_ms, pages["x"], signal in steps:
        now_ns += passed_ms * MS
        interpreter.step(now_ns, signal)
        seen.add(interpreter)
    assert followed(found, seen.entered) <= found.ways.keys()
    assert followed(found, seen.taken) <= taken_in(program, found)
    assert seen.violated <= {rule.name for rule in found.violations} | {*found.undecided}


@pytest.mark.hypothesis
@given(texts(reads=False))
def test_search_without_readings_finds_exactly_what_all_words_do(text: str) -> None:
    program = parse(text)
    found, seen = search(program), Seen(program)
    interpreter = Interpreter(program, evaluations=seen.counted)
    interpreter.spawn(0)
    seen.add(interpreter)
    known, left = set[str](), [interpreter.snapshot()]
    for snapshot in left:  # it grows
        for signal in (None, "go", "stop"):
            interpreter.restore(snapshot)
            interpreter.step(0, signal)
            seen.add(interpreter)
            key = repr((interpreter.active, interpreter.variables))
            if key not in known:
                known.add(key)
                left.append({**interpreter.snapshot(), "violated": [], "problems": []})
        assume(len(left) < 1000)
    assert followed(found, seen.entered) == found.ways.keys()
    assert followed(found, seen.taken) == taken_in(program, found)
    assert seen.violated == {rule.name for rule in found.violations}
    assert not found.undecided
