"""Ctrl-C, SIGTERM and a full disk: whatever ends a run, its files are whole and its engine is off."""

import errno
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from snr_sim.recording.folder import RESULT_NAME
from snr_sim.recording.reader import read_trace
from snr_sim.recording.records import EndRecord, ErrorRecord
from snr_sim.recording.trace import FILE_NAME

Mine = Callable[..., Path]
WIRED = '        return self.store_data_task("engine", {"throttle": 0.2})'

LIMITED = """
import resource, sys
from snr_sim.cli.main import main
resource.setrlimit(resource.RLIMIT_FSIZE, ({limit}, {limit}))
sys.argv = ["snr", *{words}]
main()
"""


def run_limited(limit: int, *words: str) -> subprocess.CompletedProcess[str]:
    """Run `snr` where no file may be longer than this: what a full disk looks like from a program.

    It writes no bytecode: Python before 3.14 keeps the file of a module that it could write a part of only.
    """
    code = LIMITED.format(limit=limit, words=list(words))
    return subprocess.run([sys.executable, "-B", "-c", code], capture_output=True, text=True, timeout=300)


def assert_whole(folder: Path, fields: dict[str, Any]) -> None:
    assert json.loads((folder / RESULT_NAME).read_bytes()) == fields
    trace = read_trace(folder / FILE_NAME)
    assert isinstance(trace.records[-1], EndRecord)
    assert not trace.is_truncated
    assert trace.digest == fields["trace_digest"]


