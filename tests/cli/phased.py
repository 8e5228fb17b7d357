"""Runs `snr` several times, each time with a signal when a function is entered, and prints how each run ended.

    python phased.py FOLDER <jobs.json

Reads a list of [PHASE, SIGNAL, WORD...]; PHASE is FILE:FUNCTION. Each job runs in a fork of this process, in a new
folder FOLDER/<number>: those whose phase is the import of a module first, while nothing of `snr` is imported here; then
all is imported once for the others. Prints a list with one object a job: status, out, err.
"""

import json
import os
import runpy
import signal
import sys
import traceback
from pathlib import Path
from types import FrameType
from typing import Any

GIVE_UP_S = 100


def run(folder: Path, phase: str, kind: str, words: list[str]) -> None:
    """Run `snr` in this process; it ends with the status of `snr`."""
    file, function = phase.split(":")

    def watch(frame: FrameType, event: str, argument: Any) -> None:
        code = frame.f_code
        if event == "call" and code.co_name == function and code.co_filename.endswith(file):
            sys.setprofile(None)
            os.kill(os.getpid(), getattr(signal, kind))

    os.chdir(folder)
    for name, descriptor in (("out", 1), ("err", 2)):
        os.dup2(os.open(name, os.O_WRONLY | os.O_CREAT), descriptor)
    signal.alarm(GIVE_UP_S)
    sys.argv = ["snr", *words]
    sys.setprofile(watch)
    status = 0
    try:
        runpy.run_module("snr_sim", run_name="__main__")
    except SystemExit as end:
        status = end.code if isinstance(end.code, int) else int(end.code is not None)
    except BaseException:
        traceback.print_exc()
        status = 1
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)


def main() -> None:
    """Run all jobs, one after the other."""
    place, jobs = Path(sys.argv[1]), json.load(sys.stdin)
    in_order = sorted(range(len(jobs)), key=lambda i: not jobs[i][0].endswith("<module>"))
    rows: dict[int, dict[str, Any]] = {}
    for i in in_order:
        phase, kind, *words = jobs[i]
        if not phase.endswith("<module>") and "snr_sim.cli.main" not in sys.modules:
            import snr_sim.cli.main
            import snr_sim.scenario.simulation
            import snr_sim.scenario.simulation_run  # noqa: F401
        folder = place / str(i)
        folder.mkdir()
        pid = os.fork()
        if pid == 0:
            run(folder, phase, kind, words)
        status = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
        out, err = ((folder / name).read_text() for name in ("out", "err"))
        rows[i] = {"status": status, "out": out, "err": err}
    print(json.dumps([rows[i] for i in range(len(jobs))]))


if __name__ == "__main__":
    main()
