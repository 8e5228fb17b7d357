"""The sandbox: identity, view and permissions of a student's process, each tried from inside."""

import ctypes
import os
import shutil
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import snr_sim
from snr_sim.grading import Student
from snr_sim.grading.grade import grade_submission
from snr_sim.grading.lab.lab import load_lab
from snr_sim.grading.lab.verdicts import GraderError, SubmissionError
from snr_sim.grading.remote import isolation
from snr_sim.grading.remote.fork_server import ForkServer
from snr_sim.grading.remote.isolation import (
    bubblewrap_error,
    confinement_error,
    find_isolation,
    try_confinement,
    try_sandbox,
)
from snr_sim.grading.remote.launch import NUMERIC_ENV_VARS
from snr_sim.grading.sandbox import sandbox as sandbox_module
from snr_sim.grading.sandbox.sandbox import IsolationMissingError, Limits, find_bubblewrap, is_root
from tests.grading.probe import TRIES

PROBE = (
    TRIES
    + '''
KEY = 0x5E9


def rights():
    """Returns what the kernel says to what only root may; which capabilities there are."""
    ctypes = __import__("ctypes")  # as a submission would that hides it
    libc = ctypes.CDLL(None, use_errno=True)
    refused, own = [], os.pidfd_open(os.getpid())
    for function, *args in (
        (libc.unshare, 0x08000000),
        (libc.unshare, 0x00020000),
        (libc.setns, own, 0x08000000),
        (libc.mount, b"x", b"/tmp", b"tmpfs", 0, None),
        (libc.chroot, b"/tmp"),
        (libc.setresuid, 0, 0, 0),
        (libc.sethostname, b"me", 2),
    ):
        refused.append(function(*args) == -1 and errno.errorcode[ctypes.get_errno()])
    os.close(own)
    header = (ctypes.c_uint32 * 2)(0x20080522, 0)
    sets = (ctypes.c_uint32 * 6)()
    libc.capget(header, sets)
    return [refused, [*sets[:2], *sets[3:5]], libc.prctl(39, 0, 0, 0, 0)]


def undivided():
    """Returns what the kernel says to what no namespace divides, no limit counts, or makes a namespace of one's own."""
    ctypes = __import__("ctypes")
    libc = ctypes.CDLL(None, use_errno=True)
    intel = os.uname().machine == "x86_64"
    all_cores = ctypes.byref((ctypes.c_ubyte * 128)(*[255] * 128))
    asked = {
        "add_key": (libc.syscall, 248 if intel else 217, b"user", b"snr_test", b"x", 1, -4),
        "keyctl": (libc.syscall, 250 if intel else 219, 0, -3, 0),
        "sched_setaffinity": (libc.sched_setaffinity, 0, 128, all_cores),
        "shmget": (libc.shmget, 0, 4096, 0o1600),
        "semget": (libc.semget, 0, 1, 0o1600),
        "msgget": (libc.msgget, 0, 0o1600),
        "memfd_create": (libc.memfd_create, b"more", 0),
        "unshare": (libc.unshare, 0x10000000),
        "socket": (libc.socket, 2, 1, 0),
        "io_uring_setup": (libc.syscall, 425, 8, None),
        "bpf": (libc.syscall, 321 if intel else 280, 0, None, 64),
        "perf_event_open": (libc.syscall, 298 if intel else 241, None, 0, -1, -1, 0),
        "userfaultfd": (libc.syscall, 323 if intel else 282, 1),
        "ptrace": (libc.ptrace, 16, 1, None, None),
        "ioprio_set": (libc.syscall, 251 if intel else 30, 1, 0, 3 << 13),
    }
    results = {}
    for name, (function, *args) in asked.items():
        ctypes.set_errno(0)
        results[name] = errno.errorcode[ctypes.get_errno()] if function(*args) == -1 else "done"
    return results


def facts():
    import _socket

    line = _socket.socket()
    libc = __import__("ctypes").CDLL(None)
    return {
        "number": os.getpid(),
        "computer": os.uname().nodename,
        "segment": libc.shmget(KEY, 0, 0),
        "limits": limits(),
        "uid": [os.getuid(), os.geteuid(), os.getgid()],
        "groups": os.getgroups(),
        "environment": sorted(os.environ),
        "here": os.getcwd(),
        "root": sorted(os.listdir("/")),
        "processes": os.path.exists("/proc/1"),
        "network": tried(line.connect, ("1.1.1.1", 80)),
        "loopback": tried(line.connect, ("127.0.0.1", 22)),
        "submission": tried(write, "mine.py"),
        "beside": tried(write, "more.py"),
        "kit": tried(write, os.path.dirname(sys.modules["snr_sim"].__file__) + "/more.py"),
        "root folder": tried(os.mkdir, "/more"),
        "scratch": tried(write, "/tmp/more"),
        "much scratch": tried(write, "/tmp/much", 40 << 20),
        "fork": tried(os.fork),
        "program": tried(os.posix_spawn, sys.executable, ["python"], {}),
        "root again": tried(os.setuid, 0),
        "rights": rights(),
        "parent": tried(os.kill, os.getppid(), 9),
        "more memory": tried(resource.setrlimit, resource.RLIMIT_AS, (-1, -1)),
        "open files": len([fd for fd in range(1024) if tried(os.fstat, fd) == "done"]),
    }


def arguments():
    return sys.orig_argv[1:]


def seen_under(folder):
    return sorted(os.path.join(at, file) for at, _, files in os.walk(folder) for file in files)
'''
)

