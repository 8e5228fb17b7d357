"""Starts many runs, signals each at a random moment, and prints how they took it, as one JSON object.

A program of its own, as its children are: `python signalled.py COUNT SEED FOLDER CONTROLLER...`.
"""

import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

AT_ONCE = 4


def held_up(pid: int) -> float:
    """Return how long a process has waited for a core so far [s]; 0 where Linux does not report it."""
    try:
        return int(Path(f"/proc/{pid}/schedstat").read_text().split()[1]) * 1e-9
    except (OSError, IndexError):
        return 0.0


def main(count: int, seed: int, folder: Path, controllers: list[str]) -> None:
    chance = random.Random(seed)
    waiting = list(range(count))
    flying: list[tuple[int, subprocess.Popen[bytes], signal.Signals, float]] = []
    reports = []
    while waiting or flying:
        while waiting and len(flying) < AT_ONCE:
            number = waiting.pop()
            words = ["run", "lander_vertical", "--speed", "real", "--json", "--out", str(folder / str(number))]
            words += ["--controller", controllers[number % len(controllers)]]
            child = subprocess.Popen(
                [sys.executable, "-m", "snr_sim", *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE
            )
            while not list(folder.glob(f"{number}/*/trace.jsonl")):  # before that there is no run to end
                assert child.poll() is None, child.communicate()
                time.sleep(0.005)
            flying.append((number, child, chance.choice([signal.SIGINT, signal.SIGTERM]), chance.uniform(0.0, 0.6)))
            flying[-1] = (*flying[-1][:3], flying[-1][3] + time.monotonic())
        for one in list(flying):
            number, child, kind, due_s = one
            if time.monotonic() >= due_s:
                flying.remove(one)
                begun_s, held_up_s = time.monotonic(), held_up(child.pid)
                child.send_signal(kind)
                os.waitid(os.P_PID, child.pid, os.WEXITED | os.WNOWAIT)  # it has ended, and can still be asked
                wall_s = time.monotonic() - begun_s
                took_s = wall_s - (held_up(child.pid) - held_up_s)
                out, err = child.communicate()
                reports.append({
                    "number": number, "signal": kind.name, "took_s": took_s, "wall_s": wall_s,
                    "status": child.returncode, "out": out.decode(), "err": err.decode(),
                })  # fmt: skip
        time.sleep(0.005)
    print(json.dumps(reports))


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), Path(sys.argv[3]), sys.argv[4:])
