"""A class of sixty: right and wrong programs, attacks, and files that are not programs. Each gets exactly its points.

Attacks (attacks/README.md) get no points, leave nothing behind, and do not affect other submissions.
"""

import csv
import ctypes
import json
import os
import pickle
import random
import shutil
import subprocess
import sys
import time
import zipfile
from collections.abc import Sequence
from pathlib import Path

import pytest

from tests.assignments.mistakes import mistakes_of, write_solution, write_starter

ATTACKS = sorted((Path(__file__).parent / "attacks").glob("*.py"))
TOKEN = f"snr_attack_{os.getpid()}"
# Submissions without the required part get no points; these do something that is right as well.
HONEST_PART = {"visible_only": 70.0}
PR_SET_CHILD_SUBREAPER = 36


WRONG = {  # of each kind two, with their points: 40 for loading, 30 for a visible and a hidden case
    "return 2": 40.0,
    "return {1: 2, 2: 4, 4: 8}.get(x, 0)": 70.0,
    "return 2.0 * x": 40.0,
    "return x + x if x < 9 else x": 70.0,
    "return str(2 * x)": 0.0,
    "return x * 3": 0.0,
    "print(2 * x)": 0.0,
    "return 1 / 0": 0.0,
}
RIGHT = ("return 2 * x", "return x + x", "return x << 1", "return sum([x, x])")


LAB_TEN = "10_lunar_lander_q"
REFERENCE = Path(__file__).parents[1] / "assignments" / "lunar_lander_q" / "reference"
# What an attack on the lab of numbers is as a lander: whatever it does, it does in each of the five functions.
AS_LANDER = """

ACTIONS, STATES = 4, 63


def encode(altitude_m, velocity_mps):
    return double(int(altitude_m))


def choose(table, state, epsilon, rng):
    return double(state)


def update(table, step):
    double(step.state)


def reward(*all):
    return double(1)


def epsilon(share):
    return double(1)
"""


def hand_in(folder: Path, port: int) -> dict[Path, float | None]:
    """Write the submissions; return each with its expected points, None if it has nothing to grade."""
    due: dict[Path, float | None] = {}
    for i in range(7):
        due[write(folder / f"right_{i}", RIGHT[i % len(RIGHT)])] = 100.0
    for i, (body, points) in enumerate([*WRONG.items()] * 2):
        due[write(folder / f"wrong_{i}", body)] = points
    for attack in ATTACKS:
        path = folder / attack.stem
        path.mkdir()
        shutil.copy(attack, path / "double.py")
        (path / "token.txt").write_text(TOKEN)
        (path / "port.txt").write_text(str(port))
        due[path] = HONEST_PART.get(attack.stem, 0.0)
    shadow = write(folder / "shadows_the_kit", "return None")
    for name in ("msgspec.py", "json.py", "sitecustomize.py", "usercustomize.py", "snr_sim.py", "os.py", "signal.py"):
        (shadow / name).write_text(f"import sys\nprint('loaded {name}')\nsys.exit(0)\n")
    due[shadow] = 0.0
    due[write(folder / "misspelt", "return 2 * x", "duoble.py")] = None
    due[write(folder / "elsewhere", "return 2 * x", "essay/text.py")] = None
    for i in range(3):
        (folder / f"empty_{i}").mkdir()
        due[folder / f"empty_{i}"] = None
    link = folder / "is_a_link"
    link.mkdir()
    (link / "double.py").symlink_to(folder / "right_0" / "double.py")
    due[link] = None
    for name, entries in (("leads_outside", ["double.py", f"../../{TOKEN}"]), ("zipped", ["work/double.py"])):
        with zipfile.ZipFile(folder / f"{name}.zip", "w") as archive:
            for entry in entries:
                archive.writestr(entry, "def double(x):\n    return 2 * x\n")
        due[folder / f"{name}.zip"] = 100.0 if name == "zipped" else None
    (folder / "no_archive.zip").write_bytes(b"Dear professor,")
    due[folder / "no_archive.zip"] = None
    everybody = list(due)
    random.Random(6).shuffle(everybody)
    return {path: due[path] for path in everybody}


