"""Blocks of LRP programs: what they may contain, what they compute, and that none of them takes long."""

from __future__ import annotations

import contextlib
import random
import resource
import time
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from snr_sim.behaviors import Interpreter, ProgramError, parse
from snr_sim.behaviors.block_bounds import BlockError
from snr_sim.behaviors.blocks import Definition, Scope, compile_block, define
from snr_sim.behaviors.context import MAX_WORK
from snr_sim.behaviors.program import Bindings, Place
from tests.slowness import slowness

PARTS = {"range": frozenset({"read"}), "motor": frozenset({"start", "stop"})}
HERE = Place(7, 11)


class Context(SimpleNamespace):
    def random(self) -> float:
        return 0.5

    def log(self, text: object) -> None:
        self.logged.append(text)


def context() -> Context:
    return Context(now_ns=2_500_000, in_state_ms=12.5, signal=(1, "two"), work=MAX_WORK, logged=[])


def scope(variables: Any, definitions: Any = None) -> Scope:
    seen, helpers = tuple((name, name) for name in variables), dict[str, Definition]()
    for name, (parameters, text) in (definitions or {}).items():
        helpers[name] = define(parameters, text, seen, tuple(helpers.items()))
    return Scope({name: name for name in variables}, helpers, PARTS)


def run(text: str, kind: Any = "block", definitions: Any = None, **variables: Any) -> Any:
    """Return what a condition returns, or the variables after a block."""
    block, problems = compile_block(text, HERE, kind, scope(variables, definitions))
    assert block is not None, problems
    slots = list(variables.values())
    commands: list[Any] = []
    robot = SimpleNamespace(
        range=SimpleNamespace(read=lambda: 42.0),
        motor=SimpleNamespace(start=commands.append, stop=lambda: commands.append(0)),
        stop=lambda: commands.append("stop"),
    )
    found = block.bind(Bindings(slots, {name: i for i, name in enumerate(variables)}, robot))(context())
    if kind == "condition":
        return found
    return dict(zip(variables, slots, strict=True)) | ({"commands": commands} if commands else {})


def problems_of(text: str, kind: Any = "block", definitions: Any = None, *variables: str) -> list[tuple[int, int, str]]:
    _, problems = compile_block(text, HERE, kind, scope(variables, definitions))
    return [(one.place.line, one.place.column, f"{one.message} {one.fix}") for one in problems]


# -- what they compute ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "due"),
    [
        ("x + 1 < 5", True),
        ("x == 3 and not y", False),
        ("x if y else 7", 3),
        ("math.hypot(x, 4.0)", 5.0),
        ("max(x, 5, y)", 5),
        ("robot.range.read() < 50", True),
        ("now_ms", 2.5),
        ("in_state_ms > 12", True),
        ("signal[1]", "two"),
        ("random()", 0.5),
        ("[i * i for i in range(4) if i != 2]", (0, 1, 9)),
        ("sum(i for i in range(10))", 45),
        ("sum([0.1] * 10)", 0.9999999999999999),  # 1.0 by `sum` of Python 3.12
        ("all(i < x for i in (1, 2))", True),
        ('f"{x:.2f} {y!r}"', "3.00 True"),
        ("[1, [2, 3]]", (1, (2, 3))),
        ("any(x > 3 for x in (1, 2))", False),
        ("[x for x in (x, 7) if x > 3], x", ((7,), 3)),
        ("[(x, i) for i in (x,) for x in (i, 9)]", ((3, 3), (9, 3))),
        ("[[x + y for y in (x, 1)] for x in (5, y)]", ((10, 6), (2, 2))),
        ("x is None or x is not None", True),
        ("'\\d'", "\\d"),
        ("(1, 2, 3)[1:]", (2, 3)),
        ("-x ** 2 + 7 % 4 - (1 << 3)", -14),
        ("round(2.675, 2), round(x)", (2.67, 3)),
        ("tuple(enumerate('ab'))", ((0, "a"), (1, "b"))),
        ("sorted((3, 1, 2), reverse=True)", [3, 2, 1]),
        ("\n  x\n  + 1  # a comment\n", 4),
    ],
)
def test_expression_has_its_value(text: str, due: Any) -> None:
    assert run(text, "condition", x=3, y=True) == due


