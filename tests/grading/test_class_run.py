"""`snr grade` over a class: every submission has a result, whatever happens to it or to the grader."""

import csv
import json
import os
import re
import select
import shutil
import signal
import stat
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from snr_sim.grading.batch.class_folder import ClassFolder, ClassSettings
from snr_sim.grading.batch.class_run import ClassRun
from snr_sim.grading.batch.stop_signals import StopSignals
from snr_sim.grading.batch.submission_import import remove
from snr_sim.grading.batch.submissions import name_submissions
from snr_sim.grading.batch.workers import LocalWorkers
from snr_sim.grading.lab.lab import load_lab
from snr_sim.grading.reports.results import Graded
from snr_sim.prelude.errors import SnrError

pytestmark = pytest.mark.slow

HandedIn = Callable[..., list[Path]]
GradeBy = Callable[..., dict[str, Graded]]
SECRET = "correct horse battery staple"


def command(lab: Path, given: list[Path], out: Path, *words: object) -> list[str]:
    secret = out.parent / "the_secret"
    secret.write_text(SECRET)
    start = [sys.executable, "-m", "snr_sim", "grade", str(lab), *map(str, given), "--out", str(out)]
    return [*start, "--isolation", "none", "--secret", str(secret), *map(str, words)]


def grade(lab: Path, given: list[Path], out: Path, *words: object) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONFAULTHANDLER": "1"}
    done = subprocess.run(
        command(lab, given, out, *words), capture_output=True, text=True, timeout=300, env=environment
    )
    assert "Traceback" not in done.stderr
    assert "Fatal" not in done.stderr, done.stderr
    return done


def wait_until(is_so: Callable[[], object], process: subprocess.Popen[Any]) -> None:
    """Wait for something that the process does."""
    give_up_s = time.monotonic() + 240
    while not is_so():
        assert process.poll() is None
        assert time.monotonic() < give_up_s
        time.sleep(0.002)


def table(out: Path) -> list[dict[str, str]]:
    with (out / "class.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def files_under(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def test_every_submission_has_a_result_and_grader_errors_no_points(
    double_lab: Path, handed_in: HandedIn, tmp_path: Path
) -> None:
    programs = ["right", "visible_only", "raises", "finds_a_fault", "quits", "def double(:", "", "talks_nonsense"]
    given = handed_in(**{f"s{i}": program for i, program in enumerate(programs)})
    done = grade(double_lab, given, tmp_path / "out", "--json", "--jobs", 2)
    assert done.returncode == 1
    answer = json.loads(done.stdout)
    assert (answer["grader_errors"], answer["rejected"], answer["unjudged"]) == (["s3"], ["s6"], ["s7"])
    rows = table(tmp_path / "out")
    assert [(row["submission"], row["points"], row["status"]) for row in rows] == [
        ("s0", "100", "graded"), ("s1", "70", "graded"), ("s2", "0", "graded"), ("s3", "", "grader_error"),
        ("s4", "0", "graded"), ("s5", "0", "graded"), ("s6", "0", "rejected"),
        ("s7", "40", "graded"),
    ]  # fmt: skip
    assert "a mistake in the lab" in rows[3]["error"]
    assert "a mistake that nonsense brings to light" in rows[7]["error"]
    for row in rows:
        folder = tmp_path / "out" / "students" / row["submission"]
        assert {"report.md", "results.json", "junit.xml", "check50.json"} <= {path.name for path in folder.iterdir()}
    assert "a mistake in the lab" not in (tmp_path / "out/students/s3/report.md").read_text()
    assert (tmp_path / "out" / "distribution.png").is_file()
    with (tmp_path / "out" / "leaderboard.csv").open(newline="") as file:
        assert [row["submission"] for row in csv.DictReader(file)] == ["s0", "s1"]


