"""Each process of a running rover is killed, stopped, and hangs: its wheel is neutral, it is restarted, and receives.

The motor controller is emulated at the far end of a pty, in this process, so it lives on whatever is killed.
"""

from __future__ import annotations

import os
import pty
import re
import select
import signal
import socket
import subprocess
import sys
import threading
import time
import tty
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import pytest

from snr_sim.devices.emulated.emulated_vesc import EmulatedVesc
from snr_sim.prelude.errors import RecordingError
from snr_sim.prelude.ground_signals import DriveMode
from snr_sim.supervision.health import PartHealth, read_health
from snr_sim.supervision.health_link import ask_health
from snr_sim.supervision.plan import Backoff
from tests.devices.emulated.test_emulated_vesc import BenchMotor
from tests.processes.watched_rover import END_S, PARTS
from tests.slowness import slowness
from tests.supervision.test_multi_proc import is_alive

HERE = Path(__file__).parent
LIMIT_S = 60.0  # for what takes a second on a computer that has nothing else to do
NEUTRAL_LIMIT_S, RESTART_LIMIT_S, END_LIMIT_S = 0.3, 1.5, 3.0
BROKER = "state_manager"
ROWS = [(who, how) for how in ("SIGKILL", "SIGSTOP") for who in (BROKER, *PARTS)]
ROWS += [(who, how) for how in ("handler", "loop") for who in PARTS]
# A loop that hangs leaves the handlers working, and those of these two drive the wheel.
DRIVES_ON = [("Drive", "loop"), ("Motors", "loop")]


class Wheel(BenchMotor):
    """Notes when it is driven, and when it is not."""

    def __init__(self) -> None:
        super().__init__()
        self.changes: list[tuple[float, bool]] = []  # time, and whether it is driven

    def drive(self, mode: DriveMode, value: float) -> None:
        super().drive(mode, value)
        self.changes.append((time.monotonic(), mode != "brake"))


class Recovery(NamedTuple):
    """How long it took until the wheel was neutral, and until the failure was found; and from then on.

    `waited_s` is how long supervisor and new process waited for a core that others used, `paused_s` the motor
    controller.
    """

    neutral_s: float | None
    found_s: float
    restarted_s: float
    received_s: float
    waited_s: float
    paused_s: float


def waited_for_core_s(pid: int) -> float:
    """Return for how long a process could have run and did not, since its start."""
    return int(Path(f"/proc/{pid}/schedstat").read_text().split()[1]) / 1e9


class Rover:
    """`watched_rover.py` and its motor controller.

    Attributes:
        lines: time and text of each line that it has printed.
        paused_s: the longest time for which the controller was not executed since that was set to 0.
    """

    def __init__(self, folder: Path) -> None:
        self.folder, self.wheel = folder, Wheel()
        self.lines: list[tuple[float, str]] = []
        self.paused_s = 0.0
        self._far, self._near = pty.openpty()
        tty.setraw(self._near)
        self._is_over = False
        self.notified = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)  # as systemd's
        self.notified.bind(str(folder / "notify"))
        with socket.create_server(("127.0.0.1", 0)) as free:
            self.health_at: tuple[str, int] = free.getsockname()
        words = (folder, os.ttyname(self._near), 1.5 * slowness(), self.health_at[1])
        self.process = subprocess.Popen(
            [sys.executable, HERE / "watched_rover.py", *map(str, words)],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            process_group=0,
            env={**os.environ, "PYTHONPATH": str(HERE.parents[1]), "NOTIFY_SOCKET": str(folder / "notify")},
        )
        self._threads = [threading.Thread(target=work, daemon=True) for work in (self._serve, self._read)]
        for thread in self._threads:
            thread.start()

    def _serve(self) -> None:
        controller, served_s = EmulatedVesc(self.wheel, "motor", 228.0, "seed", "2.18"), time.monotonic()
        while not self._is_over:
            ready = select.select([self._far], [], [], 0.002)[0]
            now_s = time.monotonic()
            self.paused_s, served_s = max(self.paused_s, now_s - served_s), now_s
            if sent := controller.feed(os.read(self._far, 4096) if ready else b"", now_s):
                os.write(self._far, sent)

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.lines.append((time.monotonic(), line))

    def close(self) -> None:
        self.process.kill()
        with suppress(RecordingError):  # it has not begun
            for part in self.parts().values():
                if part.pid is not None and is_alive(part.pid):  # one that is stopped reads no end of its line
                    os.kill(part.pid, signal.SIGKILL)
        self.process.wait(LIMIT_S)
        self._is_over = True
        for thread in self._threads:
            thread.join(LIMIT_S)
        assert self.process.stdout is not None
        self.process.stdout.close()
        self.notified.close()
        os.close(self._far)
        os.close(self._near)

    def parts(self) -> dict[str, PartHealth]:
        return {part.name: part for part in read_health(self.folder).tree[1:]}

    def until(self, is_so: Callable[[], bool]) -> float:
        """Returns the time when something is so."""
        end_s = time.monotonic() + LIMIT_S
        while not is_so():
            assert time.monotonic() < end_s, self.text
            time.sleep(0.005)
        return time.monotonic()

    @property
    def text(self) -> str:
        return "".join(line for _, line in self.lines)

    def line_s(self, words: str, since_s: float) -> float | None:
        """Returns when words were printed first since a time."""
        return next((at_s for at_s, line in self.lines if at_s > since_s and re.search(words, line)), None)

    def has_received(self, since_s: float, names: Sequence[str] = PARTS) -> bool:
        return all(self.line_s(rf"receives {name}", since_s) is not None for name in names)

    def neutral_s(self, since_s: float) -> float | None:
        return next((at_s - since_s for at_s, driven in self.wheel.changes if at_s > since_s and not driven), None)

    @property
    def is_driven(self) -> bool:
        return bool(self.wheel.changes) and self.wheel.changes[-1][1]

    def suffer(self, who: str, how: str) -> Recovery:
        """Lets it happen."""
        before = self.parts()[who]
        self.paused_s, waited_s = 0.0, -waited_for_core_s(self.process.pid)
        if how in ("handler", "loop"):
            asked = self.folder / f"{who}.{how}"
            asked.touch()
            begun_s = self.until(lambda: not asked.exists())
        else:
            assert before.pid is not None
            begun_s = time.monotonic()
            os.kill(before.pid, getattr(signal, how))
        found_s = begun_s if how == "SIGKILL" else None
        if found_s is None:
            self.until(lambda: self.line_s(f"root/{who} is ", begun_s) is not None)
            found_s = self.line_s(f"root/{who} is ", begun_s)
            assert found_s is not None
        restarted_s = self.until(
            lambda: (part := self.parts()[who]).restarts > before.restarts and part.state == "running"
        )
        received_s = self.until(lambda: self.has_received(begun_s, PARTS if who == BROKER else [who]))
        waited_s += waited_for_core_s(self.process.pid) + waited_for_core_s(self.parts()[who].pid or 0)
        self.until(lambda: self.is_driven)
        times_s = found_s - begun_s, restarted_s - found_s, received_s - found_s
        return Recovery(self.neutral_s(begun_s), *times_s, waited_s, self.paused_s)


