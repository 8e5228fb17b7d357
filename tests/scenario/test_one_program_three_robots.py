"""The same program of three states runs on every robot: only the line that says which part moves is another one."""

from __future__ import annotations

from pathlib import Path

import pytest

from snr_sim.prelude.values import decode_value
from snr_sim.recording.reader import read_trace
from snr_sim.recording.records import Executed
from snr_sim.recording.trace import FILE_NAME
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import run_recorded

PROGRAM = """(def is_there [PROBE.read() is not None])
(machine walk
  (state waiting (onentry [robot.stop()]))
  (state go (onentry [
    READY
    PART.start(AHEAD)]))
  (state look (onentry [PART.stop()]))
  (state back (onentry [PART.start(BACK)]))
  (on [is_there()] waiting -> go)
  (ontime 3000 go -> look)
  (ontime 500 look -> back)
  (ontime 3000 back -> look2)
  (state look2 (onentry [robot.stop()])))
(spawn walk waiting)
"""
ROBOTS = {
    "dora": ("dora_room", "robot.motor_a", "robot.ultra", "pass", "20", "-20"),
    "lander": ("lander_vertical", "robot.throttle", "robot.altitude_m", "pass", "0.2", "0.1"),
    "urov": ("urov_gate", "robot.surge", "robot.x_m", "robot.armed.start(1)", "0.5", "-0.5"),
}


@pytest.mark.slow
@pytest.mark.parametrize("robot", ROBOTS)
def test_program_goes_looks_and_comes_back(robot: str, tmp_path: Path) -> None:
    scenario, part, probe, ready, ahead, back = ROBOTS[robot]
    text = PROGRAM
    for word, by in (("PART", part), ("PROBE", probe), ("READY", ready), ("AHEAD", ahead), ("BACK", back)):
        text = text.replace(word, by)
    (tmp_path / "walk.lrp").write_text(text)
    simulation = prepare(Request(scenario, 0, controller=str(tmp_path / "walk.lrp")))
    result = run_recorded(simulation, tmp_path / FILE_NAME)
    assert result.error == ""
    found = [
        decode_value(bytes(record.values))[0]["target"]
        for record in read_trace(tmp_path / FILE_NAME).records
        if isinstance(record, Executed) and record.name == "walk.transition"
    ]
    assert found == ["waiting", "go", "look", "back", "look2"]
