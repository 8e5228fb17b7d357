"""`snr machine record`: a piece of a run as a test, which passes with the program and fails with a changed one."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import typer

from snr_sim.cli.machine import machine
from snr_sim.prelude import tasks
from snr_sim.prelude.errors import ParameterError, UnknownNameError
from snr_sim.prelude.values import decode_value
from snr_sim.scenario import library, replay_piece
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import run_recorded

STOP = library.find("robots", "dora").path / "controllers" / "stop.lrp"
# Stops, waits, and drives on for a random time; the signal `home` ends it.
PROGRAM = """(var turns := [0])
(machine dora
  (event home)
  (state waiting)
  (state forward (onentry [robot.motor_a.start(40); robot.motor_d.start(40)]) (running [turns = turns + 1]))
  (state stopped (onentry [robot.stop()]))
  (on home * -> waiting homing)
  (on [robot.ultra.read() is not None and turns < 200] waiting -> forward)
  (ontime [100 + 300 * random()] forward -> stopped)
  (ontime 250 stopped -> forward))
(spawn dora waiting)
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a program and its run, in which a signal and an edit came."""
    folder = tmp_path_factory.mktemp("record")
    (folder / "mine.lrp").write_text(PROGRAM)
    (folder / "run").mkdir()
    inputs = [(1.405, tasks.event("home")), (2.5, tasks.event("dora.edit", [PROGRAM.replace("250", "150")]))]
    request = Request("dora_wall", controller=str(folder / "mine.lrp"))
    run_recorded(prepare(request), folder / "run" / "trace.jsonl", inputs)
    return folder


@pytest.fixture
def printed(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[..., dict[str, Any]]:
    """Return a function that prints a test and returns the names of its file."""
    monkeypatch.chdir(folder)

    def made(from_s: float, until_s: float, **options: Any) -> dict[str, Any]:
        machine("record", "run", from_s=from_s, until_s=until_s, trust=True, **options)
        names: dict[str, Any] = {}
        exec(compile(capsys.readouterr().out, "test_piece.py", "exec"), names)
        return names

    return made


def expected_of(names: dict[str, Any]) -> list[Any]:
    return replay_piece(names["PIECE"], "mine.lrp")


def test_printed_test_passes(printed: Any) -> None:
    names = printed(1.0, 2.0)
    assert names["__doc__"].startswith("dora in run, 1 s to 2 s, printed by")
    names["test_dora_changes_its_states_as_recorded"]()
    changes = expected_of(names)
    assert (1.405, "dora", "forward", "waiting") in changes or (1.405, "dora", "stopped", "waiting") in changes
    assert all(1.0 <= at_s <= 2.0 for at_s, *_ in changes)
    assert len(changes) > 4


def test_printed_test_fails_with_a_changed_program(printed: Any, folder: Path) -> None:
    names = printed(1.0, 2.0)
    (folder / "mine.lrp").write_text(PROGRAM.replace("250", "240"))
    try:
        with pytest.raises(AssertionError):
            names["test_dora_changes_its_states_as_recorded"]()
    finally:
        (folder / "mine.lrp").write_text(PROGRAM)


def test_piece_begins_with_the_variables_of_that_moment(printed: Any) -> None:
    begin = decode_value(printed(1.0, 1.2)["PIECE"].strip().splitlines()[0].encode())
    assert begin[:4] == ["begin", "dora", "dora", "dora"]
    assert begin[4]["variables"]["turns"] > 50


def test_piece_without_a_change_expects_none(printed: Any) -> None:
    names = printed(1.0, 1.1)
    names["test_dora_changes_its_states_as_recorded"]()
    assert expected_of(names) == []


def test_piece_that_another_program_ran_is_printed_with_status_1(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(typer.Exit) as caught:
        machine("record", str(folder / "run"), from_s=2.4, until_s=4.0, trust=True)
    assert caught.value.exit_code == 1
    shown = capsys.readouterr()
    assert shown.out.startswith('"""dora in run')
    assert "This test fails: with" in shown.err


def test_program_without_the_state_of_the_beginning_is_named(printed: Any, folder: Path) -> None:
    piece = printed(1.0, 1.2)["PIECE"]
    other = folder / "other.lrp"
    other.write_text(STOP.read_text())
    with pytest.raises(ParameterError, match=r"The piece begins with what .*other\.lrp does not have"):
        replay_piece(piece, str(other))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"from_s": 2.0, "until_s": 1.0}, "The piece is from 2 s to 1 s"),
        ({"from_s": 2.0}, "The piece is from 2 s to inf s"),
        ({"from_s": 1e4, "until_s": 1e5}, "Nothing happens from 10000 s on"),
        ({"from_s": 1.0, "until_s": 2.0, "with_file": "mine.py"}, "'mine.py' is not a file with a program in LRP"),
        ({"from_s": 1.0, "until_s": 2.0, "name": "dara"}, "no machine 'dara'.*\\n.*did you mean 'dora'"),
    ],
)
def test_request_that_cannot_be_met_is_refused(folder: Path, options: dict[str, Any], message: str) -> None:
    with pytest.raises((ParameterError, UnknownNameError), match=message):
        machine("record", str(folder / "run"), trust=True, **options)