@pytest.mark.parametrize(
    ("text", "due"),
    [
        ("x = x + 1", {"x": 2, "y": 2}),
        ("x += y; y *= 3", {"x": 3, "y": 6}),
        ("x, y = y, x", {"x": 2, "y": 1}),
        ("x = y = 7", {"x": 7, "y": 7}),
        ("\n   if x < y:\n     x = 10\n   else:\n     x = 20\n", {"x": 10, "y": 2}),
        ("for i in range(4):\n  x += i\n", {"x": 7, "y": 2}),
        ("for x in (5, 6): pass", {"x": 6, "y": 2}),
        ("local = x + 5\n          y = local", {"x": 1, "y": 6}),
        ("if x:\n  y = 5\nx = 0", {"x": 0, "y": 5}),
        ("x = [1, (2, 3)]", {"x": (1, (2, 3)), "y": 2}),
        ("robot.motor.start(50); robot.stop()", {"x": 1, "y": 2, "commands": [50, "stop"]}),
        ("pass", {"x": 1, "y": 2}),
    ],
)
def test_statements_change_variables(text: str, due: Any) -> None:
    assert run(text, x=1, y=2) == due


def test_helper_sees_its_arguments_and_those_before_it() -> None:
    helpers = {"twice": (("x",), "2 * x"), "near": (("limit",), "twice(y) < limit and x == 9")}
    assert run("near(7)", "condition", helpers, x=9, y=3) is True
    assert run("near(6)", "condition", helpers, x=9, y=3) is False


def test_assignment_of_the_original_language_is_read_with_a_warning() -> None:
    assert run("x := x + 1", x=1) == {"x": 2}
    assert problems_of("x := 1", "block", None, "x") == [(7, 11, "':=' is read as '='. write '='.")]


# -- what is refused --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "place", "message"),
    [
        ("while True: pass", (7, 11), "'while' cannot be used in a block. repeat it in each step"),
        ("import os", (7, 11), "'import' cannot be used"),
        ("def f(): pass", (7, 11), "'def' cannot be used in a block. write it as (def name"),
        ("class A: pass", (7, 11), "'class' cannot be used"),
        ("x = lambda: 1", (7, 15), "'lambda' cannot be used"),
        ("try:\n  pass\nexcept: pass", (7, 11), "'try' cannot be used"),
        ("del x", (7, 11), "'del' cannot be used"),
        ("x = {1, 2}", (7, 15), "'set' cannot be used in a block. use a tuple: the order"),
        ("x = {}", (7, 15), "'dict' cannot be used"),
        ("x = ().__class__", (7, 15), "'.__class__' cannot be used here"),
        ("x = 'a'.join(('b',))", (7, 15), "'.join' cannot be used here"),
        ("x = math.factorial(9)", (7, 15), "There is no 'math.factorial' here."),
        ("x = math.sine(1)", (7, 15), "did you mean 'sin'?"),
        ("x = open('f')", (7, 15), "'open' cannot be called"),
        ("x = speed", (7, 15), "There is no 'speed' here."),
        ("x = robot.rang.read()", (7, 15), "The robot has no 'rang'. did you mean 'range'?"),
        ("robot.motor.read()", (7, 11), "'robot.motor' has no 'read'."),
        ("x = robot.range", (7, 15), "'robot.range' alone is not a value. robot.range.read()"),
        ("robot.motor.power = 5", (7, 11), "Only variables can be assigned."),
        ("_x = 1", (7, 11), "'_x' cannot be assigned"),
        ("math = 1", (7, 11), "'math' cannot be assigned"),
        ("x = f'{x:{x}}'", (7, 17), "A format must be constant"),
        ("x = f'{x:99999}'", (7, 17), "A format wider than 1000"),
        ("x = (1 +", (7, 15), "Python: "),
        ("x = 1\n  y = 2\n    z = 3", (7, 18), "Python: "),
        ("x = 3[0]", (7, 15), "Only text and tuples have elements."),
        ("x = None[0]", (7, 15), "Only text and tuples have elements."),
        ("x = x is 3", (7, 15), "'is' compares with None only. compare values by ==."),
        ("x = 3 y", (7, 17), "Python: invalid syntax"),
        ("", (7, 11), "The brackets are empty"),
        ("x = b'bytes'", (7, 15), "is not a number, text, True, False or None"),
        ("x = max(*x)", (7, 19), "'starred' cannot be used"),
        ("x = [i for i in (1, 2)]; y = i", (7, 40), "There is no 'i' here"),
        ("x = [i for i in i]", (7, 27), "There is no 'i' here"),
        ("x = robot.range.read < 20", (7, 15), "'robot.range.read' must be called. robot.range.read()."),
        ("robot.stop", (7, 11), "'robot.stop' must be called. robot.stop()."),
        ("robot.motor.start", (7, 11), "'robot.motor.start' must be called. robot.motor.start(value)."),
        ("robot.motor.start()", (7, 11), "'start' takes 1 values, and is given 0. robot.motor.start(50)."),
        ("x = robot.range.read(3)", (7, 15), "'read' takes 0 values, and is given 1. robot.range.read()."),
        ("robot.stop(1)", (7, 11), "'stop' takes 0 values, and is given 1. robot.stop()."),
        ("print(x)", (7, 11), "'print' cannot be called"),
        ("x = near(1, 2)", (7, 15), "'near' takes 1 values, and is given 2"),
        ("x = int(x, base=2)", (7, 22), "'base=' cannot be used here"),
        ("x = " + "(" * 120 + "1" + ")" * 120 + " " * 4000, (7, 11), "The block has"),
        ("x = " + "-" * 200 + "1", (7, 11), "nested too deeply"),
    ],
)
def test_mistake_is_named_at_its_place(text: str, place: tuple[int, int], message: str) -> None:
    found = problems_of(text, "block", {"near": (("limit",), "limit < 3")}, "x")
    assert found, text
    line, column, words = found[0]
    assert message in words
    # Where a text with values begins, and an unclosed bracket, depends on the version of Python.
    assert ((line, column) == place) or text.startswith(("x = f", "x = (1"))


