"""A controller in LRP flies, is recorded with the run and replayed from there; mistakes are shown with their lines."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

from snr_sim.prelude.errors import ConfigError, SnrError
from snr_sim.scenario import library
from snr_sim.scenario.machine_controller import bridge_of
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import SimulationRun

LANDING = """; coasts until it is too fast, and burns until it is slow enough
(def allowed_mps [1.0 + max(0.0, robot.altitude_m.read()) ** 0.5])
(machine landing
  (event fast [-robot.velocity_mps.read() > allowed_mps()])
  (event slow [-robot.velocity_mps.read() < 0.7 * allowed_mps()])
  (state waiting)
  (state coasting (onentry [robot.throttle.stop()]))
  (state burning (onentry [robot.throttle.start(1.0)]))
  (on [robot.altitude_m.read() is not None] waiting -> coasting)
  (on fast coasting -> burning)
  (on slow burning -> coasting))
(spawn landing waiting)
"""


@pytest.fixture
def landing(tmp_path: Path) -> Path:
    (tmp_path / "landing.lrp").write_text(LANDING)
    return tmp_path / "landing.lrp"


def flight(path: Path, seed: int = 0) -> SimulationRun:
    simulation = prepare(Request("lander_vertical", seed=seed, controller=str(path)))
    plant = simulation.plant()
    return SimulationRun(simulation, plant, simulation.config(plant))


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(1, 8))])
def test_program_lands(landing: Path, seed: int) -> None:
    result = flight(landing, seed).run()
    assert (result.error, result.outcome) == ("", "landed")
    assert 1.85 < result.metrics["fuel_ratio"] < 1.95


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("-> burning)", "-> burnin)", "landing.lrp:10:24: There is no state 'burnin' here."),
        ("robot.throttle.stop", "robot.trottle.stop", "landing.lrp:7:29: The robot has no 'trottle'."),
        ("(spawn landing waiting)", "", "landing.lrp:1:1: warning"),
    ],
)
def test_mistake_is_shown_with_its_line(landing: Path, old: str, new: str, message: str) -> None:
    landing.write_text(LANDING.replace(old, new))
    if "warning" in message:
        assert flight(landing).run().outcome == "crashed"
        return
    with pytest.raises(ConfigError) as caught:
        flight(landing)
    shown = str(caught.value).splitlines()
    assert message in shown[0]
    line = int(shown[0].split(":")[1])
    assert shown[1].endswith(LANDING.replace(old, new).splitlines()[line - 1])
    assert "^" in shown[2]


def test_all_mistakes_are_shown(landing: Path) -> None:
    landing.write_text(LANDING.replace("-> burning)", "-> burnin)").replace("-> coasting)", "-> coastin)"))
    with pytest.raises(ConfigError) as caught:
        flight(landing)
    assert str(caught.value).count("There is no state") == 3


def test_file_that_is_not_text_is_refused(landing: Path) -> None:
    landing.write_bytes(b"(machine m\n \xff)")
    with pytest.raises(ConfigError, match=r"landing\.lrp, line 2: byte 0xff is not text"):
        flight(landing)


def test_robot_without_parts_is_named(landing: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    without = shutil.ignore_patterns("bridge.py", "__pycache__")
    shutil.copytree(library.find("robots", "lander").path, tmp_path / "robots" / "lander", ignore=without)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SnrError, match="This robot has no parts that an LRP program could name"):
        prepare(Request("lander_vertical", controller=str(landing)))
    monkeypatch.undo()
    assert "throttle" in library.bridge_of_robot("lander").parts, "the robot is another one now"


def test_bridge_that_fails_is_not_taken_for_a_missing_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "robot_without", ModuleType("robot_without"))
    with pytest.raises(ConfigError, match="no parts"):
        bridge_of("robot_without")


@pytest.mark.slow
def test_replay_executes_the_program_as_it_was_recorded(landing: Path) -> None:
    def snr(*words: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "snr_sim", *words]
        return subprocess.run(command, cwd=landing.parent, capture_output=True, text=True, check=False)

    assert snr("run", "lander_vertical", "--controller", "./landing.lrp", "--no-rrd", "--out", "run").returncode == 0
    landing.write_text(LANDING.replace("0.7", "0.5"))
    (run,) = (landing.parent / "run").iterdir()
    replayed = snr("replay", str(run), "--check")
    assert replayed.returncode == 0, replayed.stdout + replayed.stderr
    assert "controller/landing.lrp" in replayed.stderr
    changed = snr("replay", str(run), "--check", "--with", "./landing.lrp")
    assert changed.returncode == 1, changed.stdout + changed.stderr
