"""A class graded by a dask cluster on this computer, one of whose workers is killed while it grades."""

import csv
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

HandedIn = Callable[..., list[Path]]
GIVE_UP_S = 300


@pytest.fixture
def processes() -> Iterator[list[subprocess.Popen[bytes]]]:
    """What a test starts is ended with it."""
    started: list[subprocess.Popen[bytes]] = []
    yield started
    for process in started:
        process.kill()
        process.wait()


def wait_for(what: Callable[[], object], *needed: subprocess.Popen[bytes]) -> None:
    give_up_s = time.monotonic() + GIVE_UP_S
    while not what():
        assert all(process.poll() is None for process in needed)
        assert time.monotonic() < give_up_s
        time.sleep(0.005)


def start_cluster(folder: Path, processes: list[subprocess.Popen[bytes]]) -> str:
    """Starts a scheduler and two workers; returns the scheduler's address."""
    distributed = pytest.importorskip("distributed")
    file = folder / "scheduler.json"
    dask = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0"]
    no_output = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    processes.append(subprocess.Popen([*dask, "--no-dashboard", "--scheduler-file", str(file)], **no_output))
    wait_for(file.exists, *processes)
    worker = [sys.executable, "-m", "distributed.cli.dask_worker", "--scheduler-file", str(file), "--nthreads", "1"]
    words = ["--no-nanny", "--no-dashboard", "--host", "127.0.0.1", "--local-directory", str(folder)]
    processes += [subprocess.Popen([*worker, *words], **no_output) for _ in range(2)]
    with distributed.Client(scheduler_file=str(file), set_as_default=False) as client:
        client.wait_for_workers(2, timeout=GIVE_UP_S)
        address: str = client.scheduler.address
    return address


def test_killed_cluster_worker_costs_no_points(
    double_lab: Path, handed_in: HandedIn, tmp_path: Path, processes: list[subprocess.Popen[bytes]]
) -> None:
    address = start_cluster(tmp_path, processes)
    programs = {f"s{i}": "right" if i % 2 else "visible_only" for i in range(8)}
    out = tmp_path / "out"
    words = ["grade", str(double_lab), *map(str, handed_in(**programs)), "--out", str(out), "--isolation", "none"]
    grading = subprocess.Popen([sys.executable, "-m", "snr_sim", *words, "--scheduler", address])
    processes.append(grading)
    wait_for(lambda: len(list(out.glob("results/*.json"))) >= 2, *processes)
    os.kill(processes[1].pid, signal.SIGKILL)
    assert grading.wait(GIVE_UP_S) == 0
    with (out / "class.csv").open(newline="") as file:
        points = {row["submission"]: row["points"] for row in csv.DictReader(file)}
    assert points == {name: "100" if program == "right" else "70" for name, program in programs.items()}


HASTY = """
from snr_sim.grading.batch import cluster
from snr_sim.cli.main import main
cluster._CONNECT_S = 1
main()
"""


@pytest.mark.parametrize(
    ("address", "message"),
    [
        ("tcp://127.0.0.1:1", "No dask scheduler answers at tcp://127.0.0.1:1"),
        ("nonsense://nowhere:1", "'nonsense://nowhere:1' is not the address"),
        ("cluster", "'cluster' is not the address"),
    ],
)
def test_unreachable_scheduler_is_reported(
    double_lab: Path, handed_in: HandedIn, tmp_path: Path, address: str, message: str
) -> None:
    pytest.importorskip("distributed")
    words = ["grade", str(double_lab), *map(str, handed_in(ada="right")), "--out", str(tmp_path / "out")]
    command = [sys.executable, "-c", HASTY, *words, "--scheduler", address]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 2
    assert message in done.stderr
    assert "Traceback" not in done.stderr, done.stderr
    assert not (tmp_path / "out").exists()


def test_missing_dask_names_the_extra_to_install(double_lab: Path, handed_in: HandedIn, tmp_path: Path) -> None:
    words = ["grade", str(double_lab), *map(str, handed_in(ada="right")), "--out", str(tmp_path / "out")]
    code = "import sys; sys.modules['distributed'] = None; from snr_sim.cli.main import main; main()"
    command = [sys.executable, "-c", code, *words, "--scheduler", "tcp://127.0.0.1:1"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 2
    assert "snr_sim[grade-cluster]" in done.stderr
