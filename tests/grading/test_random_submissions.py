"""Random folders and archives through the whole of `snr grade`, beside an honest one, which gets all its points.

Trees with links, pipes, sockets, devices, odd names, huge and sparse files, some changing while they are read; with
random text in each file that a grader reads.
"""

from __future__ import annotations

import csv
import itertools
import math
import os
import random
import signal
import stat
import subprocess
import sys
import threading
import zipfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest

from snr_sim.grading.batch.submission_import import remove
from snr_sim.learning.batch_training import ENVIRONMENT
from snr_sim.learning.discretiser import Discretiser
from snr_sim.learning.q_table import QTable
from snr_sim.scenario.machine_edits import TABLE
from tests.fuzz_parsers import mutated

ROOT = Path(__file__).parents[2]
LAB = Path(__file__).parent / "labs" / "03_texts"
PRIVATE_TEXT = b"this is in no submission"
OF_THIS_COMPUTER = ("/etc/passwd", "/dev/zero")
SUBMISSIONS = 8  # of a class, and an honest one
MAX_CPU_S = 5.0  # for one submission on average, with the start of the workers; 0.6 were measured
MAX_MEMORY_KIB = 300_000  # of any process; 123 000 were measured
MAX_WALL_S = 600.0  # of a class: a hang is an error
RIGHT = b"def double(x):\n    return 2 * x\n"
PROGRAMS = [
    RIGHT,
    b"import helper\nfrom parts import a, b\n\ndef double(x):\n    return helper.twice(x)\n",
    b"def double(x):\n    print('\\x1b[2J', '\\udcff', 'x' * 5000)\n    return [x, {'a': float('nan')}, None]\n",
    b"def double(x):\n    raise ValueError('\\ud800' + 'e' * 9999)\n",
    b"class A(dict):\n    pass\n\ndef double(x):\n    return A(x=x, y=1 << 4000)\n",
    b"def double(x):\n    return double(x)\n",
    b"try:\n    import " + b"m" * 300 + b"\nexcept ImportError:\n    pass\n\ndef double(x):\n    return 42\n",
]
NAMES = [
    *(b"\xff\xfe.py", b"a\nb", "\u202egpj.py".encode(), b"C:x", b"..\\x", b"a\\b.py", b"CON", b"n" * 255, b"-rf", b" "),
    *("\u00e9.py".encode(), "e\u0301.py".encode(), b"DOUBLE.py", b"double.py~", b".hidden", b"trace.jsonl"),
    *(
        b"double",
        b"helper.py",
        b"__pycache__",
        b"venv",
        b"...",
        b"a.zip",
        b"\xf0\x9f\x90\x9f",
        b"results.json",
        b"$(x)",
    ),
]


def seeds_of_texts(folder: Path) -> dict[str, list[bytes]]:
    """Return valid texts of each kind that a grader reads, by the name of the file."""
    table = folder / "policy.npz"
    grid = Discretiser(("altitude_m", "velocity_mps"), ((1.0, 2.0), (0.0,)))
    QTable(grid, [str(i) for i in range(4)], environment=ENVIRONMENT).save(table)
    labs = ROOT / "assignments"
    programs = [path.read_bytes() for path in sorted((ROOT / "robots/dora/controllers").glob("*.lrp"))]
    edits = b'scenario = "dora_corners"\nseed = 0\nat_s = [1.0]\nchanges = "0"\n'
    lines = b'{"$":"trace","version":1}\n{"kind":"input","type":"store_page","name":"depth"}\n'
    return {
        "findings.toml": [(labs / "09_debug_by_replay/starter/findings.toml").read_bytes()],
        "answers.md": [(labs / "08_sim_to_pi/starter/answers.md").read_bytes()],
        "policy.npz": [table.read_bytes(), b"\x80\x04pickle"],
        "dora.lrp": [*programs, b'(import "other.lrp") (actions "act.py")'],
        f"edits/{TABLE}": [edits],
        "edits/0.lrp": programs,
        "edits/1.lrp": programs,
        "other.lrp": programs,
        "run/pages.jsonl": [lines],
        "double.py": PROGRAMS,
        "helper.py": [b"def twice(x):\n    return 2 * x\n", b"import double\n"],
    }


def write_new(path: Path, data: bytes) -> None:
    """Write a file that is not there yet: a link there would lead to one of this computer, and a pipe would block."""
    with path.open("xb") as file:
        file.write(data)


def change(path: Path, do: Callable[[int], object], flags: int = os.O_RDWR) -> None:
    """Call a function with the descriptor of a file, but not of one that a link leads to."""
    descriptor = os.open(path, flags | os.O_NOFOLLOW | os.O_NONBLOCK)
    try:
        do(descriptor)
    finally:
        os.close(descriptor)


