"""Confined process, where no sandbox can be made: its identity, view and permissions, each tried from inside."""

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import pytest

import snr_sim
from snr_sim.grading.remote.launch import NUMERIC_ENV_VARS
from snr_sim.grading.sandbox.confiner import FIRST_UID, LAST_UID
from tests.grading.probe import TRIES

KIT = Path(snr_sim.__file__).resolve().parent
KNOWN = {
    *map(str, (KIT, KIT / "shipped" / "assignments")),
    *(str(Path(one).resolve()) for one in (*sys.path, sys.base_prefix)),
}

# Runs in a student's process. It reaches modules that the check of imports refuses in another way.
PROBE = (
    TRIES
    + '''
import signal, tempfile

ctypes = sys.modules["ctypes"]
libc = ctypes.CDLL(None, use_errno=True)


def asked(name, *args):
    """Return the result of a function of the C library: "done", or the error's name."""
    ctypes.set_errno(0)
    returned = getattr(libc, name)(*args)
    return "done" if ctypes.c_int(returned).value != -1 else errno.errorcode[ctypes.get_errno()]


def tempfiles():
    made = []
    for number in range(99):
        made.append(tried(write, f"{tempfile.gettempdir()}/{number}"))
    return made


def connect(family, address):
    import _socket
    _socket.socket(family).connect(address)


def pair():
    import _socket
    ours, theirs = _socket.socketpair()
    ours.send(b"x")
    return theirs.recv(1).decode()


def who():
    return {
        "uid": [os.getuid(), os.geteuid(), os.getgid(), os.getegid()],
        "groups": os.getgroups(),
        "environment": sorted(os.environ),
        "scratch": os.environ.get("TMPDIR"),
        "arguments": sys.orig_argv[1:],
        "open files": [fd for fd in range(1024) if tried(os.fstat, fd) == "done"],
        "session": os.getsid(0) == os.getpid(),
        "limits": limits(),
        "pair": pair(),
    }


def tries(listener_port):
    kit = os.path.dirname(sys.modules["snr_sim"].__file__)
    scratch = tempfile.gettempdir()
    buffer = ctypes.create_string_buffer(64)
    return {
        "its own file": tried(write, "mine.py"),
        "next to it": tried(write, "more.py"),
        "the kit": tried(write, kit + "/more.py"),
        "/": tried(write, "/more"),
        "/tmp": tried(write, "/tmp/more"),
        "/dev/shm": tried(write, "/dev/shm/more"),
        "a folder": tried(os.mkdir, scratch + "/more"),
        "a link": tried(os.symlink, "/etc/passwd", scratch + "/more"),
        "a hard link": tried(os.link, "mine.py", scratch + "/more"),
        "a pipe": tried(os.mkfifo, scratch + "/more"),
        "much": tried(write, scratch + "/much", 2 << 20),
        "emptying": tried(os.close, os.open("mine.py", os.O_RDONLY)) and tried(os.open, "/dev/null", os.O_TRUNC),
        "fork": tried(os.fork),
        "program": tried(os.posix_spawn, sys.executable, ["python"], {}),
        "exec": tried(os.execv, sys.executable, ["python"]),
        "thread": tried(sys.modules["_thread"].start_new_thread, int, ()),
        "root": tried(os.setuid, 0),
        "parent": tried(os.kill, os.getppid(), 0),
        "first": tried(os.kill, 1, 0),
        "everybody": tried(os.kill, -1, 0),
        "itself": tried(os.kill, os.getpid(), 0),
        "internet": tried(connect, 2, ("127.0.0.1", listener_port)),
        "unnamed": tried(connect, 1, f"\\0snr_attack_{listener_port}"),
        "ptrace": asked("ptrace", 16, os.getppid(), 0, 0),
        "memory of others": asked("process_vm_readv", os.getppid(), buffer, 1, buffer, 1, 0),
        "prctl": asked("prctl", 1, 0, 0, 0, 0),
        "shm": asked("shmget", 1234, 4096, 0o1777),
        "sem": asked("semget", 1234, 1, 0o1777),
        "msg": asked("msgget", 1234, 0o1777),
        "mq": asked("mq_open", b"/snr_more", 0o102, 0o777, None),
        "memfd": asked("memfd_create", b"more", 0),
        "keys": asked("syscall", 250 if os.uname().machine == "x86_64" else 219, 0, -3, 0),
        "io_uring": asked("syscall", 425, 8, buffer),
        "bpf": asked("syscall", 321 if os.uname().machine == "x86_64" else 280, 0, buffer, 64),
        "mount": asked("mount", b"none", b"/tmp", b"tmpfs", 0, None),
        "unshare": asked("unshare", 0x10000000),
        "pidfd": asked("syscall", 434, os.getppid(), 0),
        "more memory": tried(resource.setrlimit, resource.RLIMIT_AS, (-1, -1)),
        "more files": tried(resource.prlimit, os.getppid(), resource.RLIMIT_NOFILE),
    }


def heavy():
    import numpy, snr_sim.core.node
    return float(numpy.linalg.solve(numpy.eye(3) * 2, [1, 1, 1]).sum())
'''
)
SCRIPT = """
import json, sys
from contextlib import suppress
from pathlib import Path
from snr_sim.grading import Student
from snr_sim.grading.remote import launch
from snr_sim.grading.remote.isolation import find_isolation
from snr_sim.grading.sandbox.sandbox import KIT


def processes():
    found = []
    for status in Path("/proc").glob("[0-9]*/status"):
        with suppress(OSError):
            fields = dict(line.split(":\t", 1) for line in status.read_text().splitlines() if ":\t" in line)
            if not fields["State"].startswith("Z"):
                found.append([int(fields["Pid"]), int(fields["Uid"].split()[0])])
    return found


folder, secret, port = Path(sys.argv[1]), sys.argv[2], int(sys.argv[3])
allowed = frozenset({"ctypes", "_socket"})
with Student(folder, find_isolation(), allowed) as ada, Student(folder, find_isolation(), allowed) as bob:
    reports = {"isolation": ada.isolation, "who": ada.call("mine.py", "who"), "bob": bob.call("mine.py", "who")}
    reports["processes"] = processes()
    reports["tries"] = ada.call("mine.py", "tries", port)
    reports["files"] = bob.call("mine.py", "tempfiles")
    reports["looks"] = ada.call("mine.py", "looks", json.loads(secret))
    reports["heavy"] = ada.call("mine.py", "heavy")
reports["left"] = processes()
launch.sandbox.LABS = KIT / "plants"  # as if these were the labs of an installed kit
with Student(folder, find_isolation(), allowed) as eve:
    reports["labs"] = eve.call("mine.py", "looks", [f"{KIT}/plants/__init__.py", f"{KIT}/__init__.py"])
print(json.dumps(reports))
"""


