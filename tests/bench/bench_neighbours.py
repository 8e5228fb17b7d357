"""Neighbours: whether an attacking program slows down the grading of another submission at the same time.

An honest controller's flights are graded, one after the other. Concurrently, in another process on another core, as
the workers of `snr grade` run, each program of tests/grading/attacks is graded, in short turns with an honest program
of the same lab. The result is the ratio of the wall times of a flight's grading: during the attack, to that during the
honest program just before or after. The median of all such pairs of turns counts, since a computer's speed varies by a
fifth within minutes. An attack with a high ratio gets more turns, and all of its pairs count. Without the limit that
stops `takes_another_core`, a flight takes twice as long. The computer needs at least two cores and must be otherwise
idle.

Run by `snr bench neighbours`. The whole measurement takes a quarter of an hour; progress goes to stderr.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import mean, median

from harness import Outcome, Row, Skipped

from snr_sim.grading.grade import grade_submission, resolve_isolation
from snr_sim.grading.lab.lab import load_lab
from snr_sim.grading.remote.fork_server import ForkServer
from snr_sim.grading.sandbox.sandbox import Limits

TESTS = Path(__file__).resolve().parents[1]
ATTACKS, LABS = TESTS / "grading" / "attacks", TESTS / "grading" / "labs"
DOUBLE, LANDING = LABS / "01_double" / "checks.py", LABS / "02_landing" / "checks.py"
DOUBLES = "def double(x):\n    return 2 * x\n"
LANDS = (TESTS.parent / "robots" / "lander" / "controllers" / "optimal.py").read_text()
FALLING = ATTACKS / "in_flight" / "falling.py"  # what those in flight have in common
SECRET = b"of the benchmark, which everybody may know"
QUICK = ("busy", "takes_another_core")
ROUNDS, MORE_ROUNDS, FLIGHTS = 7, 28, 3
QUICK_ROUNDS = 2  # and no more, however bad an attack seems: it is to see that it works
SEEMS_BAD = 1.05
MAX_RATIO = 1.1


def measure(is_quick: bool) -> Iterator[Outcome]:
    """Yield a row for the attack that is the worst neighbour, and one for all of them."""
    if len(os.sched_getaffinity(0)) < 2:
        yield Skipped("neighbours", "each of the two programs needs a core of its own, and there is one")
        return
    attacks = sorted({*ATTACKS.glob("*.py"), *(ATTACKS / "in_flight").glob("*.py")} - {FALLING})
    if is_quick:
        attacks = [attack for attack in attacks if attack.stem in QUICK]
    core, other = sorted(os.sched_getaffinity(0))[:2]
    os.sched_setaffinity(0, {core})
    ratios: dict[str, float] = {}
    alike_s: list[float] = []
    with tempfile.TemporaryDirectory() as name, graded_beside(Path(name), other) as beside:
        Path(name).chmod(0o755)
        honest = {lab: handed_in(Path(name) / lab.parent.name, lab) for lab in (DOUBLE, LANDING)}
        lab, fork_server = load_lab(LANDING), ForkServer(resolve_isolation("required"), Limits())

        def took_s(other_lab: Path, folder: Path) -> float:
            beside(f"{other_lab} {folder}")
            start_s = time.perf_counter()
            for _ in range(FLIGHTS):
                assert grade_submission(lab, honest[LANDING], SECRET, fork_server=fork_server).points == 100.0
            return (time.perf_counter() - start_s) / FLIGHTS

        with fork_server:
            took_s(LANDING, honest[LANDING])
            for attack in attacks:
                at = LANDING if attack.parent.name == "in_flight" else DOUBLE
                folder = handed_in(Path(name) / attack.stem, at, attack.read_text())
                pairs: list[float] = []
                rounds, max_pairs = (QUICK_ROUNDS, QUICK_ROUNDS) if is_quick else (ROUNDS, MORE_ROUNDS)
                while len(pairs) < rounds or (len(pairs) < max_pairs and median(pairs) > SEEMS_BAD):
                    turns = [honest[at], folder] if len(pairs) % 2 else [folder, honest[at]]
                    took = {turn: took_s(at, turn) for turn in turns}
                    pairs.append(took[folder] / took[honest[at]])
                    alike_s.append(took[honest[at]])
                ratios[attack.stem] = median(pairs)
                each = " ".join(f"{pair:.2f}" for pair in pairs)
                print(f"{attack.stem}: {ratios[attack.stem]:.2f} ({each})", file=sys.stderr, flush=True)
    worst = max(ratios, key=lambda attack: ratios[attack])
    for title, ratio in ((f"next to the worst, {worst}", ratios[worst]), ("next to any", mean(ratios.values()))):
        yield Row(
            f"{title}: a flight is graded",
            ratio * median(alike_s),
            "s",
            baseline=median(alike_s),
            compared_to="next to an honest one",
            ratio=ratio,
            ratio_limit=MAX_RATIO,
            note=f"wall time; {len(ratios)} programs, each graded again and again on another core",
        )


def handed_in(folder: Path, lab: Path, program: str = "") -> Path:
    """Return a submission to a small lab, an honest one unless a program is given."""
    folder.mkdir()
    if lab == DOUBLE:
        (folder / "double.py").write_text(program or DOUBLES)
        (folder / "token.txt").write_text("snr_attack_of_the_benchmark")
        (folder / "port.txt").write_text("9")
    else:
        (folder / "pilot.py").write_text(program or LANDS)
        shutil.copy(FALLING, folder)
    return folder


@contextmanager
def graded_beside(place: Path, core: int) -> Iterator[Callable[[str], None]]:
    """Yield what has a submission graded in another process, again and again, and return when that has begun."""
    words = [sys.executable, __file__, "--beside", str(core)]
    with tempfile.TemporaryDirectory(dir=place) as scratch:
        Path(scratch).chmod(0o755)
        with subprocess.Popen(
            words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env={**os.environ, "TMPDIR": scratch}
        ) as process:
            assert process.stdin is not None
            assert process.stdout is not None

            def beside(which: str) -> None:
                process.stdin.write(which + "\n")
                process.stdin.flush()
                if process.stdout.readline() != which + "\n":
                    raise SystemExit("The process beside has ended; see what it printed.")

            try:
                yield beside
            finally:
                process.kill()


def grade_what_is_asked(core: int) -> None:
    """Grade the submission that was requested last, again and again, until the parent process is gone."""
    os.sched_setaffinity(0, {core})
    asked: list[str] = []
    is_asked = threading.Event()

    def listen() -> None:
        for line in sys.stdin:
            asked.append(line.strip())
            is_asked.set()
        os._exit(0)

    threading.Thread(target=listen, daemon=True).start()
    is_asked.wait()
    labs = {str(path): load_lab(path) for path in (DOUBLE, LANDING)}
    with ForkServer(resolve_isolation("required"), Limits()) as fork_server:
        reported = 0
        while True:
            if reported < len(asked):
                reported, which = len(asked), asked[-1]
                print(which, flush=True)
            lab, folder = which.split(" ", 1)
            grade_submission(labs[lab], Path(folder), SECRET, fork_server=fork_server)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--beside"]:
        grade_what_is_asked(int(sys.argv[2]))