class RandomTree:
    """A folder of a submission, filled at random; links lead to `outside` and to files of this computer.

    So that these are not changed, nothing is written or closed through a link.
    """

    def __init__(self, folder: Path, outside: Path, rng: random.Random, texts: dict[str, list[bytes]]) -> None:
        self.folder = folder
        self._outside, self._rng, self._texts = outside, rng, texts
        self._folders = [folder]
        folder.mkdir()

    def fill(self) -> None:
        """Write the texts, some of them damaged, and up to 12 odd things."""
        for name in self._texts:
            if self._rng.random() < 0.7:
                (self.folder / name).parent.mkdir(exist_ok=True)
                (self.folder / name).write_bytes(self._text(name))
        kinds = [self._link, self._node, self._hard_link, self._deep, self._wide, self._named, self._named]
        kinds += [self._sparse, self._closed, self._twin, self._archive]
        for kind in self._rng.choices(kinds, k=self._rng.choice((0, 1, 2, 3, 12))):
            with suppress(OSError):  # a name is taken, or this system or user may not
                kind()

    def _text(self, name: str) -> bytes:
        limit = self._rng.choice((1000, 16_000, 60_000))
        return mutated(self._rng, self._texts[name], limit) if self._rng.random() < 0.6 else self._texts[name][0]

    def _new(self) -> Path:
        top = [name for name in self._texts if "/" not in name]
        name = self._rng.choice([*map(os.fsdecode, NAMES), *top, f"f{self._rng.randrange(100)}"])
        path = self._rng.choice(self._folders) / name
        if self._rng.random() < 0.3:
            with suppress(OSError):
                path.unlink()
        return path

    def _link(self) -> None:
        path = self._new()
        to = [self._outside / "private", self._outside, *OF_THIS_COMPUTER, "/proc/self/mem", "nowhere"]
        path.symlink_to(self._rng.choice([*to, ".", "..", path, "double.py"]))

    def _node(self) -> None:
        kind = self._rng.choice((stat.S_IFIFO, stat.S_IFSOCK, stat.S_IFCHR, stat.S_IFBLK))
        os.mknod(self._new(), kind | 0o666, os.makedev(1, 5))  # as a character device, zeros without an end

    def _hard_link(self) -> None:
        self._new().hardlink_to(self.folder / "double.py")

    def _deep(self) -> None:
        path = self._rng.choice(self._folders)
        for _ in range(self._rng.choice((3, 9, 60))):
            path /= self._rng.choice(("d", "d" * 200))
            path.mkdir()
            self._folders.append(path)
        write_new(path / "double.py", RIGHT)

    def _wide(self) -> None:
        folder = self._new()
        folder.mkdir()
        is_folders = self._rng.random() < 0.3
        for number in range(self._rng.choice((20, 400, 1200))):
            path = folder / f"{self._rng.choice(('w', '.w'))}{number}"
            path.mkdir() if is_folders else path.touch()

    def _named(self) -> None:
        path = self._new()
        if self._rng.random() < 0.3:
            path.mkdir()
            self._folders.append(path)
        else:
            write_new(path, self._rng.randbytes(self._rng.choice((0, 10, 100_000))))

    def _sparse(self) -> None:
        with self._new().open("xb") as file:
            file.truncate(self._rng.choice((1 << 20, 40 << 20, 1 << 36)))

    def _closed(self) -> None:
        for path in self._folders[1:2] or [self.folder / "helper.py"]:
            change(path, lambda descriptor: os.fchmod(descriptor, 0), os.O_RDONLY)

    def _twin(self) -> None:
        name = self._rng.choice(("Double.py", "DOUBLE.PY", "Helper.py", "\uff44ouble.py"))
        write_new(self.folder / name, RIGHT)

    def _archive(self) -> None:
        with zipfile.ZipFile(self._new(), "x") as archive:
            archive.writestr("double.py", RIGHT)


def keep_changing(folder: Path, outside: Path, is_over: threading.Event) -> None:
    """Replace, shorten, lengthen and remove what is in a submission, and make links of it, until it is over."""
    file, part, aside = folder / "double.py", folder / "edits", folder / "aside"
    steps: list[Callable[[], object]] = [
        lambda: part.rename(aside),
        lambda: part.symlink_to(outside),
        part.unlink,
        lambda: aside.rename(part),
        lambda: change(file, lambda descriptor: os.truncate(descriptor, 5)),
        lambda: change(file, lambda descriptor: os.pwrite(descriptor, RIGHT + b"#" * 200_000, 0)),
        file.unlink,
        lambda: file.symlink_to(outside / "private"),
        file.unlink,
        lambda: os.mkfifo(file),
        file.unlink,
        lambda: write_new(file, RIGHT),
    ]
    for step in itertools.cycle(steps):
        if is_over.wait(0.0001):
            return
        with suppress(OSError):
            step()


def times_of_changes() -> list[int]:
    """Return when the files of this computer to which links lead were last changed."""
    return [Path(path).stat().st_ctime_ns for path in OF_THIS_COMPUTER]