def test_only_runs_of_failed_visible_cases_are_kept(landing_lab: Path, tmp_path: Path) -> None:
    in_flight = Path(__file__).parent / "attacks" / "in_flight"
    given = tmp_path / "submissions" / "eve"
    given.mkdir(parents=True)
    shutil.copy(in_flight / "falling.py", given)
    shutil.copy(in_flight / "only_falls.py", given / "pilot.py")
    assert grade(landing_lab, [given], tmp_path / "out").returncode == 0
    student = tmp_path / "out" / "students" / "eve"
    assert [str(path.relative_to(student)) for path in student.rglob("trace.jsonl")] == [
        "runs/lands-1/run-1/trace.jsonl"
    ]
    (replay_command,) = re.findall(r"`(snr replay [^`]*) FILE`", (student / "report.md").read_text())
    replay = [sys.executable, "-m", "snr_sim", *replay_command.split()[1:], str(given / "pilot.py")]
    done = subprocess.run(replay, cwd=student, capture_output=True, text=True)
    assert (done.returncode, done.stdout[:9]) == (0, "identical"), done.stderr


def test_results_are_byte_identical_for_any_number_of_jobs(
    double_lab: Path, handed_in: HandedIn, tmp_path: Path
) -> None:
    given = handed_in(ada="right", bob="visible_only", eve="raises")
    for name, jobs in (("one", 1), ("more", 3)):
        assert grade(double_lab, given, tmp_path / name, "--jobs", jobs).returncode == 0
    one, more = (files_under(tmp_path / name) for name in ("one", "more"))
    assert one == more


def test_killed_run_resumes_without_regrading(double_lab: Path, handed_in: HandedIn, tmp_path: Path) -> None:
    given = handed_in(**{f"s{i}": "right" if i % 3 else "visible_only" for i in range(7)})
    out = tmp_path / "out"
    kept: dict[str, int] = {}
    for count in (1, 3, 5):  # how many results there are when it is killed
        words = ["--jobs", "2", *(["--resume"] if out.exists() else [])]
        process = subprocess.Popen(command(double_lab, given, out, *words), stderr=subprocess.PIPE)
        wait_until(lambda count=count: len(list(out.glob("results/*.json"))) >= count, process)
        os.kill(process.pid, signal.SIGKILL)
        process.communicate()  # its workers hold the pipe: it ends when they have
        assert not (out / "class.csv").exists()
        now = {path.name: path.stat().st_mtime_ns for path in out.glob("results/*.json")}
        assert kept.items() <= now.items(), "what was done is not done again"
        kept = now
    place = Path((out / ".lock").read_text())
    assert place.is_dir()
    assert grade(double_lab, given, out, "--resume").returncode == 0
    assert not place.exists()
    assert grade(double_lab, given, tmp_path / "whole").returncode == 0
    left, whole = files_under(out), files_under(tmp_path / "whole")
    assert left == whole


def test_interrupted_run_prints_resume_hint_and_removes_private_files(
    double_lab: Path, handed_in: HandedIn, tmp_path: Path
) -> None:
    out, private = tmp_path / "out", tmp_path / "private"
    private.mkdir()
    environment = {**os.environ, "TMPDIR": str(private)}
    words = command(double_lab, handed_in(**{f"s{i}": "right" for i in range(9)}), out)
    process = subprocess.Popen(words, stderr=subprocess.PIPE, text=True, env=environment)
    wait_until(lambda: list(out.glob("results/*.json")), process)
    process.send_signal(signal.SIGTERM)
    stderr = process.communicate()[1]
    assert process.returncode == 128 + signal.SIGTERM
    assert "continue with --resume" in stderr
    assert "Traceback" not in stderr
    assert list(private.iterdir()) == []


