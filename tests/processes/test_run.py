"""RoverProcesses in processes of their own: the same rules as in lock step, by the wall clock."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from snr_sim.prelude.errors import SupervisionError
from snr_sim.processes import ProcessRunner, RoverServer
from snr_sim.supervision import Child, Intensity, Supervisor, Timeouts

pytestmark = pytest.mark.slow

COUNT = 500


class Logs(RoverServer):
    """Logs its life; ends all after a minute."""

    def setup(self, args: Any) -> None:
        self.args = args
        self.log("setup")

    def loop(self) -> float:
        if self.get_time_s() > 60.0:
            self.terminate_state()
        return 0.05

    def cleanup(self) -> None:
        self.log("cleanup")


class Sends(Logs):
    """Publishes numbers once the reader is there; receives them itself, too."""

    def setup(self, args: Any) -> None:
        super().setup(args)
        self.got: list[int] = []
        self.subscribe("number")
        self.subscribe("here")

    def on_here(self, data: Any) -> None:
        self.unsubscribe("here")
        for number in range(COUNT):
            self.publish("number", number)

    def on_number(self, data: int) -> None:
        self.got.append(data)

    def on_quit(self, data: Any) -> None:
        self.log(self.got == [*range(COUNT), -1])


class Reads(Logs):
    """Says that it is there, reads numbers until the last one, and ends all."""

    def setup(self, args: Any) -> None:
        super().setup(args)
        self.got: list[int] = []
        self.subscribe("number")

    def on_number(self, data: int) -> None:
        self.got.append(data)
        if data == COUNT - 1:
            self.log(self.got == list(range(COUNT)))
            self.unsubscribe("number")
            self.publish("number", -1)
            self.terminate_state()
        assert data >= 0

    def loop(self) -> float:
        if not self.got:
            self.publish("here", 1)
        return super().loop()


class Present(Logs):
    """Reports that it runs."""

    def loop(self) -> float:
        self.publish("present", True)
        return super().loop()


class Waits(Logs):
    """Waits until the other process runs: one that has not begun has nothing to clean up."""

    def setup(self, args: Any) -> None:
        super().setup(args)
        self.subscribe("present")
        self.is_met = False

    def on_present(self, data: Any) -> None:
        self.is_met = True


class Fails(Waits):
    """Raises in its loop."""

    def loop(self) -> float:
        if self.is_met:
            raise ValueError("no wheel")
        return super().loop()


class Stops(Waits):
    """Sends a signal to the program that has started it."""

    def loop(self) -> float:
        if not self.is_met:
            return super().loop()
        os.kill(os.getppid(), signal.SIGTERM)
        return 3600.0


class TwoThreads(Logs):
    """Logs whether its handlers and its loop have threads of their own, and its spawned function another one."""

    def setup(self, args: Any) -> None:
        self.threads: dict[str, int] = {}
        self.subscribe("k")
        self.spawn_thread(self.wait, pause_s=0.01)

    def wait(self, pause_s: float) -> Iterator[float]:
        while True:
            self.note("spawned")
            yield pause_s

    def note(self, what: str) -> None:
        with self.lock:
            self.threads[what] = threading.get_ident()
            if len(self.threads) == 3:
                self.terminate_state()

    def on_k(self, data: Any) -> None:
        self.note("handler")

    def loop(self) -> float:
        self.publish("k", 1)
        self.note("loop")
        return super().loop()

    def cleanup(self) -> None:
        names = {thread.ident for thread in threading.enumerate()}
        self.log([len(set(self.threads.values())), self.threads["spawned"] in names])


def logged(folder: Path) -> dict[str, list[str]]:
    lines = {path.parent.name: path.read_text().splitlines() for path in folder.glob("*/log.txt")}
    return {name: [line.split(maxsplit=3)[3] for line in of] for name, of in lines.items()}


def test_messages_arrive_in_order_and_terminate_state_ends_all(tmp_path: Path) -> None:
    ProcessRunner([Sends, Reads]).run(tmp_path)
    assert logged(tmp_path) == {"Sends": ["setup", "True", "cleanup"], "Reads": ["setup", "True", "cleanup"]}


def test_exceptions_in_loop_restart_the_process_then_end_all_with_the_line(
    tmp_path: Path,
) -> None:
    children = [Child(name, "on_failure", Timeouts(setup_s=60.0)) for name in ("state_manager", "Fails", "Present")]
    plan = Supervisor("root", children, intensity=Intensity(1, within_s=600.0))
    reason = r'(?s)Fails failed 2 times in .*test_run.py, line \d+: raise ValueError\("no wheel"\)'
    with pytest.raises(SupervisionError, match=reason):
        ProcessRunner([Fails, Present], plan=plan).run(tmp_path)
    assert logged(tmp_path) == {"Fails": ["setup", "cleanup"] * 2, "Present": ["setup", "cleanup"]}


def test_handlers_loop_and_spawned_functions_have_threads_of_their_own(tmp_path: Path) -> None:
    ProcessRunner([TwoThreads]).run(tmp_path)
    assert logged(tmp_path) == {"TwoThreads": ["[3, False]"]}


def test_sigterm_cleans_up_each_process(tmp_path: Path) -> None:
    ProcessRunner([Stops, Present]).run(tmp_path)
    assert logged(tmp_path) == {"Stops": ["setup", "cleanup"], "Present": ["setup", "cleanup"]}
