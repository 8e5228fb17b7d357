"""`snr processes`: RoverProcesses of a file or a folder, simulated and replayed, or each in a process."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

PING = """
from snr_sim.processes import RoverProcess

class {name}(RoverProcess):
    def setup(self, args):
        self.subscribe("{input}")
        self.count = 0

    def on_{input}(self, data):
        self.log(data)
        if data >= 3:
            self.terminate_state()
        self.publish("{output}", data + 1)

    def loop(self):
        self.publish("{output}", 0)
        return 1.0
"""
CASES = {"name": "Ping", "input": "pong", "output": "ping"}, {"name": "Pong", "input": "ping", "output": "pong"}


@pytest.fixture
def rover(here: Path) -> Path:
    """A file with both processes, and a folder with a file for each."""
    texts = {case["name"]: PING.format(**case) for case in CASES}
    (here / "rover.py").write_text("".join(texts.values()))
    (here / "modules").mkdir()
    for name, text in texts.items():
        (here / "modules" / f"{name}.py").write_text(text)
    return here


@pytest.mark.parametrize("words", [["rover.py"], ["rover.py", "Ping", "Pong"], ["modules", "Ping", "Pong"]])
def test_simulation_is_recorded_and_its_replay_is_identical(snr: Any, rover: Path, words: list[str]) -> None:
    answer = snr("processes", *words, "--sim", "5", "--json")
    assert (answer.status, answer.json["processes"], answer.json["error"]) == (0, ["Ping", "Pong"], "")
    run = Path(answer.json["run_dir"])
    assert [line.split()[-1] for line in (run / "Ping" / "log.txt").read_text().splitlines()][:2] == ["0", "2"]
    replayed = snr("replay", run, "--json")
    assert (replayed.status, replayed.json["identical"]) == (0, True), replayed.err
    assert [node["node"] for node in replayed.json["nodes"]] == ["state_manager_node", "Ping_node", "Pong_node"]


def test_failure_is_status_1_and_names_the_line(snr: Any, rover: Path) -> None:
    (rover / "wrong.py").write_text(PING.format(**CASES[0]).replace("return 1.0", "return 1 / self.count"))
    answer = snr("processes", "wrong.py", "--sim", "5")
    assert answer.status == 1
    assert "wrong.py, line 17: return 1 / self.count" in answer.err
    assert "ZeroDivisionError" in answer.err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["rover.py", "Pinng"], "did you mean 'Ping'?"),
        (["rovre.py"], "There is no file rovre.py."),
        (["modules", "Drive"], "There is no module Drive in modules."),
        (["modules"], "modules is a folder: which of its modules?"),
        (["notes.json"], "notes.json is not a Python file."),
        (["empty.py"], "empty.py has no class of a RoverProcess."),
        (["rover.py", "--health-at", "192.0.2.7:9131"], "health is answered on this computer only."),
        (["rover.py", "--sim", "1", "--health-at", "9131"], "--health-at is for processes"),
        (["rover.py", "--sim", "nan"], "--sim is nan."),
    ],
)
def test_invalid_request_is_status_2_and_leaves_no_files(snr: Any, rover: Path, words: list[str], message: str) -> None:
    (rover / "notes.json").write_text("{}")
    (rover / "empty.py").write_text("from snr_sim.processes import RoverProcess\n")
    answer = snr("processes", *words)
    assert (answer.status, message in answer.err) == (2, True), answer.err
    assert not (rover / "runs").exists()


@pytest.mark.slow
def test_processes_run_until_one_ends_all(snr: Any, rover: Path) -> None:
    answer = snr("processes", "rover.py", "--json")
    assert (answer.status, answer.json["error"]) == (0, ""), answer.err
    logs = Path(answer.json["run_dir"]).glob("*/log.txt")
    assert {path.parent.name for path in logs} == {"Ping", "Pong"}


@pytest.mark.slow
def test_cleanup_that_raises_as_processes_end_is_status_1_and_named(snr: Any, here: Path) -> None:
    (here / "rover.py").write_text(
        "from snr_sim.processes import RoverProcess\n\nclass Arm(RoverProcess):\n"
        "    def loop(self):\n        self.terminate_state()\n        return 1.0\n\n"
        "    def cleanup(self):\n        raise ValueError('stuck')\n"
    )
    answer = snr("processes", "rover.py", "--json")
    assert answer.status == 1
    assert "Arm failed: rover.py, line 9: raise ValueError('stuck')" in answer.json["error"]


def test_sleep_in_a_loop_is_named_by_a_checked_replay(snr: Any, rover: Path) -> None:
    text = PING.format(**CASES[0]).replace("return 1.0", "time.sleep(0.0)\n        return 1.0")
    (rover / "sleepy.py").write_text(f"import time\n{text}")
    run = snr("processes", "sleepy.py", "--sim", "2", "--json").json["run_dir"]
    (call,) = snr("replay", run, "--check", "--json").json["outside_calls"]
    assert "time.sleep()" in str(call)


def test_run_of_a_runner_with_names_and_arguments_replays_by_that_runner(snr: Any, rover: Path) -> None:
    text = "".join(PING.format(**case) for case in CASES)
    (rover / "named.py").write_text(
        f"{text}\nfrom snr_sim.processes import ProcessRunner\n"
        "runner = ProcessRunner([Ping.with_args(name='P1', gain=2), Pong.with_args(name='P2')])\n"
    )
    answer = snr("processes", "named.py", "--sim", "5", "--json").json
    assert answer["processes"] == ["P1", "P2"]
    replayed = snr("replay", answer["run_dir"], "--json")
    assert (replayed.status, replayed.json["identical"]) == (0, True), replayed.err