@pytest.mark.parametrize("raced", ["tempfile.mkdtemp", "remove"])
def test_signal_during_private_folder_setup_or_removal_leaves_nothing(
    double_lab: Path, handed_in: HandedIn, tmp_path: Path, raced: str
) -> None:
    private = tmp_path / "private"
    private.mkdir()
    words = command(double_lab, handed_in(ada="right"), tmp_path / "out")[3:]
    program = (
        "import signal, sys\n"
        "from unittest.mock import patch\n"
        "from snr_sim.cli.entry import main\n"
        "from snr_sim.grading.batch import class_folder\n"
        f"raced = class_folder.{raced}\n"
        "def raced_by_a_signal(*args, **named):\n"
        "    made = raced(*args, **named) if raced.__name__ == 'mkdtemp' else None\n"
        "    signal.raise_signal(signal.SIGTERM)\n"
        "    return made or raced(*args, **named)\n"
        f"with patch('snr_sim.grading.batch.class_folder.{raced}', raced_by_a_signal):\n"
        "    main()\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, *words],
        capture_output=True,
        text=True,
        env={**os.environ, "TMPDIR": str(private)},
    )
    assert done.returncode == 128 + signal.SIGTERM, done.stderr
    assert "Traceback" not in done.stderr
    assert list(private.iterdir()) == []


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux ends a program with the worker that started it")
def test_stopped_scenario_run_leaves_no_recording_and_no_process(landing_lab: Path, tmp_path: Path) -> None:
    given, private = tmp_path / "submissions" / "eve", tmp_path / "private"
    given.mkdir(parents=True)
    private.mkdir()
    shutil.copy(Path(__file__).parent / "attacks" / "in_flight" / "falling.py", given)
    first, number = tmp_path / "first", tmp_path / "number"
    (given / "pilot.py").write_text(  # the hidden case is recorded in a temporary folder of the worker
        "import os\n"
        "from pathlib import Path\n"
        "from falling import falling\n"
        f"first, number = Path({str(first)!r}), Path({str(number)!r})\n"
        "is_hidden = first.exists()\n"
        "first.touch()\n"
        "def act(pilot):\n"
        "    if is_hidden:\n"
        "        number.with_suffix('.part').write_text(str(os.getpid()))\n"
        "        number.with_suffix('.part').rename(number)\n"
        "        while True:\n"
        "            pass\n"
        "def factories(robot):\n"
        "    return falling(act)\n"
    )
    environment = {**os.environ, "TMPDIR": str(private)}
    process = subprocess.Popen(command(landing_lab, [given], tmp_path / "out"), env=environment)
    wait_until(number.exists, process)
    program = os.pidfd_open(int(number.read_text()))
    process.send_signal(signal.SIGTERM)
    assert process.wait() == 128 + signal.SIGTERM
    assert list(private.iterdir()) == []
    is_ended = bool(select.select([program], [], [], 2.0)[0])  # its own limit would end it after 5 s
    os.close(program)
    assert is_ended


