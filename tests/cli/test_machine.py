"""`snr machine draw`: finds the machine in a file, and says what it found if there is none, or more than one."""

from __future__ import annotations

from pathlib import Path

import pytest

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
    machine("draw", lamp, "", to)
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
