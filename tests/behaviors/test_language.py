"""LRP: what a text means, and that each mistake is named at its place, however broken the text is."""

from __future__ import annotations

import contextlib
import random
import time
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from snr_sim.behaviors import Interpreter, Program, ProgramError, draw, parse
from snr_sim.behaviors.reader import MAX_CHARACTERS, MAX_PROBLEMS, read
from tests.slowness import slowness

MS = 1_000_000
PARTS = {"range": frozenset({"read"}), "light": frozenset({"start", "stop"})}
LAMP = """
; a lamp that is bright while someone is near
(var bright := [80])
(var twice := [2 * bright])
(def near limit [robot.range.read() is not None and robot.range.read() < limit])
(machine lamp
  (var count := [0])
  (event near [near(150)])
  (event press)
  (state off (onentry [robot.light.start(0)]))
  (state lit
    (onentry [robot.light.start(bright)
              count = count + 1])
    (machine blink
      (state a (running [twice += 1]))
      (state b)
      (ontime 250 a -> b)
      (ontime [bright * 2] b->a)
      (exit press b -> off))
    (onentry (spawn blink a)))
  (on near off -> lit switch_on)
  (ontime 3000 lit -> off too_long))
(spawn lamp off)
"""


class Light:
    """Parts as a bridge gives them."""

    def __init__(self) -> None:
        self.near_cm: float | None = None
        self.commands: list[float] = []

    @property
    def robot(self) -> Any:
        from snr_sim.behaviors import Bridge, Drive, Read

        return Bridge({"range": Read("range")}, {"light": Drive("light", "level", 0.0, 100.0)})


def started(text: str, **pages: Any) -> tuple[Interpreter, dict[str, Any]]:
    light = Light()
    interpreter = Interpreter(parse(text, light.robot.parts), pages, bridge=light.robot)
    interpreter.spawn(0)
    return interpreter, pages


def levels(interpreter: Interpreter) -> list[Any]:
    assert interpreter.robot is not None
    return [task.val_list[0].data["level"] for task in interpreter.robot.take_tasks()]


def problems(text: str, parts: Any = PARTS) -> list[tuple[int, int, str]]:
    with pytest.raises(ProgramError) as caught:
        parse(text, parts)
    return [(one.place.line, one.place.column, f"{one.message} {one.fix}".strip()) for one in caught.value.problems]


# -- meaning ----------------------------------------------------------------------------------------------------------


def test_lamp_is_switched_on_blinks_and_is_switched_off() -> None:
    interpreter, pages = started(LAMP)
    assert levels(interpreter) == [0.0]
    pages["range"] = 100.0
    assert [one.name for one in interpreter.step(10 * MS)] == ["switch_on", "spawn"]
    assert levels(interpreter) == [80.0]
    interpreter.step(20 * MS)
    assert interpreter.variables == {"bright": 80, "twice": 161, "lamp.count": 1}
    assert interpreter.step(260 * MS)[0].target == "b"
    assert interpreter.step(419 * MS) == []
    assert interpreter.step(420 * MS)[0].target == "a"  # 160 ms later
    assert interpreter.step(3010 * MS)[0].name == "too_long"
    assert interpreter.active == {"lamp": "off"}


def test_exit_from_inside_by_a_signal_of_the_machine_around() -> None:
    interpreter, _ = started(LAMP, range=100.0)
    interpreter.step(10 * MS)
    interpreter.step(260 * MS)
    assert interpreter.step(270 * MS, "press")[0].kind == "exit"
    assert interpreter.active == {"lamp": "off"}


def test_byte_order_mark_of_a_file_is_left_out() -> None:
    assert parse("\ufeff" + LAMP.strip(), PARTS).spawns[0].machine.place.line == 5


def test_warnings_of_a_program_are_at_most_twenty() -> None:
    text = "(machine m " + "".join(f"(event e{i})" for i in range(300)) + "(state s))(spawn m s)"
    assert len(parse(text).warnings) == MAX_PROBLEMS


def test_equal_texts_are_one_program() -> None:
    assert parse(LAMP, PARTS) is parse(LAMP, PARTS)


def test_inner_variable_hides_the_outer_one_where_it_is_declared_and_nowhere_else() -> None:
    text = """
    (var v := [1])
    (def see [v])
    (machine other (var w := [0]) (state s (running [w = see()])))
    (machine m
      (var v := [10])
      (var w := [0])
      (state s (running [w = v; v = 20]) (onentry (spawn other s))))
    (spawn m s)
    """
    interpreter, _ = started(text)
    interpreter.step(1)
    assert interpreter.variables == {"v": 1, "m.v": 20, "m.w": 10, "m/s/other.w": 1}


