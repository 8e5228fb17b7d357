"""Replays of the machines of a run: one of several nodes begins with the files of the start of the run."""

from __future__ import annotations

import json
from contextlib import suppress
from pathlib import Path

import pytest
import typer

from snr_sim import SimClock, SimRunner
from snr_sim.cli.machine import machine
from snr_sim.cli.replay import replay
from snr_sim.recording.records import TraceInfo
from snr_sim.recording.sources import keep_copies
from snr_sim.recording.trace import FILE_NAME, TraceWriter
from snr_sim.scenario import library
from snr_sim.scenario.program import program_header

# The first node is reloaded after an edit of its file; the machine of the second one has made its transition by then.
PROGRAM = """
from pathlib import Path

from snr_sim import Config, Endpoint, Loop, tasks
from snr_sim.behaviors import machine, machine_parts, on, state

LATE_S = 0.1


def is_late(m):
    return m.in_state_s >= LATE_S


WAIT = machine("wait", "waiting", [state("waiting", on(is_late, to="done")), state("done")])


class Pilot(Endpoint):
    pass


class Editor(Loop):
    max_tick_rate_hz = 5.0

    def loop(self):
        if self.get_time_s() == 0.2:
            here = Path(__file__)
            here.write_text(here.read_text().replace("LATE_S = 0.1", "LATE_S = 0.3"))
            self.schedule(tasks.reload_component("pilot"))


config = Config(factories={"a": [Editor.factory(), Pilot.factory(name="pilot")], "b": machine_parts(WAIT, "wait")})
"""


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A run of two nodes."""
    program, folder, clock = tmp_path / "robot.py", tmp_path / "run", SimClock()
    program.write_text(PROGRAM)
    folder.mkdir()
    with keep_copies(folder, [program], library.is_own):
        config = library.load_program(str(program)).config
        header = program_header(["a", "b"], config, program, clock)
        recorder = TraceWriter(folder / FILE_NAME, header, TraceInfo.now("", str(program)))
        try:
            SimRunner(config, clock=clock, recorder=recorder, until_s=0.5).run()
        finally:
            recorder.close()
    assert "LATE_S = 0.3" in program.read_text()
    return folder


def test_replay_of_two_nodes_after_a_reload_is_identical(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with suppress(SystemExit):
        replay(run, trust=True)
    assert capsys.readouterr().out.startswith("identical: ")


def test_why_finds_the_transition_at_its_recorded_time(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    machine("why", str(run), trust=True, as_json=True)
    (row,) = json.loads(capsys.readouterr().out)["rows"]
    assert (row["taken"], row["longest_s"]) == (1, 0.1)


def test_try_of_the_program_of_a_run_is_identical(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (run.parent / "robot.py").write_text(PROGRAM)
    with suppress(typer.Exit):
        machine("try", str(run.parent / "robot.py"), other=str(run), trust=True)
    assert "identical: every change of state as recorded" in capsys.readouterr().out
