"""Neighbours: whether a program that attacks makes the grading of another one slower, which goes on beside it.

An honest submission of a lab with flights is graded again and again, in this process. Beside it, in another one, each
program of tests/grading/attacks is, or in turns with it an honest program of the same small lab. What counts is wall
time beside the attack, in that beside the honest one; it wants a computer that does nothing else.

Run by `snr bench neighbours`, or by itself: python tests/bench/bench_neighbours.py [--quick] [--json]
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import mean

from harness import Row, report

from snr_sim.grading.grade import grade_submission
from snr_sim.grading.lab import find_lab, load_lab

TESTS = Path(__file__).resolve().parents[1]
ATTACKS = TESTS / "grading" / "attacks"
DOUBLE = TESTS / "grading" / "labs" / "01_double" / "checks.py"
QUICK = ("busy", "fills_memory")
HONEST = "def double(x):\n    return 2 * x\n"
LAB, REFERENCE = "moving_average", TESTS / "assignments" / "moving_average" / "reference"
SECRET = b"of the benchmark, which everybody may know"
ROUNDS, QUICK_ROUNDS = 2, 1
MOST = 1.1


def measure(is_quick: bool) -> Iterator[Row]:
    """Yields a row for the attack that is the worst neighbour, and one for all of them."""
    lab = find_lab(LAB)
    assert lab.folder is not None
    names = QUICK if is_quick else sorted(path.stem for path in ATTACKS.glob("*.py"))
    with tempfile.TemporaryDirectory() as name:
        own = Path(name) / "own"
        shutil.copytree(lab.folder / "starter", own)
        shutil.copytree(REFERENCE, own, dirs_exist_ok=True)
        honest = handed_in(Path(name) / "honest", HONEST)

        def took_s(beside: Path) -> float:
            with graded_beside(beside, Path(name)):
                start_s = time.perf_counter()
                assert grade_submission(lab, own, SECRET).points == 100.0
                return time.perf_counter() - start_s

        ratios: dict[str, float] = {}
        alike_s: list[float] = []
        took_s(honest)
        for attack in names:
            beside = handed_in(Path(name) / attack, (ATTACKS / f"{attack}.py").read_text())
            turns = [(took_s(honest), took_s(beside)) for _ in range(QUICK_ROUNDS if is_quick else ROUNDS)]
            ratios[attack] = mean(attacked_s / alike for alike, attacked_s in turns)
            alike_s += [alike for alike, _ in turns]
            print(f"{attack}: {ratios[attack]:.2f}", file=sys.stderr, flush=True)
    worst = max(ratios, key=lambda attack: ratios[attack])
    for title, ratio in ((f"beside the worst, {worst}", ratios[worst]), ("beside any", mean(ratios.values()))):
        yield Row(
            f"{title}: a submission of {LAB}",
            ratio * mean(alike_s),
            "s",
            baseline=mean(alike_s),
            compared_to="beside an honest one",
            ratio=ratio,
            ratio_limit=MOST,
            note=f"wall time; {len(ratios)} programs, each graded again and again in another process",
        )


def handed_in(folder: Path, program: str) -> Path:
    """Returns a submission to the small lab."""
    folder.mkdir()
    (folder / "double.py").write_text(program)
    (folder / "token.txt").write_text("snr_attack_of_the_benchmark")
    (folder / "port.txt").write_text("9")
    return folder


@contextmanager
def graded_beside(folder: Path, place: Path) -> Iterator[None]:
    """Has a submission graded in another process, again and again, from the first time on; with all it leaves there."""
    words = [sys.executable, __file__, "--beside", str(folder)]
    with tempfile.TemporaryDirectory(dir=place) as scratch:
        os.chmod(scratch, 0o755)
        with subprocess.Popen(words, stdout=subprocess.PIPE, env={**os.environ, "TMPDIR": scratch}) as process:
            assert process.stdout is not None
            process.stdout.readline()
            try:
                yield
            finally:
                process.kill()


def grade_again_and_again(folder: Path) -> None:
    """Never returns."""
    lab = load_lab(DOUBLE)
    grade_submission(lab, handed_in(Path(tempfile.mkdtemp()) / "first", HONEST), SECRET)
    print(flush=True)
    while True:
        grade_submission(lab, folder, SECRET)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--beside"]:
        grade_again_and_again(Path(sys.argv[2]))
    else:
        report(measure)