def test_resume_grades_changed_and_new_submissions(double_lab: Path, handed_in: HandedIn, tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert grade(double_lab, handed_in(ada="visible_only", bob="right"), out).returncode == 0
    before = (out / "results" / "bob.json").stat().st_mtime_ns
    given = handed_in(ada="right", bob="right", eve="right")
    assert grade(double_lab, given, out, "--resume").returncode == 0
    assert [(row["submission"], row["points"]) for row in table(out)] == [
        ("ada", "100"),
        ("bob", "100"),
        ("eve", "100"),
    ]
    assert (out / "results" / "bob.json").stat().st_mtime_ns == before


def test_resume_regrades_grader_errors(double_lab: Path, handed_in: HandedIn, tmp_path: Path) -> None:
    out = tmp_path / "out"
    given = handed_in(ada="finds_a_fault")
    assert grade(double_lab, given, out).returncode == 1
    given = handed_in(ada="right")
    assert grade(double_lab, given, out, "--resume").returncode == 0


def test_resume_rejects_another_secret_or_lab_version(double_lab: Path, handed_in: HandedIn, tmp_path: Path) -> None:
    out = tmp_path / "out"
    given = handed_in(ada="right")
    assert grade(double_lab, given, out).returncode == 0
    before = files_under(out)
    again = grade(double_lab, given, out)
    assert (again.returncode, "continue with --resume" in again.stderr) == (2, True)
    other = tmp_path / "other_secret"
    other.write_text("x" * 20)
    refused = subprocess.run(
        [*command(double_lab, given, out, "--resume"), "--secret", str(other)], capture_output=True, text=True
    )
    assert refused.returncode == 2
    assert "another secret" in refused.stderr
    with (double_lab / "checks.py").open("a") as file:
        file.write("\n")
    changed = grade(double_lab, given, out, "--resume")
    assert (changed.returncode, "another version of the lab" in changed.stderr) == (2, True)
    assert files_under(out) == before


def test_generated_secret_is_readable_by_its_owner_only(double_lab: Path, handed_in: HandedIn, tmp_path: Path) -> None:
    given = handed_in(ada="right")
    words = command(double_lab, given, tmp_path / "out")
    i = words.index("--secret")
    done = subprocess.run([*words[:i], *words[i + 2 :]], capture_output=True, text=True)
    assert done.returncode == 0
    secret = tmp_path / "out" / "secret"
    assert stat.S_IMODE(secret.stat().st_mode) == 0o600
    assert stat.S_IMODE(secret.parent.stat().st_mode) == 0o700
    assert str(secret) in done.stderr
    assert secret.read_text().strip() not in done.stderr + done.stdout + (tmp_path / "out/class.json").read_text()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--isolation", "perhaps"], "not 'perhaps'"),
        (["--jobs", "-1"], "--jobs must be at least 0, not -1"),
        (["nobody.zip"], "There is no submission"),
    ],
)
def test_invalid_request_exits_with_2_and_writes_nothing(
    double_lab: Path, handed_in: HandedIn, tmp_path: Path, words: list[str], message: str
) -> None:
    done = grade(double_lab, handed_in(ada="right"), tmp_path / "out", *words)
    assert done.returncode == 2
    assert message in done.stderr
    assert not (tmp_path / "out").exists()


def test_output_folder_inside_a_submission_is_rejected(double_lab: Path, handed_in: HandedIn, tmp_path: Path) -> None:
    (given,) = handed_in(ada="right")
    done = grade(double_lab, [given], given / "results")
    assert done.returncode == 2
    assert "is in the submission" in done.stderr
    assert not (given / "results").exists()


def test_unreadable_lab_is_reported_before_grading(double_lab: Path, handed_in: HandedIn, tmp_path: Path) -> None:
    (double_lab / "checks.py").write_text("lab = 1 / 0\n")
    done = grade(double_lab, handed_in(ada="right"), tmp_path / "out")
    assert done.returncode == 2
    assert "ZeroDivisionError" in done.stderr
    assert not (tmp_path / "out").exists()


# Inside


class Class:
    """A class graded in this process, with a worker of the test's choice."""

    def __init__(self, lab: Path, given: list[Path], out: Path) -> None:
        self.folder = ClassFolder(out, is_resumed=False)
        self.results: list[Graded] = []
        submissions = name_submissions(given)
        settings: Any = dict.fromkeys(("lab", "lab_digest", "version", "secret_digest", "isolation"), "")
        self.folder.begin(ClassSettings(**settings), submissions)
        checks = load_lab(lab / "checks.py")
        self.run = ClassRun(checks, self.folder, submissions, b"x" * 16, "none", self.results.append)

    def grade(self, workers: LocalWorkers, **interruptible: Any) -> None:
        with workers:
            self.run.grade(workers, **interruptible)

    def __enter__(self) -> "Class":
        return self

    def __exit__(self, *_: object) -> None:
        self.folder.close()