pytestmark = pytest.mark.usefixtures("sandbox")


@pytest.fixture
def submission(tmp_path: Path) -> Path:
    folder = tmp_path / "submission"
    folder.mkdir()
    folder.chmod(0o755)
    (folder / "mine.py").write_text(PROBE)
    return folder


@pytest.fixture(params=["fresh", "copied"])
def fork_server(request: pytest.FixtureRequest, submission: Path) -> Iterator[ForkServer | None]:
    """Where student's processes are copies; none if each gets a sandbox of its own."""
    if request.param == "fresh":
        yield None
        return
    if not is_root():
        pytest.skip("there are copies for root alone")
    with ForkServer("sandbox", Limits(cpu_s=1)) as fork_server, fork_server.with_submission(submission):
        yield fork_server


@pytest.mark.slow
def test_sandbox_filter_rejects_calls_outside_namespaces_and_limits(
    submission: Path, fork_server: ForkServer | None
) -> None:
    """The last wall covers what no namespace separates (cores, keys), and what no limit counts (shared memory)."""
    with Student(submission, "sandbox", fork_server=fork_server) as student:
        errors = student.call("mine.py", "undivided")
    assert errors == dict.fromkeys(errors, "ENOSYS")
    assert len(errors) == 15


@pytest.mark.slow
def test_sandboxed_process_has_no_rights_and_writes_only_scratch(
    namespaces_alone: None, submission: Path, fork_server: ForkServer | None
) -> None:
    submission.parent.chmod(0o755)
    libc = ctypes.CDLL(None)
    segment = libc.shmget(0x5E9, 4096, 0o1666)  # which everybody outside may use
    try:
        with Student(submission, "sandbox", fork_server=fork_server) as student:
            facts = student.call("mine.py", "facts")
    finally:
        libc.shmctl(segment, 0, None)  # IPC_RMID
    assert (segment >= 0, facts["segment"]) == (True, -1)
    assert facts["number"] < 10
    assert facts["computer"] == "grader"
    cpu_s = 1 if fork_server is not None else 60
    assert facts["limits"] == [[1, 1], [0, 0], [1 << 24] * 2, [cpu_s, cpu_s + 2], [1 << 30] * 2, [64, 64]]
    assert facts["uid"] == [65534, 65534, 65534]
    assert facts["groups"] == [] or os.getuid() != 0
    threads = ["MKL_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"]
    known = {*threads, "LC_ALL", "PWD", "PYTHONDONTWRITEBYTECODE", "PYTHONHASHSEED"}
    assert set(facts["environment"]) == known | (os.environ.keys() & set(NUMERIC_ENV_VARS))
    assert facts["here"] == "/submission"
    assert "proc" not in facts["root"]
    assert "etc" not in facts["root"]
    assert "home" not in facts["root"] or Path(sys.base_prefix).is_relative_to("/home")
    assert not facts["processes"]
    assert facts["network"] == "ENETUNREACH"
    assert facts["loopback"] in ("ECONNREFUSED", "ENETUNREACH")
    for place in ("submission", "beside", "kit", "root folder"):
        assert facts[place] == "EROFS", place
    assert facts["scratch"] == "done"
    assert facts["much scratch"] == "ENOSPC"  # with the file that is there already
    assert facts["fork"] == "EAGAIN"
    assert facts["program"] == "EAGAIN"
    refused, capabilities, may_gain_no_rights = facts["rights"]
    assert set(refused) <= {"EPERM", "EINVAL"}, refused  # EINVAL: there is no such user here
    assert capabilities == [0] * 4
    assert may_gain_no_rights == 1
    assert facts["root again"] in ("EPERM", "EINVAL")
    assert facts["parent"] in ("EPERM", "done")  # its parent is the namespace's own first process, or there is none
    assert facts["more memory"] in ("EPERM", "ValueError")
    assert facts["open files"] == 5  # the three of every process, its line, and the socket that was tried
    assert (submission / "mine.py").read_text() == PROBE