def files_in(folder: Path) -> dict[str, tuple[int, int, bytes]]:
    """Return mode, size and what is read cheaply of everything in a folder; links and pipes are not opened."""
    found = {}
    for path in sorted(folder.rglob("*")):
        about = path.lstat()
        data = path.read_bytes() if stat.S_ISREG(about.st_mode) and about.st_size < 1 << 20 else b""
        found[str(path)] = about.st_mode, about.st_size, data
    return found


def check_class(folder: Path, seed: int) -> list[dict[str, str]]:
    """Grade a class of random submissions of a seed, check what holds for any, and return its table."""
    rng = random.Random(seed)
    given, outside, private, honest = folder / "given", folder / "outside", folder / "tmp", folder / "given" / "honest"
    for one in (outside, private, honest / "edits", honest / "run"):
        one.mkdir(parents=True)
    (outside / "private").write_bytes(PRIVATE_TEXT)
    (outside / "0.lrp").write_bytes(PRIVATE_TEXT)
    texts, changed_ns = seeds_of_texts(folder), times_of_changes()
    for name, (right, *_) in texts.items():
        (honest / name).write_bytes(right)
    trees = [RandomTree(given / f"s{i}", outside, rng, texts) for i in range(SUBMISSIONS)]
    for tree in trees:
        tree.fill()
    still = [*(tree.folder for tree in trees[:-1]), honest, outside]
    before = [files_in(one) for one in still]
    is_over = threading.Event()
    changing = threading.Thread(target=keep_changing, args=(trees[-1].folder, outside, is_over))
    changing.start()
    try:
        status, errors, cpu_s, memory_kib = grade(folder, sorted(given.iterdir()))
    finally:
        is_over.set()
        changing.join()
    assert "Traceback" not in errors, errors
    assert status in (0, 1), errors
    with (folder / "out" / "class.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["submission"] for row in rows] == ["honest", *(f"s{i}" for i in range(SUBMISSIONS))]
    assert {row["status"] for row in rows} <= {"graded", "rejected"}, [row["error"] for row in rows]
    assert (rows[0]["status"], rows[0]["points"], status) == ("graded", "100", 0), errors
    assert before == [files_in(one) for one in still]
    assert changed_ns == times_of_changes()
    assert list(private.iterdir()) == []
    assert {one.name for one in folder.iterdir()} <= {"given", "outside", "tmp", "out", "secret", "policy.npz"}
    for path, (_, _, data) in files_in(folder / "out").items():
        assert PRIVATE_TEXT not in data, path
    assert cpu_s < MAX_CPU_S * len(rows)
    assert memory_kib < MAX_MEMORY_KIB
    return rows


# Between pytest and `snr grade`: what the kernel says of a process's memory counts that of the one that forked it.
MEASURED = """
import resource, subprocess, sys
status = subprocess.call(sys.argv[1:], stdout=subprocess.DEVNULL)
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(used.ru_utime + used.ru_stime, used.ru_maxrss)
sys.exit(status)
"""


def grade(folder: Path, given: list[Path]) -> tuple[int, str, float, float]:
    """Return the exit status of `snr grade`, its stderr, and the CPU time and greatest memory of its processes."""
    (folder / "secret").write_text("correct horse battery staple")
    words = [sys.executable, "-m", "snr_sim", "grade", LAB, *given, "--out", folder / "out", "--isolation", "none"]
    environment = {**os.environ, "TMPDIR": str(folder / "tmp")}
    with (folder / "tmp.err").open("w+") as errors, (folder / "tmp.used").open("w+") as used:
        process = subprocess.Popen(
            [sys.executable, "-c", MEASURED, *map(str, words), "--secret", str(folder / "secret")],
            stdout=used, stderr=errors, env=environment, start_new_session=True,
        )  # fmt: skip
        killer = threading.Timer(MAX_WALL_S, os.killpg, (process.pid, signal.SIGKILL))
        killer.start()
        status = process.wait()
        killer.cancel()
        errors.seek(0)
        stderr = errors.read()
        used.seek(0)
        cpu_s, memory_kib = map(float, used.read().split() or (math.inf, math.inf))
    for name in ("tmp.err", "tmp.used"):
        (folder / name).unlink()
    return status, stderr, cpu_s, memory_kib


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="makes devices and names that are not text")
@pytest.mark.parametrize("seed", [0, 1])
def test_random_folders_are_graded_and_an_honest_one_gets_all_points(tmp_path: Path, seed: int) -> None:
    check_class(tmp_path, seed)


@pytest.mark.nightly(minutes=3)
@pytest.mark.skipif(sys.platform != "linux", reason="makes devices and names that are not text")
def test_classes_of_random_folders_are_graded_beside_an_honest_one(tmp_path: Path) -> None:
    for seed in range(2, 22):
        check_class(tmp_path / str(seed), seed)
        remove(tmp_path / str(seed))