def test_arrow_and_star_need_no_space() -> None:
    text = "(machine m (event e) (state a) (state b-2) (on e a->b-2) (on e *->a))(spawn m a)"
    (spawn,) = parse(text).spawns
    assert [(one.source, one.target) for one in spawn.machine.transitions] == [("a", "b-2"), ("*", "a")]


@pytest.mark.parametrize(
    "block",
    [
        "n = 5; robot.light.start(50); n = 1 / 0",
        "n = 1 / 0",
        "n = k = 1 / 0",
        "n, k = 1, 1 / 0",
        "n, (k, k) = 1, (2 / 0, 3)",
        "n += 1 / 0",
        "log(n); robot.light.start(1 / 0)",
        "(robot.light.start(50), 1 / 0)",
        "robot.light.start(50) or robot.light.start(1 / 0)",
        "[robot.light.start(1 / (2 - x)) for x in range(3)]",
        "for n in (1, 2): n / (2 - n)",
        "for x in range(3): n = 1 / (2 - x)",
        "if True: n = 5; 1 / 0",
        "if robot.light.start(50) is None: 1 / 0",
        "n = 5 if robot.light.start(50) else 1 / 0",
        "n = go() or 1 / 0",
    ],
)
def test_block_that_fails_is_undone_with_its_commands_and_noted(block: str) -> None:
    helper = "(def go [robot.light.start(50)])"
    text = f"(var n := [0])(var k := [0]){helper}(machine m (state a (onentry [{block}])))(spawn m a)"
    interpreter, _ = started(text)
    assert interpreter.variables == {"n": 0, "k": 0}
    assert levels(interpreter) == []
    (problem,) = interpreter.problems.values()
    assert (problem.line, problem.message) == (1, "ZeroDivisionError: division by zero")


@pytest.mark.parametrize(("word", "active"), [("go_on", {"m": "a", "n": "a"}), ("stop", {"n": "a"})])
def test_onerror_decides_what_a_failing_block_ends(word: str, active: Any) -> None:
    text = f"(onerror {word})(machine m (state a (running [1 / 0])))(machine n (state a))(spawn m a)(spawn n a)"
    interpreter, _ = started(text)
    interpreter.step(1)
    assert interpreter.active == active


def test_onerror_fail_raises() -> None:
    interpreter, _ = started("(onerror fail)(machine m (state a (running [1 / 0])))(spawn m a)")
    with pytest.raises(ZeroDivisionError):
        interpreter.step(1)


def test_time_out_that_cannot_be_computed_is_noted_and_not_due() -> None:
    interpreter, _ = started("(machine m (state a) (state b) (ontime [1 / 0] a -> b))(spawn m a)")
    assert interpreter.step(10 * MS) == []
    assert len(interpreter.problems) == 1


def test_program_can_be_drawn() -> None:
    assert "lamp_off --> lamp_lit : [near]" in draw(parse(LAMP, PARTS))


# -- mistakes ---------------------------------------------------------------------------------------------------------


def changed(old: str, new: str) -> str:
    assert LAMP.count(old) >= 1
    return LAMP.replace(old, new, 1)


