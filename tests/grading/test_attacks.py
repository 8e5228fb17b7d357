"""Attacks on the grader earn nothing, leave nothing behind, and are in nobody's way. See attacks/README.md."""

import csv
import ctypes
import os
import shutil
import socket
import subprocess
import sys
import threading
import time
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from snr_sim.grading.child_process import try_sandbox
from snr_sim.grading.sandbox import IsolationMissing

ATTACKS = sorted((Path(__file__).parent / "attacks").glob("*.py"))
TOKEN = f"snr_attack_{os.getpid()}"
# What is not there earns nothing; these do something that is right as well.
HONEST_PART = {"visible_only": 70.0}
PR_SET_CHILD_SUBREAPER = 36


@pytest.fixture(scope="module")
def sandbox() -> None:
    """Skips where programs cannot be kept apart, but not in CI."""
    try:
        try_sandbox()
    except IsolationMissing as error:
        if os.environ.get("SNR_REQUIRE_EMULATORS"):
            raise
        pytest.skip(str(error))


@pytest.fixture
def listener() -> Iterator[tuple[int, list[str]]]:
    """A port that nobody should reach, with and without a name; and who has reached it."""
    reached: list[str] = []
    with socket.create_server(("127.0.0.1", 0)) as tcp, socket.socket(socket.AF_UNIX) as unnamed:
        port = tcp.getsockname()[1]
        unnamed.bind(f"\0snr_attack_{port}")
        unnamed.listen()

        def listen(server: socket.socket) -> None:
            try:
                while True:
                    server.accept()[0].close()
                    reached.append(str(server.getsockname()))
            except OSError:
                return

        threads = [threading.Thread(target=listen, args=(server,), daemon=True) for server in (tcp, unnamed)]
        for thread in threads:
            thread.start()
        yield port, reached
        for server in (tcp, unnamed):
            server.shutdown(socket.SHUT_RDWR)


def hand_in(tmp_path: Path, port: int) -> list[Path]:
    """Every attack as a submission, some that are attacks by their form, and honest neighbours between them."""
    given = []
    for attack in ATTACKS:
        folder = tmp_path / "submissions" / attack.stem
        folder.mkdir(parents=True)
        shutil.copy(attack, folder / "double.py")
        (folder / "token.txt").write_text(TOKEN)
        (folder / "port.txt").write_text(str(port))
        given.append(folder)
    link = tmp_path / "submissions" / "is_a_link"
    link.mkdir()
    (link / "double.py").symlink_to(given[0] / "double.py")
    outside = tmp_path / "submissions" / "leads_outside.zip"
    with zipfile.ZipFile(outside, "w") as archive:
        archive.writestr("double.py", "def double(x):\n    return 2 * x\n")
        archive.writestr(f"../../{TOKEN}", "evil")
    shadow = tmp_path / "submissions" / "shadows_the_kit"
    shadow.mkdir()
    (shadow / "double.py").write_text("def double(x):\n    return None\n")
    for name in ("msgspec.py", "json.py", "sitecustomize.py", "usercustomize.py", "snr_sim.py", "os.py", "signal.py"):
        (shadow / name).write_text(f"import sys\nprint('loaded {name}')\nsys.exit(0)\n")
    neighbours = []
    for i in range(3):
        neighbour = tmp_path / "submissions" / f"neighbour_{i}"
        neighbour.mkdir()
        (neighbour / "double.py").write_text("def double(x):\n    return 2 * x\n")
        neighbours.append(neighbour)
    return [neighbours[0], *given[::2], neighbours[1], *given[1::2], link, outside, shadow, neighbours[2]]


def children() -> set[int]:
    """Processes whose parent this process is."""
    found = set()
    for task in Path("/proc/self/task").iterdir():
        found |= {int(pid) for pid in (task / "children").read_text().split()}
    return found


def still_alive(before: set[int]) -> set[int]:
    """Processes that came since and do not end; those that have ended are buried."""
    give_up_s = time.monotonic() + 60
    while (left := children() - before) and time.monotonic() < give_up_s:
        for pid in left:
            os.waitpid(pid, os.WNOHANG)
        time.sleep(0.01)
    return left


def left_behind() -> list[str]:
    places = ("/dev/shm", "/tmp", "/var/tmp", "/run", "/dev/mqueue", "/etc", str(Path.home()))
    return [str(path) for place in places if Path(place).is_dir() for path in Path(place).glob(f"*{TOKEN}*")]


def test_attacks_earn_nothing_and_leave_nothing(
    sandbox: None, double_lab: Path, listener: tuple[int, list[str]], tmp_path: Path
) -> None:
    port, reached = listener
    given = hand_in(tmp_path, port)
    (tmp_path / "the_secret").write_text("correct horse battery staple")
    (tmp_path / "tmp").mkdir()
    before, kit = children(), kit_files()
    ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 1)  # who is left without a parent becomes ours, and is seen
    words = ["grade", str(double_lab), *map(str, given), "--out", str(tmp_path / "out"), "--jobs", "6"]
    done = subprocess.run(
        [sys.executable, "-m", "snr_sim", *words, "--secret", str(tmp_path / "the_secret")],
        capture_output=True,
        text=True,
        env={**os.environ, "TMPDIR": str(tmp_path / "tmp")},
    )
    ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 0)
    assert done.returncode == 0, done.stderr + done.stdout
    with (tmp_path / "out" / "class.csv").open(newline="") as file:
        rows = {row["submission"]: row for row in csv.DictReader(file)}
    points = {name: float(row["points"]) for name, row in rows.items()}
    expected = {path.stem: HONEST_PART.get(path.stem, 100.0 if "neighbour" in path.stem else 0.0) for path in given}
    assert points == expected
    assert {name for name, row in rows.items() if row["status"] == "refused"} == {"is_a_link", "leads_outside"}
    for path in (tmp_path / "out" / "results").iterdir():
        assert "AssertionError" not in path.read_text(), f"{path.stem} has not acted at all"
    assert reached == []
    assert still_alive(before) == set()
    assert list((tmp_path / "tmp").iterdir()) == []
    assert left_behind() == []
    assert kit_files() == kit


def kit_files() -> set[tuple[str, float]]:
    """What stands in the kit, and when it was changed."""
    import snr_sim

    folder = Path(snr_sim.__file__).parent
    return {(str(path), path.stat().st_mtime) for path in folder.rglob("*.py")}


Handed = Callable[..., list[Path]]


def test_what_a_program_says_in_a_hidden_case_reaches_no_student(
    sandbox: None, double_lab: Path, handed_in: Handed, tmp_path: Path
) -> None:
    """A program that raises, prints and answers with what it was given tells it to the instructor alone."""
    lines = ["print('printed', x)", "if x > 9: raise ValueError(f'given {x}')", "return 2 * x"]
    tells = "def double(x):\n" + "".join(f"    {line}\n" for line in lines)
    (tmp_path / "the_secret").write_text("correct horse battery staple")
    given = handed_in(tells=tells)
    words = ["grade", str(double_lab), *map(str, given), "--out", str(tmp_path / "out")]
    command = [sys.executable, "-m", "snr_sim", *words, "--secret", str(tmp_path / "the_secret")]
    subprocess.run(command, check=True, capture_output=True)
    kept = (tmp_path / "out" / "results" / "tells.json").read_text()
    assert "given" in kept
    for path in (tmp_path / "out" / "students" / "tells").iterdir():
        text = path.read_text()
        assert "given" not in text
        assert "printed" not in text or path.name == "report.md"
        assert "0 of 2 passed" in text