@pytest.fixture
def grade_by(double_lab: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> GradeBy:
    """Return a function that grades a class by workers that run `serve` of a program; it returns all by name."""
    monkeypatch.syspath_prepend(tmp_path)

    def grade_by(program: str, given: list[Path], jobs: int = 1, **limits: float) -> dict[str, Graded]:
        (tmp_path / "workers_program.py").write_text(program)
        with Class(double_lab, given, tmp_path / "out") as group:
            group.grade(LocalWorkers(jobs, target="workers_program:serve", **limits))
        found = {graded.submission: graded for graded in group.results}
        assert len(found) == len(group.results)
        return found

    return grade_by


def test_dead_worker_is_a_grader_error_and_others_are_graded(grade_by: GradeBy, handed_in: HandedIn) -> None:
    program = (
        "import os\n"
        "from snr_sim.grading.batch import worker\n"
        "grade = worker.grade\n"
        "def fails(job, fork_server):\n"
        "    return os.kill(os.getpid(), 9) if job.name == 'bob' else grade(job, fork_server)\n"
        "def serve(line):\n"
        "    worker.grade = fails\n"
        "    return worker.serve(line)\n"
    )
    found = grade_by(program, handed_in(ada="right", bob="right", eve="right"))
    assert {name: graded.status for name, graded in found.items()} == {
        "ada": "graded",
        "bob": "grader_error",
        "eve": "graded",
    }
    assert "ended by SIGKILL" in found["bob"].error


def test_worker_blocked_by_one_submission_is_ended_and_others_are_graded(
    grade_by: GradeBy, handed_in: HandedIn, tmp_path: Path
) -> None:
    program = (
        "from pathlib import Path\n"
        "from snr_sim.grading.batch import worker\n"
        "grade_submission = worker.grade_submission\n"
        "def hold(lab, folder, *rest, name, **named):\n"
        f"    with Path({str(tmp_path)!r}, 'tries').open('a') as file:\n"
        "        file.write(name + ' ')\n"
        "    if name == 'eve':\n"
        "        return bytearray(worker.MEMORY_BYTES)\n"
        "    while name == 'bob':\n"
        "        pass\n"
        "    return grade_submission(lab, folder, *rest, name=name, **named)\n"
        "def serve(line):\n"
        "    worker.grade_submission, worker.JOB_CPU_S = hold, 1\n"
        "    return worker.serve(line)\n"
    )
    found = grade_by(program, handed_in(ada="right", bob="right", eve="right", fay="right"), limit_s=60.0)
    assert [found[name].status for name in ("ada", "bob", "eve", "fay")] == [
        "graded",
        "grader_error",
        "grader_error",
        "graded",
    ]
    assert "The grader worked on it for more than" in found["bob"].error
    assert "MemoryError" in found["eve"].error
    assert (tmp_path / "tries").read_text() == "ada bob eve fay "


def test_worker_over_wall_time_is_a_grader_error(grade_by: GradeBy, handed_in: HandedIn) -> None:
    program = "import time\ndef serve(line):\n    line.recv_bytes()\n    time.sleep(1e6)\n"
    found = grade_by(program, handed_in(ada="right"), limit_s=0.0)
    assert [(graded.status, "took too long" in graded.error) for graded in found.values()] == [("grader_error", True)]


@pytest.mark.skipif(not hasattr(os, "sched_getaffinity"), reason="this system does not tell on which cores one runs")
def test_workers_are_pinned_when_each_core_has_one(grade_by: GradeBy, handed_in: HandedIn, tmp_path: Path) -> None:
    program = (
        "import os\n"
        "from pathlib import Path\n"
        "from snr_sim.grading.batch import worker\n"
        "def serve(line):\n"
        f"    file = Path({str(tmp_path)!r}, f'on_{{os.getpid()}}')\n"
        "    grade = worker.grade\n"
        "    worker.grade = lambda *job: file.write_text(str(*os.sched_getaffinity(0))) and grade(*job)\n"
        "    return worker.serve(line)\n"
    )
    cores = sorted(os.sched_getaffinity(0))
    given = handed_in(**{f"s{i}": "right" for i in range(2 * len(cores))})
    assert {graded.status for graded in grade_by(program, given, len(cores)).values()} == {"graded"}
    assert sorted(int(file.read_text()) for file in tmp_path.glob("on_*")) == cores
    assert sorted(os.sched_getaffinity(0)) == cores


@pytest.mark.unmeasured
def test_full_disk_raises_and_ends_all_workers(
    double_lab: Path, handed_in: HandedIn, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    with Class(double_lab, handed_in(ada="right", bob="right"), tmp_path / "out") as group:
        monkeypatch.setattr("snr_sim.grading.batch.class_folder.write_atomic", full)
        with pytest.raises(OSError, match="No space left"):
            group.grade(LocalWorkers(2))
    assert group.results == []
    assert list((tmp_path / "out" / "results").iterdir()) == []


def test_interrupted_grading_keeps_finished_results_and_ends_workers(
    double_lab: Path, handed_in: HandedIn, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with Class(double_lab, handed_in(ada="right", bob="right"), tmp_path / "out") as group:
        keep = group.run.keep

        def interrupted_keep(*result: Any) -> None:
            signal.raise_signal(signal.SIGINT)
            keep(*result)

        monkeypatch.setattr(group.run, "keep", interrupted_keep)
        with pytest.raises(KeyboardInterrupt), StopSignals() as signals:
            group.grade(LocalWorkers(1), interruptible=signals.interruptible)
        with pytest.raises(ChildProcessError):
            os.waitpid(-1, os.WNOHANG)
        assert [thread.name for thread in threading.enumerate() if thread.name.startswith("ThreadPool")] == []
    assert [graded.submission for graded in group.results] == ["ada"]
    assert not group.folder.private_folder.exists()


def test_private_folder_with_late_writes_is_removed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = ClassFolder(tmp_path / "out", is_resumed=False)
    calls: list[Path] = []

    def remove_before_the_last_write(place: Path) -> None:
        calls.append(place)
        if len(calls) == 1:
            (place / "last_words").touch()
        else:
            remove(place)

    monkeypatch.setattr("snr_sim.grading.batch.class_folder.remove", remove_before_the_last_write)
    folder.close()
    assert not folder.private_folder.exists()


def test_class_folder_in_use_raises(tmp_path: Path) -> None:
    first = ClassFolder(tmp_path / "out", is_resumed=False)
    with pytest.raises(SnrError, match="Another snr grade uses"):
        ClassFolder(tmp_path / "out", is_resumed=True)
    first.close()
    ClassFolder(tmp_path / "out", is_resumed=True).close()


def test_folder_with_other_files_raises_and_is_unchanged(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("x")
    with pytest.raises(SnrError, match="contains files that are not results"):
        ClassFolder(tmp_path, is_resumed=True)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


def test_invalid_manifest_raises_each_time(tmp_path: Path) -> None:
    (tmp_path / "class.json").write_text("{")
    for _ in range(2):
        with pytest.raises(SnrError, match=r"class\.json cannot be read"):
            ClassFolder(tmp_path, is_resumed=True)


def test_run_killed_before_the_first_submission_resumes(tmp_path: Path) -> None:
    settings = ClassSettings("01_double", "a", "1", "b", "none")
    for left in (".class.json.part", ".secret.part", "results"):
        place = tmp_path / left.strip(".")
        place.mkdir()
        folder = ClassFolder(place, is_resumed=False)
        folder.secret(None)
        (place / left).write_text("")
        if left == "results":  # a file in a folder's place ends it where it would be killed
            with pytest.raises(FileExistsError):
                folder.begin(settings, [])
            (place / left).unlink()
        folder.close()
        folder = ClassFolder(place, is_resumed=True)
        folder.begin(settings, [])
        folder.close()
        assert not list(place.glob(".*.part"))


def test_short_secret_raises(tmp_path: Path) -> None:
    (tmp_path / "short").write_text("12345\n")
    folder = ClassFolder(tmp_path / "out", is_resumed=False)
    with pytest.raises(SnrError, match="has 5 bytes"):
        folder.secret(tmp_path / "short")
    folder.close()


def test_modules_shared_by_threads_use_prebuilt_decoders() -> None:
    """msgspec 0.22 crashes when two threads decode a Struct for the first time; a Decoder made at import does not."""
    import snr_sim.grading

    folder = Path(snr_sim.grading.__file__).parent
    for name in (
        *("batch/class_folder", "batch/class_run", "batch/cluster", "batch/gradescope", "batch/worker"),
        *("batch/workers", "reports/results"),
    ):
        assert "type=" not in (folder / f"{name}.py").read_text().replace("type=graded.status", ""), name