@pytest.mark.wall_clock
def test_signal_at_any_time_ends_run_in_order(here: Path, mine: Mine) -> None:
    spins = mine((WIRED, f"        while self.ticks == 2:\n            pass\n{WIRED}"), name="spins.py")
    sleeps = mine((WIRED, f"        import time; time.sleep(30 if self.ticks == 3 else 0)\n{WIRED}"), name="sleeps.py")
    command = [sys.executable, Path(__file__).with_name("signalled.py"), "8", "7", here / "runs"]
    done = subprocess.run([*command, "optimal", spins, "optimal", sleeps], capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    reports = json.loads(done.stdout)
    assert len(reports) == 8  # with 40 the slowest took 0.13 s
    for report in reports:
        assert report["status"] not in (0, None), report
        assert "Traceback" not in report["err"], report
        folders = list((here / "runs").glob(f"{report['number']}/*"))
        if not folders:  # the signal came before anything had begun
            assert report["status"] in (130, 143)
            continue
        fields = json.loads(report["out"])
        assert (fields["outcome"], fields["signal"]) == ("interrupted", report["signal"])
        assert_whole(folders[0], fields)
    took_s = sorted(report["took_s"] for report in reports)
    assert took_s[len(took_s) // 2] < 1.0  # without the time that it waited for a core on a busy computer
    assert took_s[-1] < 3.0  # it would sleep for 30


@pytest.mark.slow
def test_hanging_handler_is_named_with_line_and_run_replays(here: Path, mine: Mine) -> None:
    stuck = "        if self.ticks == 5:\n            open('stuck', 'w').close()\n"
    spins = mine((WIRED, f"{stuck}        while self.ticks == 5:\n            pass  # without end\n{WIRED}"))
    words = ["run", "lander_vertical", "--no-rrd", "--json", "--controller", str(spins)]
    child = subprocess.Popen(
        [sys.executable, "-m", "snr_sim", *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    while not (here / "stuck").exists():
        assert child.poll() is None
        time.sleep(0.005)
    child.terminate()
    out, _ = child.communicate(timeout=100)
    fields = json.loads(out)
    assert (child.returncode, fields["signal"]) == (1, "SIGTERM")
    assert "mine.py, line 2" in fields["notes"][0]
    assert "component 'mine' did not return" in fields["notes"][0]
    folder = here / fields["run_dir"]
    assert_whole(folder, fields)
    assert any(isinstance(one, ErrorRecord) and "mine" in one.message for one in read_trace(folder / FILE_NAME).records)
    replayed = subprocess.run([sys.executable, "-m", "snr_sim", "replay", folder], capture_output=True, timeout=100)
    assert replayed.returncode == 0, replayed.stdout


EARLY = [
    ("cli/main.py:<module>", "SIGINT"), ("typer/main.py:<module>", "SIGTERM"), ("cli/main.py:main", "SIGINT"),
    ("snr_sim/scenario/simulation.py:<module>", "SIGTERM"), ("snr_sim/scenario/simulation.py:prepare", "SIGINT"),
    ("library.py:load_controller", "SIGTERM"), ("trace.py:__init__", "SIGINT"),
    ("simulation_run.py:__init__", "SIGTERM"),
    ("interrupts.py:graceful_shutdown", "SIGINT"),
]  # fmt: skip
FIRST_TICK = [("simulation_run.py:run", "SIGINT"), ("node.py:begin", "SIGTERM"), ("lander_1d.py:step", "SIGINT")]
AFTERWARDS = [
    ("view.py:write_view", "SIGTERM", 0),
    ("run.py:_print_result", "SIGINT", 130),
    ("run.py:_write_view", "SIGTERM", 143),
]


class Signalled(NamedTuple):
    """How a run of `snr` ended that got a signal, and the folder it ran in."""

    folder: Path
    status: int
    out: str
    err: str


@pytest.fixture(scope="module")
def signalled(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Signalled]:
    """Return a function that returns how a run ended after a signal in a phase; one process runs all phases."""
    place = tmp_path_factory.mktemp("signalled")
    jobs = [[*case, "run", "lander_vertical"] for case in EARLY]
    jobs += [[*case, "run", "lander_vertical", "--json"] for case in FIRST_TICK]
    jobs += [[phase, kind, "run", "lander_vertical", "--rrd"] for phase, kind, _ in AFTERWARDS]
    program = Path(__file__).with_name("phased.py")
    command = [sys.executable, program, place]
    done = subprocess.run(command, input=json.dumps(jobs), capture_output=True, text=True, timeout=1000)
    assert done.returncode == 0, done.stderr
    rows = json.loads(done.stdout)
    ended = {
        job[0]: Signalled(place / str(i), row["status"], row["out"], row["err"])
        for i, (job, row) in enumerate(zip(jobs, rows, strict=True))
    }
    return ended.__getitem__


@pytest.mark.slow
@pytest.mark.parametrize(("phase", "kind"), EARLY)
def test_signal_before_start_ends_program_and_writes_nothing(
    signalled: Callable[[str], Signalled], phase: str, kind: str
) -> None:
    done = signalled(phase)
    assert (done.status, done.out, done.err) == ({"SIGINT": 130, "SIGTERM": 143}[kind], "", "Stopped.\n")
    assert not (done.folder / "runs").exists()


@pytest.mark.slow
@pytest.mark.parametrize(("phase", "kind"), FIRST_TICK)
def test_signal_at_first_tick_ends_run_in_order(signalled: Callable[[str], Signalled], phase: str, kind: str) -> None:
    done = signalled(phase)
    fields = json.loads(done.out)
    assert (done.status, fields["outcome"], fields["signal"]) == (1, "interrupted", kind)
    assert "Traceback" not in done.err
    assert_whole(done.folder / fields["run_dir"], fields)


@pytest.mark.slow
@pytest.mark.parametrize(("phase", "kind", "status"), AFTERWARDS)
def test_signal_after_run_loses_unwritten_files_only(
    signalled: Callable[[str], Signalled], phase: str, kind: str, status: int
) -> None:
    pytest.importorskip("rerun")
    done = signalled(phase)
    assert done.status == status
    assert "Traceback" not in done.err
    assert ("Stopped." in done.err) is (status > 0)
    (folder,) = (done.folder / "runs").iterdir()
    assert json.loads((folder / RESULT_NAME).read_bytes())["outcome"] == "landed"
    assert not list(folder.glob("part-*"))


@pytest.mark.slow
@pytest.mark.parametrize("room", [2_000, 100_000])
@pytest.mark.unmeasured
def test_full_disk_stops_run_with_message_and_complete_trace(here: Path, room: int) -> None:
    run_limited(10**9, "run", "lander_pad", "--no-rrd", "--out", "first")
    (first,) = (here / "first").iterdir()
    limit = room + sum(map(len, (first / FILE_NAME).read_bytes().split(b"\n")[:2]))
    done = run_limited(limit, "run", "lander_pad", "--json", "--no-rrd")
    assert done.returncode == 1, done.stderr
    assert "Traceback" not in done.stderr
    fields = json.loads(done.stdout)
    assert fields["outcome"] == "error"
    assert "could not be written on: File too large. It is whole up to there." in fields["error"]
    assert "Try: make room on the disk" in fields["error"]
    (folder,) = (here / "runs").iterdir()
    trace = read_trace(folder / FILE_NAME)
    assert not trace.is_truncated
    assert trace.path.stat().st_size <= limit
    assert trace.digest == fields["trace_digest"]
    assert json.loads((folder / RESULT_NAME).read_bytes()) == fields
    replayed = run_limited(10**9, "replay", str(folder))
    assert replayed.returncode == 0, replayed.stdout


@pytest.mark.slow
@pytest.mark.unmeasured
def test_disk_full_from_first_line_is_reported(here: Path) -> None:
    done = run_limited(100, "run", "lander_vertical", "--json", "--no-rrd")
    assert done.returncode == 2
    assert not (here / "runs").exists()
    assert "Traceback" not in done.stderr
    assert "could not be written" in json.loads(done.stdout)["error"]


@pytest.mark.parametrize("step", ["open", "replace"])
@pytest.mark.parametrize("words", [["--rrd"], []], ids=["with a view", "without"])
def test_unwritten_result_is_noted_and_run_counts(
    snr: Callable[..., Any], here: Path, monkeypatch: pytest.MonkeyPatch, step: str, words: list[str]
) -> None:
    really = getattr(os, step)

    def fail(path: Any, *given: Any, **named: Any) -> Any:
        if RESULT_NAME in str(path):
            raise OSError(errno.ENOSPC, "No space left on device")
        return really(path, *given, **named)

    monkeypatch.setattr(os, step, fail)
    answer = snr("run", "lander_vertical", "--json", *words)
    assert answer.status == 0
    (note,) = [note for note in answer.json["notes"] if RESULT_NAME in note]
    assert "could not be written: No space left on device. What it would say is printed here. Try: make room" in note
    assert note in answer.err
    (folder,) = (here / "runs").iterdir()
    assert {path.name for path in folder.iterdir()} <= {FILE_NAME, "view.rrd"}


@pytest.mark.slow
@pytest.mark.unmeasured
def test_full_disk_during_view_loses_view_only(here: Path) -> None:
    pytest.importorskip("rerun")
    run_limited(10**9, "run", "lander_vertical", "--json", "--no-rrd", "--out", "first")
    (first,) = (here / "first").iterdir()
    room = (first / FILE_NAME).stat().st_size + 1000
    done = run_limited(room, "run", "lander_vertical", "--json", "--rrd")
    assert done.returncode == 0, done.stderr
    (folder,) = (here / "runs").iterdir()
    assert not (folder / "view.rrd").exists() or (folder / "view.rrd").stat().st_size < room
    assert {path.name for path in folder.iterdir()} <= {FILE_NAME, RESULT_NAME, "view.rrd"}


@pytest.mark.slow
@pytest.mark.unmeasured
def test_full_disk_during_compare_reports_error(here: Path) -> None:
    pytest.importorskip("rerun")
    run_limited(10**9, "run", "lander_vertical", "--json")
    (run,) = (here / "runs").iterdir()
    done = run_limited(10_000, "compare", str(run), str(run), "--rrd", "both.rrd")  # rerun would never return
    assert done.returncode == 2, done.stderr
    assert "The view both.rrd cannot be written: File too large." in done.stderr
    assert {path.name for path in here.iterdir()} == {"runs"}
    replayed = run_limited(10_000, "replay", str(run), "--with", "coast")
    assert "side by side could not be written: " in replayed.stdout + replayed.stderr, replayed
    assert not list(run.glob("*.rrd"))


SWALLOW = """while True:
    try:
        open("stuck", "w").close()
        time.sleep(0.01)
    except BaseException:
        pass
"""


def ended(here: Path, code: str, number: int, *words: str) -> subprocess.CompletedProcess[str]:
    """Run `snr` with a file of a student's that swallows everything; return how the signal ended it."""
    (here / "mine.py").write_text(f"import time\n{code}")
    command = [sys.executable, "-m", "snr_sim", *words]
    child = subprocess.Popen(command, cwd=here, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    while not (here / "stuck").exists():
        assert child.poll() is None, child.communicate()
        time.sleep(0.01)
    child.send_signal(number)
    try:
        out, err = child.communicate(timeout=60)
    finally:
        child.kill()
    return subprocess.CompletedProcess(command, child.returncode, out, err)


RUN_MINE = ["run", "lander_vertical", "--no-rrd", "--controller", "./mine.py"]


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_file_that_ignores_interrupts_during_import_ends_process(here: Path, number: int) -> None:
    done = ended(here, SWALLOW, number, *RUN_MINE)
    assert done.returncode == 128 + number
    assert done.stderr.startswith("mine.py, line ")
    assert "this did not return, although it was interrupted" in done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_exit_function_that_ignores_interrupts_is_ended_at_once(here: Path, number: int) -> None:
    at_exit = "".join(f"    {line}\n" for line in SWALLOW.splitlines())
    controller = f"import atexit\n@atexit.register\ndef spin():\n{at_exit}def factories(robot):\n    return []\n"
    done = ended(here, controller, number, *RUN_MINE)
    assert done.returncode == -number  # a shell says 128 + number
    assert "run folder:" in done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("closed", [">&-", ">&- 2>&- <&-"])
@pytest.mark.parametrize(
    "words", ["list", "run lander_vertical --no-rrd", "run lander_vertical --json", "bench --help"]
)
def test_verb_without_standard_streams_ends_without_output(here: Path, words: str, closed: str) -> None:
    command = ["sh", "-c", f'"$0" -m snr_sim {words} {closed}', sys.executable]
    done = subprocess.run(command, cwd=here, capture_output=True, text=True, timeout=100)
    assert (done.returncode, done.stdout) == (0, "")
    assert "Traceback" not in done.stderr
    if words.startswith("run"):
        (folder,) = (here / "runs").iterdir()
        assert_whole(folder, json.loads((folder / RESULT_NAME).read_bytes()))


@pytest.mark.wall_clock
def test_signal_ends_run_within_half_a_second_under_full_load(here: Path) -> None:
    count = os.cpu_count() or 1
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(count)]
    try:
        program = Path(__file__).with_name("signalled.py")
        command = [sys.executable, program, "4", "3", here / "runs", "optimal"]
        reports = json.loads(subprocess.check_output(command, timeout=300, cwd=here))
    finally:
        for one in busy:
            one.kill()
            one.wait()
    wall_s = sorted(report["wall_s"] for report in reports)
    assert wall_s[-1] <= 0.5, wall_s  # each; 0.01 to 0.05 s, 0.17 s with ten times as many programs as cores