@pytest.mark.parametrize(
    ("text", "line", "column", "message"),
    [
        (changed("(ontime 3000", "(ontim 3000"), 22, 4, "'ontim' is not a form of a machine. did you mean 'ontime'?"),
        (changed("(onentry [robot.light.start(0)])", "(onentri [1])"), 10, 15, "did you mean 'onentry'?"),
        (
            changed("(machine lamp", "(machin lamp"),
            6,
            2,
            "'machin' is not a form of a program. did you mean 'machine'?",
        ),
        (changed("(on near off", "(on naer off"), 21, 7, "There is no event 'naer' here. did you mean 'near'?"),
        (changed("off -> lit", "of -> lit"), 21, 12, "There is no state 'of' here. did you mean 'off'?"),
        (changed("off -> lit", "off -> lid"), 21, 19, "There is no state 'lid' here. did you mean 'lit'?"),
        (changed("press b -> off", "press b -> of"), 19, 24, "There is no state 'of' here. did you mean 'off'?"),
        (
            changed("(spawn lamp off)", "(spawn lamb off)"),
            23,
            8,
            "There is no machine 'lamb' here. did you mean 'lamp'?",
        ),
        (
            changed("(spawn lamp off)", "(spawn lamp of)"),
            23,
            13,
            "Machine 'lamp' has no state 'of'. did you mean 'off'?",
        ),
        (
            changed("(spawn blink a)", "(spawn blimk a)"),
            20,
            21,
            "There is no machine 'blimk' here. did you mean 'blink'",
        ),
        (changed("count = count", "count = cuont"), 13, 23, "There is no 'cuont' here. did you mean 'count'?"),
        (changed("light.start(bright)", "ligth.start(bright)"), 12, 15, "no 'ligth'. did you mean 'light'?"),
        (changed("[near(150)]", "[near(150, 3)]"), 8, 16, "'near' takes 1 values, and is given 2"),
        (changed("(ontime 3000", "(ontime soon"), 22, 11, "There is no variable 'soon' here."),
        (changed("(ontime 3000", "(ontime 3000000000000"), 22, 11, "is too long"),
        (changed("(event press)", "(event press)(event press)"), 9, 23, "There are two events 'press' here."),
        (changed("(var twice", "(var bright"), 4, 6, "'bright' is declared twice here."),
        (changed("(var twice", "(var tw-ice"), 4, 6, "'tw-ice' cannot be used in Python."),
        (
            changed("(var twice", "(var class"),
            4,
            6,
            "'class' has a meaning in Python or in blocks. rename it: class_1.",
        ),
        (changed("(def near limit", "(def near limit limit"), 5, 17, "'limit' is declared twice here. rename one."),
        (changed("(def near limit", "(def near robot"), 5, 11, "'robot' has a meaning in Python or in blocks."),
        (changed("(def near", "(def random"), 5, 6, "'random' has a meaning in Python or in blocks."),
        (changed("(def near limit", "(def near 5"), 5, 1, "(def ...) is not complete, or has too much."),
        (changed("(def near limit", "(def near *"), 5, 1, "(def ...) is not complete, or has too much."),
        (changed(":= [80]", ":= [robot.range.read()]"), 3, 17, "The robot has no 'range'"),
        (changed(":= [80]", ":= [1 / 0]"), 3, 17, "ZeroDivisionError"),
        (changed(":= [80]", ":= [len]"), 3, 17, "cannot be a builtin_function_or_method"),
        (changed(":= [80]", "80"), 3, 1, "(var ...) is not complete, or has too much. (var NAME := [value])."),
        (changed("(state b)", "(state)"), 16, 7, "(state ...) is not complete, or has too much. (state NAME ...)."),
        (changed("-> off too_long", "off too_long"), 22, 3, "(ontime ...) is not complete"),
        (changed("[twice += 1]", "[twice +=]"), 15, 34, "Python: invalid syntax"),
        (changed("[twice += 1]", "[while 1: pass]"), 15, 26, "'while' cannot be used in a block."),
        (changed("(spawn lamp off)", "(onerror never)"), 23, 10, "(onerror never) is not known."),
        (changed("(ontime 3000 lit -> off too_long)", "(exit press lit -> off)"), 22, 3, "There is no machine around"),
        (
            changed("(onentry (spawn blink a))", "(onentry (spawn lamp off))"),
            20,
            21,
            "Machine 'lamp' would contain itself",
        ),
        ("(machine m (state a) (state a))(spawn m a)", 1, 22, "Machine 'm' has two states 'a'."),
        ("(machine m (event w robot.x.read() < 2) (state a))", 1, 26, "brackets: [robot.x.read() < 2]."),
        ("(machine m (state a (machine n (state b) (exit [1] * -> a))))", 1, 52, "(exit ...) names one state"),
        ("(machine m (state a)", 1, 1, "'(' is not closed. add ')' before the end of the text."),
        ("(machine m (state a)))", 1, 22, "')' closes nothing."),
        ("(machine m (state a (running [x = (1])))", 1, 30, "'(' is closed by ']'."),
        ("(machine m (state a (running ['a])))", 1, 30, "A text in the code is not closed."),
        ("(machine m (state a (running [1", 1, 30, "'[' is not closed."),
        ("machine m", 1, 1, "machine is outside of all forms."),
        ("(machine m (state ä))(spawn m a)", 1, 19, "'ä' cannot be here."),
        ("(state a)", 1, 2, "'state' is not a form of a program."),
        ("()", 1, 1, "A form of a program begins with a word."),
        ("(machine m 5 (state a))(spawn m a)", 1, 12, "'5' cannot be here. (machine NAME ...)."),
    ],
)
def test_mistake_is_named_at_its_place(text: str, line: int, column: int, message: str) -> None:
    found = problems(text)
    assert any(message in words for _, _, words in found), found
    (at,) = [(row, place) for row, place, words in found if message in words][:1]
    assert at == (line, column)