# -- how long they take -----------------------------------------------------------------------------------------------

HOSTILE = [
    "for i in range(10000):\n  for j in range(10000): pass",
    "x = 9 ** 9 ** 9",
    "x = 2 ** 100000",
    "x = 1 << 10 ** 9",
    "x = 'a' * 10 ** 9",
    "x = (0,) * 10 ** 9",
    "x = [[0] * 8000 for i in range(10000)]",
    "t = (0,)\nfor i in range(60): t = (t, t)\nx = str(t)",
    "t = (0,)\nfor i in range(9000): t = (t,)\nx = str(t)",
    "t = u = (0,)\nfor i in range(60):\n  t = (t, t)\n  u = (u, u)\nx = t == u",
    "t = 'a'\nfor i in range(60): t = t + t\nx = t",
    "x = f'{x:1000}' * 10 ** 6",
    "x = '%1000000000d' % 5",
    "x = round(5, -10 ** 9)",
    "x = sum([(1,) * 60000, (1,) * 60000], ())",
    "x = range(10 ** 18)",
    "x = tuple(range(10 ** 9))",
    "x = [sorted(tuple(range(5000))) for i in range(10000)]",
    "x = [max(tuple(range(5000))) for i in range(10000)]",
    "x = [9999 in tuple(range(9000)) for i in range(10000)]",
    "t = tuple(range(9000))\nx = [t[:] for i in range(10000)]",
    "t = tuple(range(9000))\nx = [t == t for i in range(10000)]",
    "t = tuple(range(9000))\nx = [f'{t}' for i in range(10000)]",
    "t = tuple(range(9000))\nfor i in range(10000): u = str(t)",
    "x = [(i, j) for i in range(5000) for j in range(5000)]",
    "x = int('9' * 60000)",
    "x = 7\nfor i in range(10000): x = x * x",
    "x = 7\nfor i in range(10000): x += x",
    "x = zip(range(10000), range(10000))",
]


@pytest.mark.unmeasured
@pytest.mark.parametrize("text", HOSTILE)
def test_hostile_block_ends_at_once(text: str) -> None:
    before_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    began_s = time.process_time()
    with pytest.raises(Exception) as caught:  # noqa: PT011 - any, but the block must end
        run(text, x=1)
    assert time.process_time() - began_s < 0.2 * slowness()  # 50 ms, on a machine that does other work
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before_kb < 64_000
    assert isinstance(caught.value, (BlockError, ValueError, OverflowError, RecursionError, Exception))