@pytest.mark.slow
def test_sandbox_hides_the_grader_and_other_submissions(
    submission: Path, tmp_path: Path, fork_server: ForkServer | None
) -> None:
    secret = tmp_path / "secret.txt"
    secret.write_text("do not tell")
    secret.chmod(0o644)
    kit = Path(snr_sim.__file__).parent
    hidden = [
        str(secret),
        f"{tmp_path}/",
        str(Path(__file__)),
        f"{kit.parent}/tests/",
        f"{kit.parent}/assignments/",
        "/etc/passwd",
        "/proc/self/environ",
        "/sys/",
        "/var/",
    ]
    with Student(submission, "sandbox", fork_server=fork_server) as student:
        assert student.call("mine.py", "looks", hidden) == ["ENOENT"] * len(hidden)
        assert student.call("mine.py", "seen_under", "/submission") == ["/submission/mine.py"]
        assert not any("do not tell" in argument for argument in student.call("mine.py", "arguments"))


@pytest.mark.slow
def test_sandbox_hides_installed_labs(
    submission: Path, fork_server: ForkServer | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    kit = Path(snr_sim.__file__).parent
    monkeypatch.setattr(sandbox_module, "LABS", kit / "plants")  # as if these were the labs of an installed snr_sim
    with Student(submission, "sandbox", fork_server=fork_server) as student:
        assert student.call("mine.py", "looks", [f"{kit}/plants/__init__.py", f"{kit}/__init__.py"]) == [
            "ENOENT",
            "done",
        ]
        assert student.call("mine.py", "seen_under", f"{kit}/plants") == []


@pytest.mark.slow
def test_sandbox_drops_root_capabilities_at_start(
    submission: Path, fork_server: ForkServer | None, at_first: Callable[[str], None]
) -> None:
    if not is_root():
        pytest.skip("other users have no capabilities")
    at_first("import os; os.chroot('/')")
    with (
        Student(submission, "sandbox", fork_server=fork_server) as student,
        pytest.raises(GraderError, match="not permitted"),
    ):
        student.call("mine.py", "looks", [])


@pytest.mark.slow
def test_process_arguments_do_not_depend_on_the_case(submission: Path, fork_server: ForkServer | None) -> None:
    def arguments_after(n: int) -> list[str]:
        with Student(submission, "sandbox", fork_server=fork_server) as student:
            for _ in range(n):
                student.call("mine.py", "looks", [])
            arguments: list[str] = student.call("mine.py", "arguments")
            return [argument for argument in arguments if "main(" not in argument]

    assert arguments_after(0) == arguments_after(2)


@pytest.mark.slow
def test_endless_loop_that_ignores_signals_is_killed(submission: Path, fork_server: ForkServer | None) -> None:
    (submission / "mine.py").write_text(
        "import signal\n"
        "for number in (signal.SIGPROF, signal.SIGXCPU, signal.SIGTERM):\n"
        "    signal.signal(number, signal.SIG_IGN)\n"
        "while True:\n    pass\n"
    )
    student = Student(submission, "sandbox", limits=Limits(cpu_s=1), fork_server=fork_server)
    with student, pytest.raises(SubmissionError, match="used up its CPU time"):
        student.call("mine.py", "f")


@pytest.mark.slow
def test_program_with_closed_output_is_graded(submission: Path, fork_server: ForkServer | None) -> None:
    (submission / "mine.py").write_text(
        "import os, sys\nsys.stdout = None\nos.close(1)\nos.close(2)\ndef f():\n    return 1\n"
    )
    with Student(submission, "sandbox", fork_server=fork_server) as student:
        assert student.call("mine.py", "f") == 1


@pytest.mark.slow
def test_owner_only_submission_is_graded(submission: Path, tmp_path: Path) -> None:
    (submission / "mine.py").write_text("def f():\n    return 1\n")
    (submission / "mine.py").chmod(0o600)
    submission.chmod(0o700)
    lab = load_lab(_lab_in(tmp_path))
    assert grade_submission(lab, submission, b"secret").points == 100.0


@pytest.mark.slow
def test_closed_case_leaves_no_sandbox_process(submission: Path) -> None:
    before = _running("bwrap")
    with Student(submission, "sandbox") as student:
        student.call("mine.py", "looks", [])
        assert _running("bwrap") > before
    assert _running("bwrap") <= before


@pytest.mark.slow
def test_grading_without_bubblewrap_raises_and_names_the_package(
    submission: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lab = load_lab(_lab_in(tmp_path))
    monkeypatch.setattr(shutil, "which", lambda name: None)
    for cached in (find_bubblewrap, try_sandbox, find_isolation):
        cached.cache_clear()
    try:
        with pytest.raises(IsolationMissingError, match="apt install bubblewrap"):
            grade_submission(lab, submission, b"secret")
        assert grade_submission(lab, submission, b"secret", "none").isolation == "none"
    finally:
        monkeypatch.undo()
        for cached in (find_bubblewrap, try_sandbox, find_isolation):
            cached.cache_clear()


def test_bubblewrap_error_names_how_to_allow_namespaces(monkeypatch: pytest.MonkeyPatch) -> None:
    words = "bwrap: setting up uid map: Permission denied"
    for user, fix in ((1000, "kernel.apparmor_restrict_unprivileged_userns=0"), (0, "a container needs --privileged")):
        monkeypatch.setattr(os, "geteuid", lambda user=user: user)
        assert words in str(bubblewrap_error(words))
        assert fix in str(bubblewrap_error(words))
    assert "readable by all users" in str(bubblewrap_error("ModuleNotFoundError: No module named 'snr_sim'"))
    assert "0.5 or newer" in str(bubblewrap_error("bwrap: Unknown option --perms"))


@pytest.mark.slow
def test_missing_seccomp_raises_isolation_missing(
    at_first: Callable[[str], None],
) -> None:
    at_first("from snr_sim.grading.sandbox import seccomp; seccomp.COLUMN = {}")
    with pytest.raises(
        IsolationMissingError,
        match="filters, which are not available here: seccomp: the system calls of the processor",
    ) as refused:
        try_sandbox.__wrapped__()
    assert "x86-64 or aarch64" in refused.value.fix


def test_root_without_mount_and_landlock_raises_both_reasons(monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither isolation is possible: the error has both reasons, and a fix for each."""

    def no_landlock(*_: object) -> None:
        raise confinement_error(
            "Traceback\n  ...\nsnr_sim.grading.sandbox.confinement.LandlockMissingError: Landlock: Function missing"
        )

    def no_namespaces() -> None:
        raise bubblewrap_error("bwrap: Creating new namespace failed: Operation not permitted")

    monkeypatch.setattr(isolation, "try_sandbox", no_namespaces)
    monkeypatch.setattr(isolation, "is_root_without_mount", lambda: True)
    monkeypatch.setattr(isolation, "try_confinement", no_landlock)
    find_isolation.cache_clear()
    try:
        with pytest.raises(
            IsolationMissingError, match=r"Creating new namespace failed.*Landlock: Function"
        ) as refused:
            find_isolation()
        assert "--privileged" in refused.value.fix
        assert "Linux 5.13" in refused.value.fix
        monkeypatch.setattr(
            isolation, "is_root_without_mount", lambda: False
        )  # it may mount: then bubblewrap needs the fix
        with pytest.raises(IsolationMissingError, match="Creating new namespace failed") as refused:
            find_isolation()
        assert "Landlock" not in str(refused.value)
    finally:
        find_isolation.cache_clear()


def test_confinement_without_setuid_capability_raises(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(isolation, "missing_capabilities", lambda: ["CAP_SETUID"])
    with pytest.raises(IsolationMissingError, match="CAP_SETUID"):
        try_confinement()


def _lab_in(folder: Path) -> Path:
    path = folder / "01_small" / "checks.py"
    path.parent.mkdir()
    path.write_text(
        "from snr_sim.grading import Lab, check, passed\n\n\n"
        "@check(points=100)\n"
        "def one(student):\n"
        '    """It is one."""\n'
        '    assert student.call("mine.py", "f") == 1\n'
        "    return passed()\n\n\n"
        'lab = Lab("Small", files=["mine.py"], checks=[one])\n'
    )
    return path


def _running(name: str) -> int:
    """How many processes of that name this one has started, directly or not."""
    parents = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            pid, _, rest = stat.read_text().partition(" (")
        except OSError:
            continue  # it has just ended
        command, _, numbers = rest.rpartition(") ")
        parents[int(pid)] = (int(numbers.split()[1]), command)

    def is_ours(pid: int) -> bool:
        return pid == os.getpid() or (pid in parents and is_ours(parents[pid][0]))

    return sum(command == name and is_ours(pid) for pid, (_, command) in parents.items())