def test_unclosed_bracket_is_found_by_the_next_form_at_its_column() -> None:
    text = "(machine m\n  (state a\n  (state b)\n  (event e)\n  (on e a -> b))\n(spawn m a)\n"
    assert problems(text)[0] == (2, 3, "'(' is not closed. add ')' before line 3, where the next form begins.")


def test_several_mistakes_are_reported_together_and_no_more_than_twenty() -> None:
    three = LAMP.replace("(ontime 3000", "(ontim 3000").replace("cuont", "x").replace("(on near off", "(on naer off")
    assert len(problems(three)) == 2
    assert len(problems("".join(f"(state s{i})" for i in range(100)))) == MAX_PROBLEMS


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("(state a", "(var x := [1]) (state a", "Nothing uses the variable 'x'."),
        ("(onentry", "(running", "This repeats the same command in each step."),
        ("(on go", "(eps a -> b) (on go", "Transition 'a->b' is never taken: 'a->b' in line 1 comes first."),
        ("(on go", "(eps a -> b) (eps b -> a now) (on go", "These states follow each other at once: a -> b -> a."),
    ],
)
def test_doubtful_program_has_a_warning(old: str, new: str, message: str) -> None:
    text = "(machine m (event go) (state a (onentry [robot.motor.start(-5.5)])) (state b) (on go a -> b))(spawn m a)"
    assert parse(text).warnings == ()
    assert message in [one.message for one in parse(text.replace(old, new)).warnings]


def test_variable_that_is_used_anywhere_has_no_warning() -> None:
    text = (
        "(var a := [1])(var b := [a])(def c [b])(var out := [0])(machine m (state s (onentry [out = c()])))(spawn m s)"
    )
    assert parse(text).warnings == ()
    assert parse("(var a := [1])(export a)(machine m (state s))(spawn m s)").warnings == ()


def test_doubtful_things_are_warnings() -> None:
    text = "(machine m (event never) (state a) (state b) (machine_ x))(spawn m a)".replace("(machine_ x)", "")
    assert [one.message for one in parse(text).warnings] == [
        "No transition uses the event 'never'.",
        "No run can reach state 'b'.",
    ]
    assert parse("(machine m (state a))").warnings[0].message == "No machine is spawned."


@pytest.mark.parametrize(
    "text",
    [
        "(" * 5000,
        ")" * 5000,
        "(machine m " * 200,
        "[" * 5000,
        "(machine m (state a [" + "(" * 3000,
        "\x00",
        '"',
        "; only",
    ],
)
def test_text_that_is_nothing_but_brackets_is_answered(text: str) -> None:
    _, found = read(text)
    assert len(found) <= MAX_PROBLEMS
    try:
        parse(text)
    except ProgramError as error:
        assert error.problems


def test_large_texts_are_answered_in_time() -> None:
    with pytest.raises(ProgramError, match="The text has 10000000 characters"):
        parse("(" * 10_000_000)
    many = "(state s)" * 5001
    with pytest.raises(ProgramError, match="more than 10000 states"):
        parse(f"(machine m {many})(spawn m s)(spawn m s)")


def filled(unit: str) -> str:
    """Return as many numbered copies of a unit as a text may have; `#` is the number, and `@` the one before it."""
    text, i = "", 0
    while len(text) < MAX_CHARACTERS - 200:
        text, i = text + unit.replace("#", str(i + 1)).replace("@", str(i)), i + 1
    return text


def in_machine(states: str) -> str:
    return f"(machine m (state s0){states})(spawn m s0)"