@pytest.fixture
def rover(tmp_path: Path) -> Iterator[Rover]:
    made = Rover(tmp_path)
    try:
        made.until(lambda: made.has_received(0.0))
        yield made
    finally:
        made.close()


def check_recovery(rover: Rover, who: str, how: str, failures: int) -> None:
    """Its wheel is neutral in time, it is restarted in time, and receives its keys again."""
    seen = rover.suffer(who, how)
    print(f"{who} {how}: {seen}")
    limit_s = RESTART_LIMIT_S * slowness() + Backoff().delay_s(failures) + (0.0 if how == "SIGKILL" else END_S)
    assert seen.restarted_s - seen.waited_s <= limit_s
    if (who, how) not in DRIVES_ON:
        assert seen.neutral_s is not None
        assert seen.neutral_s <= NEUTRAL_LIMIT_S + seen.paused_s


BEFORE_THE_NIGHT = [(BROKER, "SIGKILL"), ("Motors", "SIGKILL"), ("Drive", "SIGSTOP"), ("Pilot", "handler")]
AT_NIGHT = [pytest.param(ROWS, marks=pytest.mark.nightly, id=f"all-{i}") for i in range(4)]


@pytest.mark.wall_clock
@pytest.mark.parametrize("rows", [pytest.param(BEFORE_THE_NIGHT, id="some"), *AT_NIGHT])
def test_each_process_recovers_from_kill_stop_and_hang(rover: Rover, rows: list[tuple[str, str]]) -> None:
    failures = dict.fromkeys((BROKER, *PARTS), 0)
    for who, how in rows:
        check_recovery(rover, who, how, failures[who])
        failures[who] += 1
    assert rover.notified.recv(100) == b"READY=1"
    assert "[Pilot] Motors does not run" in rover.text  # by the page of health
    asked = ask_health(rover.health_at, LIMIT_S)  # of a state manager that was started again
    assert {part.name: part.restarts for part in asked.tree[1:]} == failures
    pids = [part.pid for part in rover.parts().values()]
    rover.paused_s = 0.0
    killed_s = time.monotonic()
    rover.process.kill()
    rover.until(lambda: rover.neutral_s(killed_s) is not None)
    assert (rover.neutral_s(killed_s) or 0.0) <= NEUTRAL_LIMIT_S + rover.paused_s
    ended_s = rover.until(lambda: not any(is_alive(pid or 0) for pid in pids))
    print(f"supervisor: neutral {rover.neutral_s(killed_s)}, all ended {ended_s - killed_s:.3f} s")
    assert ended_s - killed_s <= END_LIMIT_S * slowness()