def hand_in_lab_ten(folder: Path, port: int) -> dict[str, dict[Path, float | None]]:
    """Returns submissions to lab 10 by kind, as `hand_in` returns them; the first of each kind is a quick one."""

    def submission(name: str, mistake: str = "") -> Path:
        return write_solution(LAB_TEN, folder / name, mistake, starter=False)

    right: dict[Path, float | None] = {submission("reference"): 100.0, submission("untrained"): 95.0}
    (folder / "untrained" / "policy.npz").unlink()  # the table that the grader trains is used instead
    with zipfile.ZipFile(folder / "zipped.zip", "w") as archive:
        for file in REFERENCE.iterdir():
            if file.is_file():
                archive.write(file, f"work/{file.name}")
    right[folder / "zipped.zip"] = 100.0
    wrong: dict[Path, float | None] = {
        submission(name, name): round(100.0 - sum(mistake.lost.values()), 2)
        for name, mistake in mistakes_of(LAB_TEN).items()
    }
    for name, data in (("pickled", pickle.dumps([[0.0] * 4] * 63)), ("cut", b"PK\3\4")):
        wrong[submission(name)] = 60.0  # policy_file, lands and is_sturdy are about the table
        (folder / name / "policy.npz").write_bytes(data)
    attacks: dict[Path, float | None] = {}
    for attack in sorted(ATTACKS, key=lambda path: (path.stem != "writes_results", path)):
        path = folder / f"attack_{attack.stem}"
        path.mkdir()
        (path / "q_lander.py").write_text(attack.read_text().replace("double.py", "q_lander.py") + AS_LANDER)
        (path / "token.txt").write_text(TOKEN)
        (path / "port.txt").write_text(str(port))
        attacks[path] = 0.0
    none: dict[Path, float | None] = {}
    for name in ("empty", "misspelt", "is_a_link"):
        (folder / name).mkdir()
        none[folder / name] = None
    shutil.copy(REFERENCE / "q_lander.py", folder / "misspelt" / "q_landr.py")
    (folder / "is_a_link" / "q_lander.py").symlink_to(folder / "reference" / "q_lander.py")
    (folder / "no_archive.zip").write_bytes(b"Dear professor,")
    none[folder / "no_archive.zip"] = None
    none[write_starter(LAB_TEN, folder / "starter")] = 0.0
    return {"right": right, "wrong": wrong, "attacks": attacks, "no program": none}


def write(folder: Path, body: str, name: str = "double.py") -> Path:
    path = folder / name
    path.parent.mkdir(parents=True)
    path.write_text(f"def double(x):\n    {body}\n")
    return folder


def children() -> set[int]:
    """Return the ids of this process' children."""
    found = set()
    for task in Path("/proc/self/task").iterdir():
        found |= {int(pid) for pid in (task / "children").read_text().split()}
    return found


def still_alive(before: set[int]) -> set[int]:
    """Reap ended processes; return those that started since and do not end."""
    give_up_s = time.monotonic() + 60
    while (left := children() - before) and time.monotonic() < give_up_s:
        for pid in left:
            os.waitpid(pid, os.WNOHANG)
        time.sleep(0.01)
    return left


def left_behind() -> list[str]:
    places = ("/dev/shm", "/tmp", "/var/tmp", "/run", "/dev/mqueue", "/etc", str(Path.home()))
    return [str(path) for place in places if Path(place).is_dir() for path in Path(place).glob(f"*{TOKEN}*")]


