"""`snr machine draw`: finds the machine in a file, and says what it found if there is none, or more than one."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import typer

from snr_sim.cli.machine import machine
from snr_sim.prelude.errors import ConfigError, SnrError, UnknownNameError

LAMP = """
from snr_sim.behaviors import after, machine, on, state

BLINK = machine("blink", "lit", [state("lit", after(0.5, to="dark")), state("dark", after(0.5, to="lit"))])
LIT = state("lit", on("press", to="off"), machines=[BLINK])
LAMP = machine("lamp", "off", [state("off", on("press", to="lit")), LIT])
"""


@pytest.fixture
def lamp(tmp_path: Path) -> str:
    (tmp_path / "lamp.py").write_text(LAMP)
    return str(tmp_path / "lamp.py")


@pytest.mark.parametrize(
    ("to", "beginning"),
    [("mermaid", "stateDiagram-v2"), ("dot", "digraph"), ("scxml", "<?xml"), ("text", "(machine lamp")],
)
def test_machine_that_is_in_no_other_one_is_drawn(
    lamp: str, to: str, beginning: str, capsys: pytest.CaptureFixture[str]
) -> None:
    machine("draw", lamp, to=to)
    shown = capsys.readouterr().out
    assert shown.startswith(beginning)
    assert "blink" in shown


def test_machine_of_a_name_is_drawn(lamp: str, capsys: pytest.CaptureFixture[str]) -> None:
    machine("draw", lamp, "BLINK", "text")
    assert "lamp" not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("what", "name", "to", "message"),
    [
        ("drow", "", "dot", "did you mean 'draw'"),
        ("draw", "LAMB", "dot", "did you mean 'LAMP'"),
        ("draw", "", "dott", "did you mean 'dot'"),
    ],
)
def test_unknown_word_is_answered_with_the_nearest(lamp: str, what: str, name: str, to: str, message: str) -> None:
    with pytest.raises(UnknownNameError, match=message):
        machine(what, lamp, name, to)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x = 1\n", "has no machine"),
        (LAMP + "OTHER = machine('other', 'a', [state('a')])\n", "has several machines.*LAMP, OTHER"),
        (LAMP.replace('to="dark"', 'to="drak"'), "leads to 'drak', which is not a state"),
        ("def f(:\n", "invalid syntax"),
    ],
)
def test_file_without_one_machine_is_refused(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "lamp.py").write_text(text)
    with pytest.raises(SnrError, match=f"(?s){message}"):
        machine("draw", str(tmp_path / "lamp.py"), "", "dot")


def test_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises((UnknownNameError, ConfigError), match=r"no file .*nothing\.py"):
        machine("draw", str(tmp_path / "nothing.py"), "", "dot")


# -- LRP --------------------------------------------------------------------------------------------------------------

GOOD = "(machine m (event never) (state a (onentry [robot.throttle.start(1)])))\n(spawn m a)\n"


@pytest.fixture
def program(tmp_path: Path) -> Path:
    (tmp_path / "go.lrp").write_text(GOOD)
    return tmp_path / "go.lrp"


def test_program_in_lrp_is_drawn(program: Path, capsys: pytest.CaptureFixture[str]) -> None:
    machine("draw", str(program), robot="lander")
    assert "m_a" in capsys.readouterr().out


def test_check_prints_warnings_with_their_lines(program: Path, capsys: pytest.CaptureFixture[str]) -> None:
    machine("check", str(program), robot="lander")
    shown = capsys.readouterr().out.splitlines()
    assert shown[0] == f"{program}:1:12: warning: No transition uses the event 'never'."
    assert shown[1].endswith(GOOD.splitlines()[0])
    assert shown[2].index("^") == 7 + 12


def test_check_warns_of_ends_and_of_times_between_steps(program: Path, capsys: pytest.CaptureFixture[str]) -> None:
    program.write_text("(machine m (state a) (state b)\n (ontime 25 a -> b)\n (ontime 30 b -> a))\n(spawn m a)\n")
    machine("check", str(program))
    shown = capsys.readouterr().out
    assert ":2:2: warning: After 25 ms there is no step: it is taken at 30 ms." in shown
    assert shown.count("warning") == 1
    program.write_text("(machine m (state a) (state b)\n (ontime 30 a -> b))\n(spawn m a)\n")
    machine("check", str(program))
    assert ":1:22: warning: State 'b' cannot be left." in capsys.readouterr().out


def test_check_prints_mistakes_and_exits_with_1(program: Path, capsys: pytest.CaptureFixture[str]) -> None:
    program.write_text(GOOD.replace("throttle", "trottle").replace("(spawn m a)", "(spawn m b)"))
    with pytest.raises(typer.Exit) as caught:
        machine("check", str(program), robot="lander")
    assert caught.value.exit_code == 1
    shown = capsys.readouterr().out
    assert "1:45: The robot has no 'trottle'." in shown
    assert "Try: did you mean 'throttle'?" in shown
    assert "2:10: Machine 'm' has no state 'b'." in shown


def test_check_prints_json(program: Path, capsys: pytest.CaptureFixture[str]) -> None:
    program.write_text("(machine m (state a)\n")
    with pytest.raises(typer.Exit):
        machine("check", str(program), as_json=True)
    (row,) = json.loads(capsys.readouterr().out)["problems"]
    assert (row["line"], row["column"], row["is_error"]) == (1, 1, True)


def test_check_of_python_says_that_nothing_was_found(lamp: str, capsys: pytest.CaptureFixture[str]) -> None:
    machine("check", lamp)
    assert capsys.readouterr().out == f"{lamp}: no problem was found.\n"


def test_drawing_is_not_json(lamp: str) -> None:
    with pytest.raises(SnrError, match="draw prints no JSON"):
        machine("draw", lamp, as_json=True)