# What each of them works on is as large as it may be.
LARGE = """t = tuple(range(900)); s = 'abcdefgh' * 400; b = 7 ** 300; c = str(b)
u = [(i, i + 1) for i in range(300)]; f = [i * 1.1 for i in range(180)]
"""
OPERATIONS = [
    "9000 in t", "'z' in s", "t == tuple(range(900))", "t < t", "sorted(u)", "sorted(f)", "str(f)", "str(u)",
    "sum(range(10000))", "max(range(10000))", "1.5 in range(10000)", "b * b", "b // 3", "b % (b - 1)", "str(b)",
    "b ** 1", "float(s)", "float(c)", "int(c)", "f'{f}'", "f'{f!r:.1}'", "t[1:]", "s[1:]", "t + t", "s + s", "u * 1",
    "s * 1", "round(b, -99)", "round(1.5, 99)", "math.dist(t, t)", "math.hypot(1.5, 2.5)", "abs(b)", "divmod(b, b - 1)",
    "tuple(zip(t, t))", "max(zip(t, t))", "tuple(enumerate(t))", "tuple(reversed(t))", "any(t)", "all(t)", "max(s)",
    "[i for i in t]", "sum(i for i in t)", "s == s + ''", "(t, u)", "[[1, 2], [3, x]]", "log(s)", "robot.stop()",
    "robot.range.read()", "x + 1", "x * x", "x << 900", "x ** 2", "x if x else 3", "-x", "len(t)", "random()", "b == b",
    "f'{x:1000}'", "f'{s:1000}'", "max(f, default=3)", "2.5 ** x", "x in (1, 2, 3)", "tuple(s)", "sorted(s)", "(x, x)",
    "int('9' * 300)", "t[x]", "now_ms", "b >> 3", "b - b",
]  # fmt: skip