# Each took 1 s to several minutes before it was bounded, or takes longest of those that are allowed.
LONG = {
    "code that is not closed": "(a" + filled("\n  (x [") + ")",
    "code whose ends are texts": "(machine m" + filled("\n  (x [\n#'''\n'''\n"),
    "forms of several lines": in_machine(filled("(state s#\n)\n")),
    "forms in one line": filled("()"),
    "helpers that call each other": "(def d0 x [x])" + filled("(def d# x [d@(x)])"),
    "helpers": filled("(def d# x [x])"),
    "variables": filled("(var v# := [#])"),
    "blocks": in_machine(filled("(state s# (running [log(#)]))")),
    "unknown states": in_machine(filled("(state s#)(eps s# -> x#)")),
    "unknown events": in_machine(filled("(event e#)(on f# s0 -> s0)")),
    "transitions of all states": in_machine(filled("(state s#)(on [now_ms > #] * -> s#)")),
}


@pytest.mark.slow
@pytest.mark.parametrize("what", LONG)
def test_text_of_the_greatest_length_takes_a_second_at_most(what: str) -> None:
    began_s = time.thread_time()
    with contextlib.suppress(ProgramError):
        parse(LONG[what])
    assert time.thread_time() - began_s < slowness()


@pytest.mark.parametrize(
    ("levels", "spawns", "message"), [(20, 2, "more than 10000 states"), (150, 1, "nested too deeply")]
)
def test_machines_that_spawn_many_machines_are_refused(levels: int, spawns: int, message: str) -> None:
    texts = ["(machine m0 (state s))"]
    texts += [f"(machine m{i} (state s {f'(onentry (spawn m{i - 1} s))' * spawns}))" for i in range(1, levels)]
    with pytest.raises(ProgramError, match=message):
        parse("".join(reversed(texts)) + f"(spawn m{levels - 1} s)")


# -- broken texts -----------------------------------------------------------------------------------------------------

PIECES = [
    "(",
    ")",
    "[",
    "]",
    '"',
    "'",
    ";",
    "\n",
    "->",
    "*",
    ":=",
    " ",
    "state",
    "machine m",
    "x",
    "0",
    "(on",
    "é",
    "#",
]


def broken(rng: random.Random) -> str:
    """Return the lamp with a few pieces removed, doubled, or put elsewhere."""
    text = LAMP
    for _ in range(rng.randrange(1, 5)):
        at = rng.randrange(len(text))
        how = rng.randrange(4)
        if how == 0:
            text = text[:at] + text[at + rng.randrange(1, 12) :]
        elif how == 1:
            text = text[:at] + rng.choice(PIECES) + text[at:]
        elif how == 2:
            end = min(len(text), at + rng.randrange(1, 40))
            text = text[:at] + text[at:end] + text[at:]
        else:
            end = min(len(text), at + rng.randrange(1, 40))
            other = rng.randrange(len(text))
            text = text[:other] + text[at:end] + text[other:]
    return text


WORDS = st.sampled_from(["a", "f", "x", "class", "robot", "random", "max", "None", "m-n", "5", "*", "->", "[a]", "(x)"])


@given(st.sampled_from(["var", "def"]), st.lists(WORDS, max_size=4), st.sampled_from(["a", "a + f(1)", "f", "max(a)"]))
def test_declaration_of_any_words_is_refused_or_runs(form: str, words: list[str], code: str) -> None:
    declared = f"({form} {' '.join(words)} [{code}])"
    try:
        program = parse(f"(var x := [1]){declared}(machine m (state s (running [x = {code}])))(spawn m s)")
    except ProgramError as error:
        assert all(1 <= one.place.column <= len(declared) + 80 for one in error.problems)
        return
    interpreter = Interpreter(program)
    interpreter.spawn(0)
    interpreter.step(1)


@given(st.integers(0, 10**9))
def test_broken_program_is_refused_with_places_or_runs(seed: int) -> None:
    try_broken(seed)


@pytest.mark.nightly(minutes=3)
def test_hundred_thousand_broken_programs_are_refused_with_places_or_run() -> None:
    for seed in range(100_000):
        try_broken(seed)


def try_broken(seed: int) -> None:
    text = broken(random.Random(seed))
    lines = text.split("\n")
    try:
        program: Program = parse(text, PARTS)
    except ProgramError as error:
        assert 0 < len(error.problems) <= MAX_PROBLEMS
        for one in error.problems:
            assert one.is_error
            assert one.message
            assert 1 <= one.place.line <= len(lines) + 1, (one, text)
        return
    interpreter = Interpreter(program, {"range": 100.0}, bridge=Light().robot)
    interpreter.spawn(0)
    for i in range(5):
        interpreter.step(i * 300 * MS)
