"""RoverProcesses for `bench_rover.py`: `python rover_processes.py idle|latency FOLDER`; and what they cost."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from statistics import median

from harness import Row
from peers import tcp_round_trips_s

from snr_sim.prelude.errors import RecordingError
from snr_sim.processes import ProcessRunner, RoverProcess
from snr_sim.supervision import Child, Health, Supervisor, Timeouts
from snr_sim.supervision.health import read_health

PROCESSES = 6
IDLE_LIMIT_PERCENT, LATENCY_LIMIT_MS = 2.0, 0.4
MESSAGES, PAUSE_S = 500, 0.005
PAYLOAD = b"0" * 120  # about as long as the message
START_LIMIT_S = 120.0
FILE_NAME = "latencies.txt"


class Idle(RoverProcess):
    """Does nothing, once a second."""


class Sends(RoverProcess):
    """Publishes the time."""

    def loop(self) -> float:
        self.publish("sent_ns", time.monotonic_ns())
        return PAUSE_S


class Receives(RoverProcess):
    """Writes how long messages took, and ends all."""

    def setup(self, args: dict[str, str]) -> None:
        self.path, self.taken_s = Path(args["folder"]) / FILE_NAME, list[float]()
        self.subscribe("sent_ns")

    def on_sent_ns(self, sent_ns: int) -> None:
        self.taken_s.append((time.monotonic_ns() - sent_ns) / 1e9)
        if len(self.taken_s) == MESSAGES:
            self.path.write_text("\n".join(map(str, self.taken_s)))
            self.terminate_state()


@contextmanager
def running(what: str, folder: str) -> Iterator[subprocess.Popen[bytes]]:
    """Run this file until the block ends."""
    command = [sys.executable, __file__, what, folder]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as program:
        try:
            yield program
        finally:
            program.send_signal(signal.SIGTERM)


def idle_cpu_percent(wall_s: float) -> tuple[float, float]:
    """Return the processor time of idle processes in percent of a core: without and with broker and supervisor."""
    with tempfile.TemporaryDirectory() as folder, running("idle", folder):
        health = until_running(Path(folder))
        pids = [part.pid for part in health.tree if part.name.startswith(Idle.__name__)]
        others = [health.supervisor_pid, *(part.pid for part in health.tree if part.pid not in pids)]
        time.sleep(1.0)  # connections are made
        before_s, begun_s = (cpu_s(pids), cpu_s(others)), time.monotonic()
        time.sleep(wall_s)
        share = 100.0 / (time.monotonic() - begun_s)
        own_s, others_s = cpu_s(pids) - before_s[0], cpu_s(others) - before_s[1]
        return share * own_s, share * (own_s + others_s)


def until_running(folder: Path) -> Health:
    """Return the health once all processes run."""
    give_up_s = time.monotonic() + START_LIMIT_S
    while time.monotonic() < give_up_s:
        with suppress(RecordingError):
            health = read_health(folder)
            if not health.is_degraded:
                return health
        time.sleep(0.05)
    raise TimeoutError("the processes do not start")


def cpu_s(pids: list[int | None]) -> float:
    """Return the processor time that processes have used."""
    fields = [Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split() for pid in pids if pid is not None]
    return sum(int(one[11]) + int(one[12]) for one in fields) / os.sysconf("SC_CLK_TCK")


def latencies_s() -> list[float]:
    """Return how long messages took from `publish` to the handler of another process."""
    with tempfile.TemporaryDirectory() as folder, running("latency", folder) as program:
        program.wait(START_LIMIT_S)
        return [float(line) for line in (Path(folder) / FILE_NAME).read_text().split()]


def measure(is_quick: bool) -> Iterator[Row]:
    """Yield the rows."""
    own, with_others = idle_cpu_percent(4.0 if is_quick else 20.0)
    yield Row(f"rover, {PROCESSES} idle processes", own, "% of a core", limit=IDLE_LIMIT_PERCENT)
    yield Row("rover, the same with their broker and supervisor", with_others, "% of a core")
    pairs = [(median(latencies_s()), median(tcp_round_trips_s(PAYLOAD, MESSAGES))) for _ in range(1 if is_quick else 5)]
    yield Row(
        "rover, from publish through the broker to a handler, median",
        1e3 * min(ours_s for ours_s, _ in pairs),
        "ms",
        limit=LATENCY_LIMIT_MS,
        baseline=1e3 * min(bare_s for _, bare_s in pairs),
        compared_to="there and back over bare TCP",
        ratio=median(ours_s / bare_s for ours_s, bare_s in pairs),
    )


def main(what: str, folder: str) -> None:
    """Run the processes."""
    kinds = [Idle.with_args(name=f"Idle{i}") for i in range(PROCESSES)]
    if what == "latency":
        kinds = [Sends.with_args(), Receives.with_args(folder=folder)]
    timeouts = Timeouts(setup_s=START_LIMIT_S)
    children = [Child(spec.name, "on_failure", timeouts) for spec in kinds]
    plan = Supervisor("root", [Child("state_manager", "on_failure", timeouts, ends_all=True), *children])
    ProcessRunner(kinds, plan=plan).run(Path(folder))


if __name__ == "__main__":
    main(*sys.argv[1:])