def time_hostile(operation: str, form: str) -> None:
    many = [operation] * ((3700 - len(LARGE)) // (len(operation) + 2))
    each, loop = "; ".join(many), "for i in range(10000): "
    code = {"once": f"{loop}y = {operation}", "many": loop + each, "tuple": f"{loop}y = {', '.join(many[:300])}"}[form]
    block, problems = compile_block(LARGE + code, HERE, "block", scope({"x": 1}))
    assert block is not None, problems
    robot = SimpleNamespace(range=SimpleNamespace(read=lambda: 42.0), stop=lambda: None)
    bound, m = block.bind(Bindings([1], {"x": 0}, robot)), context()
    began_s = time.process_time()
    with contextlib.suppress(BlockError, ArithmeticError, TypeError, ValueError):
        bound(m)
    assert time.process_time() - began_s < 0.2 * slowness(), code[:80]  # 50 ms, on a machine that does other work


@pytest.mark.unmeasured
@given(st.sampled_from(OPERATIONS), st.sampled_from(["once", "many", "tuple"]))
def test_operation_on_large_values_in_a_loop_ends_at_once(operation: str, form: str) -> None:
    time_hostile(operation, form)


@pytest.mark.slow
def test_every_operation_on_large_values_in_a_loop_ends_at_once() -> None:
    for operation in OPERATIONS:
        for form in ("once", "many", "tuple"):
            time_hostile(operation, form)


@pytest.mark.unmeasured
def test_all_blocks_of_a_step_share_their_work_and_small_ones_have_some() -> None:
    greedy = "\n(running [for i in range(10000): x = sum(range(1000))])" * 300
    text = f"(var x := [0])(machine m (state a {greedy} (running [x = max(x, -1) + 7])))(spawn m a)"
    interpreter = Interpreter(parse(text))
    interpreter.spawn(0)
    began_s = time.process_time()
    interpreter.step(1)
    assert time.process_time() - began_s < 0.2 * slowness()
    assert interpreter.variables == {"x": 7}
    assert "compute too much" in next(iter(interpreter.problems.values())).message


def test_helpers_that_multiply_what_they_call_are_refused() -> None:
    levels = "".join(f"(def f{i} [{' + '.join([f'f{i - 1}()'] * 30)}])" for i in range(1, 9))
    with pytest.raises(ProgramError, match="the helpers that it calls are too large"):
        parse(f"(def f0 [1]){levels}(machine m (state a (running [log(f8())])))(spawn m a)")


NAMES = ["x", "y", "robot.range.read()", "now_ms", "math.pi", "3", "-0.5", "'ab'", "(1, 2)", "None", "True", "signal"]
JOINS = [
    " + ",
    " * ",
    " ** ",
    " - ",
    " / ",
    " // ",
    " % ",
    " << ",
    " >> ",
    " < ",
    " == ",
    " and ",
    " or ",
    " in ",
    ", ",
]
AROUND = [
    "[{} for x in (y, 1)]",
    "any(y for y in ({},) if x)",
    "str({})",
    "len({})",
    "[{}]",
    "({})",
    "max({})",
    "tuple({})",
    "-{}",
    "not {}",
    "{}[0]",
    "{}[:]",
    "int({})",
]


def random_expression(rng: random.Random, depth: int) -> str:
    if depth == 0 or rng.random() < 0.2:
        return rng.choice(NAMES)
    if rng.random() < 0.4:
        return rng.choice(AROUND).format(random_expression(rng, depth - 1))
    return f"({random_expression(rng, depth - 1)}{rng.choice(JOINS)}{random_expression(rng, depth - 1)})"


def plain_expression(rng: random.Random, names: str, depth: int) -> str:
    """Return an expression whose value is an integer; its comprehensions hide names."""
    if depth == 0 or rng.random() < 0.1:
        return rng.choice([*names, str(rng.randrange(9))])

    def one(more: str = "") -> str:
        return plain_expression(rng, names + more, depth - 1)

    how = rng.randrange(6)
    if how == 0:
        return f"({one()} {rng.choice(['+', '-', '*', '//', '%', 'and', 'or', '<', '==', '<<'])} {one()})"
    if how == 1:
        return f"({one()} if {one()} else {one()})"
    if how == 2:
        return f"{rng.choice(['max', 'min'])}({one()}, {one()})"
    if how == 3:
        return f"({one()}, {one()}, {one()})[{rng.randrange(3)}]"
    name, inner = rng.choice("xyi"), rng.choice("xyj")
    rows = f"for {name} in ({one()}, {one()}) if {one(name)} for {inner} in range(abs({one(name)}) % 3)"
    return f"{rng.choice(['sum', 'any', 'len'])}([{one(name + inner)} {rows}])"


@given(st.integers(0, 10**9), st.integers(-5, 5), st.integers(-5, 5))
def test_value_of_an_expression_is_that_of_python(seed: int, x: int, y: int) -> None:
    text = plain_expression(random.Random(seed), "xy", 3)
    try:
        due = eval(text, {"x": x, "y": y})
    except (ArithmeticError, ValueError, NameError):
        return
    if abs(due) < 2**60:
        assert run(text, "condition", x=x, y=y) == due


def random_block(rng: random.Random) -> str:
    lines = []
    for _ in range(rng.randrange(1, 4)):
        indent = rng.choice(["", "for i in range(50): ", "if x: "])
        lines.append(f"{indent}{rng.choice('xyz')} {rng.choice(['=', '+=', '*='])} {random_expression(rng, 4)}")
    return "\n".join(lines)


@given(st.integers(0, 10**9))
def test_random_block_is_refused_or_ends_at_once(seed: int) -> None:
    try_random_block(seed)


@pytest.mark.nightly(minutes=2)
def test_hundred_thousand_random_blocks_are_refused_or_end_at_once() -> None:
    for seed in range(100_000):
        try_random_block(seed)


def try_random_block(seed: int) -> None:
    text = random_block(random.Random(seed))
    block, problems = compile_block(text, HERE, "block", scope({"x": 1, "y": 2}))
    assert (block is None) == any(one.is_error for one in problems)
    if block is not None:
        slots = [1, 2]
        robot = SimpleNamespace(range=SimpleNamespace(read=lambda: 42.0))
        began_s = time.process_time()
        try:
            block.bind(Bindings(slots, {"x": 0, "y": 1}, robot))(context())
        except (BlockError, ArithmeticError, TypeError, ValueError, LookupError, RecursionError, NameError):
            pass
        except Exception as error:
            assert type(error).__name__ == "ParameterError", (text, error)
        assert time.process_time() - began_s < 0.2 * slowness(), text