def grade_class(
    lab: str,
    due: dict[Path, float | None],
    reached: list[str],
    tmp_path: Path,
    private: Path,
    jobs: int,
    isolation: str = "sandbox",
    prefix: Sequence[str] = (),
) -> None:
    """Grade a class; all points are as expected and nothing is left behind."""
    (tmp_path / "the_secret").write_text("correct horse battery staple")
    before, kit = children(), kit_files()
    ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 1)  # orphans become children of this process, which sees them
    words = ["grade", lab, *map(str, due), "--out", str(tmp_path / "out"), "--jobs", str(jobs)]
    done = subprocess.run(
        [*prefix, sys.executable, "-m", "snr_sim", *words, "--secret", str(tmp_path / "the_secret")],
        capture_output=True,
        text=True,
        env={**os.environ, "TMPDIR": str(private)},
    )
    ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 0)
    assert done.returncode == 0, done.stderr + done.stdout
    with (tmp_path / "out" / "class.csv").open(newline="") as file:
        rows = {row["submission"]: row for row in csv.DictReader(file)}
    table = {name: (float(row["points"]), row["status"]) for name, row in rows.items()}
    expected = {path.stem: (points or 0.0, "rejected" if points is None else "graded") for path, points in due.items()}
    assert table == expected
    assert {row["isolation"] for row in rows.values() if row["status"] == "graded"} <= {isolation}
    for path in (tmp_path / "out" / "results").iterdir():
        assert "AssertionError" not in path.read_text(), f"{path.stem} has not acted at all"
    assert reached == []
    assert still_alive(before) == set()
    assert list(private.iterdir()) == []
    assert left_behind() == []
    assert kit_files() == kit


@pytest.mark.slow
@pytest.mark.parametrize("isolation", ["sandbox", pytest.param("confined", marks=pytest.mark.nightly)])
def test_class_of_sixty_gets_exact_points(
    isolation: str,
    request: pytest.FixtureRequest,
    double_lab: Path,
    listener: tuple[int, list[str]],
    tmp_path: Path,
    open_folder: Path,
) -> None:
    prefix = request.getfixturevalue("docker") if isolation == "confined" else request.getfixturevalue("sandbox") or []
    port, reached = listener
    (tmp_path / "submissions").mkdir()
    due = hand_in(tmp_path / "submissions", port)
    assert len(due) == 60
    grade_class(str(double_lab), due, reached, tmp_path, open_folder, 6, isolation, prefix)


def test_class_of_lab_ten_contains_every_mistake(tmp_path: Path) -> None:
    (tmp_path / "submissions").mkdir()
    wrong = hand_in_lab_ten(tmp_path / "submissions", port=0)["wrong"]
    assert {path.name for path in wrong} == {*mistakes_of(LAB_TEN), "pickled", "cut"}
    assert 72.34 in wrong.values()  # trained_on_the_test: the visible case of `lands` and little of `is_sturdy`


@pytest.mark.slow
@pytest.mark.parametrize(
    "is_whole", [False, pytest.param(True, marks=pytest.mark.nightly(minutes=7))], ids=["one", "all"]
)
@pytest.mark.parametrize("kind", ["right", "wrong", "attacks", "no program"])
def test_class_of_lab_ten_gets_exact_points(
    kind: str, is_whole: bool, sandbox: None, listener: tuple[int, list[str]], tmp_path: Path, open_folder: Path
) -> None:
    """Of each kind one; in nightly all, which takes minutes: one attack is busy for ten seconds in each case."""
    port, reached = listener
    (tmp_path / "submissions").mkdir()
    kinds = hand_in_lab_ten(tmp_path / "submissions", port)
    due = kinds[kind] if is_whole else dict([*kinds[kind].items()][:1])
    grade_class("lunar_lander_q", due, reached, tmp_path, open_folder, jobs=3)


@pytest.mark.nightly
def test_sandboxed_points_equal_those_of_the_lab_tests(sandbox: None, tmp_path: Path) -> None:
    lab, submissions = "09_debug_by_replay", tmp_path / "submissions"
    due = {"reference": 100.0, "not_toml": 100.0 - sum(mistakes_of(lab)["not_toml"].lost.values())}
    given = [
        write_solution(lab, submissions / "reference", starter=False),
        write_solution(lab, submissions / "not_toml", "not_toml", starter=False),
    ]
    words = ["grade", "debug_by_replay", *map(str, given), "--out", str(tmp_path / "out")]
    done = subprocess.run([sys.executable, "-m", "snr_sim", *words, "--json"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert {one["submission"]: one["points"] for one in json.loads(done.stdout)["submissions"]} == due


def kit_files() -> set[tuple[str, float]]:
    """Return the files of snr_sim with the times of their last change."""
    import snr_sim

    folder = Path(snr_sim.__file__).parent
    return {(str(path), path.stat().st_mtime) for path in folder.rglob("*.py")}