@pytest.fixture(scope="module")
def reports(docker: list[str], tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Return the reports of two confined processes that ran at the same time."""
    import socket
    import tempfile

    with tempfile.TemporaryDirectory(prefix="snr-test-") as name, socket.create_server(("127.0.0.1", 0)) as server:
        folder = Path(name) / "submission"
        folder.mkdir()
        for path in (folder.parent, folder):
            path.chmod(0o755)
        (folder / "mine.py").write_text(PROBE)
        secret = folder.parent / "secret.txt"
        secret.write_text("do not tell")
        secret.chmod(0o644)
        words = [str(folder), json.dumps(hidden(secret)), str(server.getsockname()[1])]
        done = subprocess.run([*docker, sys.executable, "-c", SCRIPT, *words], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        fields: dict[str, Any] = json.loads(done.stdout)
        scratches = {fields[name]["scratch"] for name in ("who", "bob")}
        assert len(scratches) == 2
        fields["places"] = [place for place in scratches if Path(place).exists()]
        return fields


def hidden(secret: Path) -> list[str]:
    """Return paths that no student may read; folders end with a slash."""
    top = KIT.parent
    processes = ["/proc/", "/proc/self/environ", "/proc/1/cmdline", "/proc/1/environ", "/proc/self/mem"]
    return [str(secret), f"{secret.parent}/", f"{top}/tests/", f"{top}/assignments/", "/etc/passwd", "/", *processes]


@pytest.mark.slow
def test_isolation_without_bubblewrap_is_confined(reports: dict[str, Any]) -> None:
    assert reports["isolation"] == "confined"


def test_confined_processes_have_separate_unprivileged_users(reports: dict[str, Any]) -> None:
    users = [reports[name]["uid"][0] for name in ("who", "bob")]
    assert len(set(users)) == 2
    for name, user in zip(("who", "bob"), users, strict=True):
        assert FIRST_UID <= user <= LAST_UID
        assert reports[name]["uid"] == [user] * 4
        assert reports[name]["groups"] == []
        assert reports[name]["session"]
        assert reports[name]["limits"] == [[1, 1], [0, 0], [1 << 20] * 2, [60, 62], [1 << 30] * 2, [64, 64]]
        assert [one for _, one in reports["processes"]].count(user) == 1
        assert user not in [one for _, one in reports["left"]]


def test_confined_process_gets_only_its_own_paths(reports: dict[str, Any]) -> None:
    threads = ["MKL_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"]
    known = {*threads, "LC_ALL", "PYTHONDONTWRITEBYTECODE", "PYTHONHASHSEED", "TMPDIR"}
    assert set(reports["who"]["environment"]) == known | (os.environ.keys() & set(NUMERIC_ENV_VARS))
    assert [fd for fd in reports["who"]["open files"] if fd > 2] == [200]  # the conversation
    begin = reports["who"]["arguments"][-1]
    assert begin.partition("; main(")[0].endswith("from snr_sim.grading.remote.child import main")
    paths = set(re.findall(r"'(/[^']*)'", begin.partition("; main(")[2]))
    own = rf"/(usr|lib\w*)$|{re.escape(tempfile.gettempdir())}/snr-(scratch|test)-"
    assert all(re.match(own, path) or path in KNOWN for path in paths), paths


def test_confined_process_cannot_read_other_files_or_processes(reports: dict[str, Any]) -> None:
    assert reports["looks"] == ["EACCES"] * len(hidden(Path("x")))
    assert reports["labs"] == ["EACCES", "done"]


def test_confined_process_writes_only_limited_scratch_files(reports: dict[str, Any]) -> None:
    tries = reports["tries"]
    places = ("its own file", "next to it", "the kit", "/", "/tmp", "/dev/shm", "a folder")
    assert {place: tries[place] for place in places} == dict.fromkeys(places, "EACCES")
    assert {tries[sort] for sort in ("a link", "a hard link", "a pipe")} == {"ENOSYS"}
    assert tries["much"] == "EFBIG"
    assert reports["files"] == ["done"] * 16 + ["ENOSPC"] * 83
    assert reports["places"] == []


def test_confined_process_cannot_start_or_reach_others(reports: dict[str, Any]) -> None:
    tries = reports["tries"]
    assert (tries["fork"], tries["program"], tries["thread"]) == ("EAGAIN", "EAGAIN", "RuntimeError")
    assert [tries[one] for one in ("parent", "first", "everybody")] == ["EPERM"] * 3
    assert tries["itself"] == "done"
    refused = (
        *("exec", "root", "internet", "unnamed", "ptrace", "memory of others", "prctl", "shm", "sem", "msg", "mq"),
        *("memfd", "keys", "io_uring", "bpf", "mount", "unshare", "pidfd"),
    )
    assert {name: tries[name] for name in refused} == dict.fromkeys(refused, "ENOSYS")
    assert tries["more memory"] in ("EPERM", "ValueError")
    assert tries["more files"] == "EPERM"
    assert tries["emptying"] == "EPERM"


def test_confined_process_computes_normally(reports: dict[str, Any]) -> None:
    assert reports["heavy"] == 1.5
    assert reports["who"]["pair"] == "x"


HOLDS = """
import sys
from pathlib import Path
from snr_sim.grading import Student
from snr_sim.grading.remote.isolation import find_isolation

with Student(Path(sys.argv[1]), find_isolation()) as student:
    assert student.call("mine.py", "f") == 1
    print(student.isolation, flush=True)
    sys.stdin.read()
"""


@pytest.mark.slow
@pytest.mark.parametrize("isolation", ["sandbox", "confined"])
def test_process_ends_when_its_grader_is_killed(
    isolation: str, request: pytest.FixtureRequest, open_folder: Path
) -> None:
    prefix = request.getfixturevalue("docker") if isolation == "confined" else request.getfixturevalue("sandbox") or []
    (open_folder / "mine.py").write_text("def f():\n    return 1\n")
    grader = subprocess.Popen(
        [*prefix, sys.executable, "-c", HOLDS, str(open_folder)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert grader.stdin is not None
    assert grader.stdout is not None
    with grader.stdin, grader.stdout:
        assert grader.stdout.readline() == f"{isolation}\n"
        below = below_of(grader.pid)
        assert below
        grader.kill()
        grader.wait()
        give_up_s = time.monotonic() + 60.0
        while any(map(is_alive, below)):
            assert time.monotonic() < give_up_s
            time.sleep(0.01)


def below_of(pid: int) -> list[int]:
    children = [int(one) for one in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    return children + [one for child in children for one in below_of(child)]


def is_alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.slow
def test_private_installation_raises_and_names_the_folder(docker: list[str], open_folder: Path) -> None:
    closed = open_folder / "private"
    shutil.copytree(KIT, closed / "snr_sim", ignore=shutil.ignore_patterns("__pycache__"))
    closed.chmod(0o700)
    script = "from snr_sim.grading.remote.isolation import try_confinement; try_confinement()"
    words = [*docker, "env", f"PYTHONPATH={closed}", sys.executable, "-c", script]
    done = subprocess.run(words, capture_output=True, text=True, cwd=open_folder)
    assert done.returncode == 1
    assert f"who may not enter {closed}, and Python, its packages or the kit are in there" in done.stderr
    assert f"chmod o+x {closed}" in done.stderr
    closed.chmod(0o711)
    done = subprocess.run(words, capture_output=True, text=True, cwd=open_folder)
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_results_are_equal_in_both_isolations(
    docker: list[str], sandbox: None, landing_lab: Path, open_folder: Path, tmp_path: Path
) -> None:
    """Results of isolations for landing, crashing, printing and raising programs: equal except for the isolation."""
    pilots = Path(__file__).parents[2] / "robots" / "lander" / "controllers"
    programs = {
        "lands": (pilots / "optimal.py").read_text(),
        "coasts": (pilots / "coast.py").read_text(),
        "raises": "print('here')\n\n\ndef factories(robot):\n    return [1 / 0]\n",
    }
    for name, program in programs.items():
        (open_folder / name).mkdir()
        (open_folder / name / "pilot.py").write_text(program)
    (tmp_path / "the_secret").write_text("correct horse battery staple")
    given = [str(open_folder / name) for name in programs]
    results: dict[str, dict[str, dict[str, Any]]] = {}
    for isolation, prefix in (("sandbox", []), ("confined", docker)):
        out = tmp_path / isolation
        words = ["grade", str(landing_lab), *given, "--out", str(out), "--secret", str(tmp_path / "the_secret")]
        done = subprocess.run([*prefix, sys.executable, "-m", "snr_sim", *words], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        records = {path.stem: json.loads(path.read_text()) for path in (out / "results").iterdir()}
        results[isolation] = {name: record["graded"] for name, record in records.items()}
        assert {one.pop("isolation") for one in results[isolation].values()} == {isolation}
    assert results["confined"] == results["sandbox"]
    points = {name: sum(check["points"] for check in one["checks"]) for name, one in results["confined"].items()}
    assert points == {"lands": 100.0, "coasts": 0.0, "raises": 0.0}
