"""Output into a pipe that is closed before it is read to the end."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow


def test_closed_pipe_is_not_an_error() -> None:
    command = [sys.executable, "-m", "snr_sim", "list"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()  # before the first line comes
        assert process.stderr.read() == b""
    assert process.returncode == 0


def test_full_stdout_reports_error(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "snr_sim", "list"]
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(command, cwd=tmp_path, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr.startswith("The answer could not be written: No space left on device.")
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("both", [False, True])
def test_full_stdout_of_a_run_as_json_reports_error(tmp_path: Path, both: bool) -> None:
    command = [sys.executable, "-m", "snr_sim", "run", "lander_vertical", "--no-rrd", "--json"]
    with Path("/dev/full").open("w") as full:
        stderr = full if both else subprocess.PIPE
        done = subprocess.run(command, cwd=tmp_path, stdout=full, stderr=stderr, text=True, check=False)
    assert done.returncode == 1
    assert both or done.stderr.startswith("The answer could not be written: No space left on device.")
    assert "Traceback" not in (done.stderr or "")


def test_numpy_global_generator_is_named_if_only_student_imports_it(tmp_path: Path) -> None:
    (tmp_path / "dice.py").write_text(DICE)
    snr = [sys.executable, "-m", "snr_sim"]
    run = [*snr, "run", "lander_vertical", "--controller", "./dice.py", "--no-rrd", "--json"]
    done = subprocess.run(run, cwd=tmp_path, capture_output=True, text=True, check=False)
    folder = json.loads(done.stdout)["run_dir"]
    check = [*snr, "replay", folder, "--check"]
    checked = subprocess.run(check, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert "dice.py, line 10: numpy.random.rand()" in checked.stdout


def test_command_stored_under_other_name_is_reported_with_nearest(tmp_path: Path) -> None:
    (tmp_path / "dice.py").write_text(DICE)
    command = [sys.executable, "-m", "snr_sim", "run", "lander_vertical", "--controller", "./dice.py", "--no-rrd"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert "Page 'engin' is stored there, but no handler waits for it." in done.stderr
    assert "did you mean 'engine'?" in done.stderr
    assert "did you mean 'engin'?" not in done.stderr


DICE = """\
import numpy as np
from snr_sim import Endpoint, EndpointFactory, TaskType

class Dice(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.task_handlers = {(TaskType.process_data, "radar"): self.on_radar}

    def on_radar(self, task, task_id):
        np.random.rand()
        return self.store_data_task("engin", {"throttle": 0.5})

class DiceFactory(EndpointFactory):
    def get(self, parent):
        return Dice(self, parent, "dice")

def factories(robot):
    return [DiceFactory()]
"""
