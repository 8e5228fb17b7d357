"""Without POSIX-only features all verbs for practice work; official grading reports what it requires."""

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow
ROOT = Path(__file__).parents[2]
SNR = [sys.executable, str(Path(__file__).with_name("as_on_windows.py"))]
WAITS_S = 300.0

HOLDS = """
import sys
from pathlib import Path
from as_on_windows import block
block()
import msgspec
from snr_sim.grading import Student
from snr_sim.grading.remote.piped_process import PipedProcess
from snr_sim.grading.remote.protocol import Call
from snr_sim.grading.lab.verdicts import SubmissionError
child = Student(Path(sys.argv[1])).child("mine.py")
assert type(child) is PipedProcess
call = lambda function, cpu_s=5.0: child.ask(Call("mine.py", function, msgspec.Raw(b"[]")), cpu_s)
"""
MINE = """
def add():
    print("added")
    return 1 + 1

def turn():
    while True:
        pass

def stick():
    while True:
        try:
            turn()
        except BaseException:
            pass

def silence():
    import os
    os.close(2)

def leave():
    import os
    os._exit(3)

def shout():
    while True:
        print("x" * 1000)
"""


def snr(*words: object, cwd: Path) -> "subprocess.CompletedProcess[str]":
    done = subprocess.run(
        [*SNR, *map(str, words)], cwd=cwd, capture_output=True, text=True, stdin=subprocess.DEVNULL, timeout=WAITS_S
    )
    assert "Traceback" not in done.stderr, done.stderr
    return done


def held(tmp_path: Path, what: str) -> "subprocess.CompletedProcess[str]":
    """A process of a student's with MINE, as `snr check` starts it on Windows."""
    (tmp_path / "mine.py").write_text(MINE)
    return subprocess.run(
        [sys.executable, "-c", HOLDS + what, str(tmp_path)],
        env={"PYTHONPATH": f"{Path(__file__).parent}:{ROOT}"},
        capture_output=True,
        text=True,
        timeout=WAITS_S,
    )


def test_a_run_is_recorded_replayed_compared_and_drawn(tmp_path: Path) -> None:
    first = json.loads(snr("run", "lander_vertical", "--json", cwd=tmp_path).stdout)
    run = first["run_dir"]
    assert first["success"]
    assert b"\r" not in (tmp_path / run / "trace.jsonl").read_bytes()
    assert "identical" in snr("replay", run, "--check", cwd=tmp_path).stdout
    again = json.loads(snr("resim", run, "--json", cwd=tmp_path).stdout)
    assert again["identical"]
    assert "same, byte for byte" in snr("compare", run, again["run_dir"], cwd=tmp_path).stdout
    assert snr("trace", run, "--kind", "end", cwd=tmp_path).stdout.count("\n") == 1
    assert snr("view", run, "--png", "landing.png", cwd=tmp_path).stdout == "landing.png\n"


def test_a_controller_that_was_edited_since_replays_from_its_copy(tmp_path: Path) -> None:
    mine = tmp_path / "mine.py"
    shutil.copy(ROOT / "robots" / "lander" / "controllers" / "coast.py", mine)
    run = json.loads(snr("run", "lander_vertical", "--controller", "./mine.py", "--json", cwd=tmp_path).stdout)
    mine.write_text("raise RuntimeError('today')")
    assert "identical" in snr("replay", run["run_dir"], cwd=tmp_path).stdout


@pytest.mark.parametrize(
    ("words", "status"),
    [
        (["list"], 0),
        (["doctor"], 0),
        (["new", "robot", "mine", "--from", "lander"], 0),
        (["io", "urov_depth_hold", "--once"], 0),
        (["console", "9", "list", "--wait", "0.1"], 2),
        (["bench", "--help"], 0),
    ],
)
def test_verbs_without_a_run_work(words: list[str], status: int, tmp_path: Path) -> None:
    assert snr(*words, cwd=tmp_path).returncode == status


def test_check_gives_reference_solution_all_points(tmp_path: Path) -> None:
    snr("new", "lab", "hello_thruster", cwd=tmp_path)
    reference = ROOT / "tests" / "assignments" / "hello_thruster" / "reference"
    shutil.copytree(reference, tmp_path / "hello_thruster", dirs_exist_ok=True)
    done = snr("check", "hello_thruster", "hello_thruster", cwd=tmp_path)
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize("more", [[], ["--isolation", "none"], ["--gradescope", "autograder"]])
def test_grade_reports_required_platform(more: list[str], tmp_path: Path) -> None:
    done = snr("grade", "hello_thruster", "handed_in", "--out", "results", *more, cwd=tmp_path)
    assert done.returncode == 2
    assert "snr grade does not run on Windows" in done.stderr
    assert "snr check hello_thruster FOLDER" in done.stderr
    assert not list(tmp_path.iterdir())


def test_student_process_replies_and_prints(tmp_path: Path) -> None:
    done = held(tmp_path, "print(bytes(call('add').value), child.printed.strip()); child.close(); child.close()")
    assert done.stdout == "b'2' added\n", done.stderr


def test_output_before_an_answer_is_there_with_it(tmp_path: Path) -> None:
    asks = "for i in range(3):\n    call('add')\n    print(child.printed.count('added'))\nchild.close()"
    assert held(tmp_path, asks).stdout == "1\n2\n3\n"


def test_program_that_closes_its_output_is_answered(tmp_path: Path) -> None:
    done = held(tmp_path, "call('silence')\nprint(bytes(call('add').value)); child.close()")
    assert done.stdout == "b'2'\n", done.stderr


def test_endless_loop_is_stopped_with_its_line(tmp_path: Path) -> None:
    done = held(tmp_path, "print(call('turn', 0.2).error.text); print(bytes(call('add').value)); child.close()")
    assert re.match(r"mine.py, line [78]: ", done.stdout), done.stderr
    assert "takes too long" in done.stdout
    assert done.stdout.endswith("b'2'\n")  # and the process continues


@pytest.mark.parametrize(
    ("function", "words"),
    [("stick", "used up its CPU time"), ("leave", "exit status 3"), ("shout", "printed more than a megabyte")],
)
def test_error_of_student_program_is_reported(function: str, words: str, tmp_path: Path) -> None:
    done = held(
        tmp_path, f"try:\n    call('{function}', 1.0)\nexcept SubmissionError as wrong:\n    print(wrong.message)\n"
    )
    assert words in done.stdout, done.stderr
