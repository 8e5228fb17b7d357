"""Recording on a disk that is full, broken, slow or loses power: the trace stays valid, and a robot continues."""

import errno
import os
import random
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from snr_sim import Config, Node, SimClock, SimRunner, WallClock, tasks
from snr_sim.core.clocks import SimClock as VirtualClock
from snr_sim.prelude.errors import TraceError
from snr_sim.recording import folder as run_folder
from snr_sim.recording import trace as trace_module
from snr_sim.recording import trace_listener
from snr_sim.recording.atomic_files import TraceFile
from snr_sim.recording.folder import new_run_folder
from snr_sim.recording.reader import read_trace
from snr_sim.recording.records import InputRecord, Record
from snr_sim.recording.trace import FILE_NAME, TraceWriter
from snr_sim.scenario.program import program_header, record_program
from snr_sim.testing.function_components import FunctionLoopFactory

BLOCK = 4096  # what a disk writes at once


class Disk:
    """A disk that may be full, broken or slow, and knows what would be there after a loss of power."""

    def __init__(self, room: int = 10**12) -> None:
        self.room = room
        self.is_broken = False  # then it cannot sync
        self.answers = threading.Event()
        self.answers.set()
        self.syncs: list[bytes] = []
        self.path = Path()

    @property
    def synced(self) -> bytes:
        """What is there for certain."""
        return self.syncs[-1] if self.syncs else b""

    def open(self, path: Path) -> TraceFile:
        self.path = path
        return _FileOn(self, path)

    def after_power_loss(self, synced: bytes, chance: random.Random) -> bytes:
        """What is left: all that was synced, and of the rest some blocks, or nothing in their place."""
        written = self.path.read_bytes()
        length = chance.randint(len(synced), len(written))
        left = bytearray(written[:length])
        for start in range(len(synced) // BLOCK * BLOCK, length, BLOCK):
            begin, end = max(start, len(synced)), min(start + BLOCK, length)
            if chance.random() < 0.5:
                left[begin:end] = bytes(end - begin)
        return bytes(left)


class _FileOn(TraceFile):
    def __init__(self, disk: Disk, path: Path) -> None:
        super().__init__(path)
        self.disk = disk

    def write(self, data: memoryview) -> int:
        self.disk.answers.wait()
        if not self.disk.room:
            raise OSError(errno.ENOSPC, "No space left on device")
        written = super().write(data[: self.disk.room])
        self.disk.room -= written
        return written

    def sync(self) -> None:
        self.disk.answers.wait()
        if self.disk.is_broken:
            raise OSError(errno.EIO, "Input/output error")
        self.disk.syncs.append(self.disk.path.read_bytes())


class Robot(NamedTuple):
    """A node that stores a page now and then, and what records it."""

    node: Node
    clock: VirtualClock
    writer: TraceWriter
    config: Config

    def run(self, seconds: float) -> None:
        """Run on for so many virtual seconds, on the thread of the test."""
        until_s = self.clock.now_s() + seconds
        while (next_s := self.clock.next_s) is not None and next_s <= until_s:
            self.clock.run_next()
            self.node.machine.now_s = next_s
            self.node.run_ready()


class Robots(NamedTuple):
    """Makes robots whose recording fails softly, on a disk."""

    tmp_path: Path

    def on(
        self, disk: Disk, rate_hz: float = 100.0, data: Any = 1.5, viewer: trace_listener.TraceListener | None = None
    ) -> Robot:
        config = Config(factories={"r": [FunctionLoopFactory(lambda loop: loop.store_data("x", data), "x", rate_hz)]})
        clock = SimClock()
        header = program_header(["r"], config, __file__, clock)
        writer = TraceWriter(self.tmp_path / FILE_NAME, header, open_file=disk.open)
        if viewer is not None:
            writer.add_listener(viewer)
        node = Node("r", config, clock=clock, recorder=writer)
        writer.fail_softly([node])
        node.begin()
        return Robot(node, clock, writer, config)


@pytest.fixture
def robots(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Robots:
    """Make robots; nothing waits for long."""
    monkeypatch.setattr(trace_module, "FLUSH_PERIOD_S", 0.002)
    monkeypatch.setattr(trace_module, "SYNC_PERIOD_S", 0.005)
    monkeypatch.setattr(trace_module, "CLOSE_TIMEOUT_S", 0.05)
    return Robots(tmp_path)


def run_until(robot: Robot, is_so: Callable[[], bool]) -> None:
    """Run a second at a time, until something is so that another thread sees to."""
    deadline_s = time.monotonic() + 60.0
    while not is_so():
        assert time.monotonic() < deadline_s
        robot.run(1.0)
        time.sleep(0.002)


def is_reported(robot: Robot) -> Callable[[], bool]:
    return lambda: "recording" in robot.node.datastore.pages


def end(robot: Robot) -> None:
    robot.node.enqueue_input(tasks.terminate("done"), "test")
    robot.node.run_ready()
    robot.node.end()
    robot.writer.close()


def check_report(robot: Robot, reason: str) -> dict[str, Any]:
    """Check that page, words and trace agree on what is lost; return the newest page's data."""
    report: dict[str, Any] = robot.node.get_data("recording")
    assert set(report) == {"since_s", "lost", "reason"}
    assert (report["reason"], report["lost"] > 0) == (reason, True)
    trace = read_trace(robot.writer.path)
    assert not trace.is_truncated
    assert trace.digest == robot.writer.digest
    assert trace.records[-1].t <= report["since_s"]
    assert f"stops at t = {report['since_s']:.2f} s: {reason}" in robot.writer.loss
    return report


# A disk that fails while a robot runs on the wall clock, or has real outputs


@pytest.mark.parametrize("room", [5_000, 30_001])
def test_full_disk_does_not_end_robot_and_page_reports_loss(
    robots: Robots, capsys: pytest.CaptureFixture[str], room: int
) -> None:
    disk = Disk(room)
    robot = robots.on(disk)
    run_until(robot, is_reported(robot))
    stored = robot.node.datastore.stored
    robot.run(1.0)
    assert robot.node.datastore.stored >= stored + 100
    end(robot)
    report = check_report(robot, "No space left on device")
    assert len(robot.writer.path.read_bytes()) <= room
    trace = read_trace(robot.writer.path)
    recorded = len(trace.records)
    assert f"{robot.writer.seq - recorded} records are lost" in robot.writer.loss
    assert report["lost"] <= robot.writer.seq - recorded
    output = capsys.readouterr().err
    assert output.count("The recording stops") == 1
    assert "The run continues." in output
    assert robot.node.exit_reason == "done"


class FullStream:
    """Standard error in a log on the disk that is full."""

    def write(self, text: str) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    flush = write


def test_full_disk_with_the_log_on_it_ends_neither_robot_nor_flusher(
    robots: Robots, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "stderr", FullStream())
    robot = robots.on(Disk(5_000))
    robot.writer._failure = OSError(errno.ENOSPC, "No space left on device")
    robot.run(1.0)  # the first report is on the robot's own thread
    robot.run(1.0)
    assert robot.node.datastore.stored > 100
    run_until(robot, is_reported(robot))
    assert robot.writer._flusher.is_alive()
    end(robot)
    assert robot.node.exit_reason == "done"


def test_disk_with_space_again_leaves_trace_without_gap(robots: Robots) -> None:
    disk = Disk(5_000)
    robot = robots.on(disk)
    run_until(robot, is_reported(robot))
    disk.room = 10**12
    run_until(robot, lambda: robot.clock.now_s() > 3.0)
    end(robot)
    check_report(robot, "No space left on device")


def test_failure_is_published_only_after_lost_records_are_counted(
    robots: Robots, monkeypatch: pytest.MonkeyPatch
) -> None:
    disk = Disk(5_000)
    robot = robots.on(disk)
    counted: list[bool] = []
    truncate, writer = _FileOn.truncate, robot.writer

    def slow_truncate(file: _FileOn, size_bytes: int) -> None:  # of the flusher, after the disk has failed
        writer.put(1e6, b"{}")  # meanwhile, of the robot
        counted.append(writer.loss == "")
        truncate(file, size_bytes)

    monkeypatch.setattr(_FileOn, "truncate", slow_truncate)
    run_until(robot, is_reported(robot))
    assert robot.node.get_data("recording")["since_s"] < 1.5
    end(robot)
    assert counted == [True]


def test_sync_failure_counts_records_since_last_sync_as_lost(robots: Robots) -> None:
    disk = Disk()
    robot = robots.on(disk)
    run_until(robot, lambda: len(disk.synced) > 10_000)
    disk.is_broken = True
    run_until(robot, is_reported(robot))
    end(robot)
    report = robot.node.get_data("recording")
    assert report["reason"] == "Input/output error"
    (robots.tmp_path / "synced").mkdir()
    kept = robots.tmp_path / "synced" / FILE_NAME
    kept.write_bytes(disk.synced)
    assert read_trace(kept).records[-1].t <= report["since_s"]
    assert report["since_s"] - read_trace(kept).records[-1].t < 0.011  # not a page more than those that may be lost
    assert read_trace(robot.writer.path).records


def test_blocked_disk_never_blocks_robot(robots: Robots, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trace_module, "MAX_UNWRITTEN_BYTES", 100_000)
    disk = Disk()
    robot = robots.on(disk)
    run_until(robot, lambda: len(disk.synced) > 10_000)
    disk.answers.clear()
    for _ in range(20):  # what it would wait for comes never, so this would hang
        robot.run(1.0)
    assert robot.node.datastore.stored > 2000
    assert sum(map(len, robot.writer._lines)) <= 100_000  # nor does it fill the memory
    end(robot)
    report = robot.node.get_data("recording")
    assert report["reason"] == "the disk is too slow, or does not answer"
    assert "does not answer" in robot.writer.loss
    disk.answers.set()  # at last: what was on its way is written, and it is whole
    deadline_s = time.monotonic() + 60.0
    while robot.writer._flusher.is_alive():
        assert time.monotonic() < deadline_s
        time.sleep(0.002)
    assert read_trace(robot.writer.path).records[-1].t <= report["since_s"]


def test_blocked_disk_that_answers_again_leaves_trace_without_gap(
    robots: Robots, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(trace_module, "MAX_UNWRITTEN_BYTES", 100_000)
    disk = Disk()
    robot = robots.on(disk)
    run_until(robot, lambda: len(disk.synced) > 10_000)
    disk.answers.clear()
    run_until(robot, lambda: "does not answer" in robot.writer.loss)
    disk.answers.set()
    run_until(robot, is_reported(robot))
    robot.run(1.0)
    end(robot)
    check_report(robot, "the disk is too slow, or does not answer")


def test_run_without_loss_has_no_recording_page_and_no_message(robots: Robots) -> None:
    robot = robots.on(Disk())
    robot.run(1.0)
    end(robot)
    assert robot.writer.loss == ""
    assert robot.node.get_page("recording") is None
    trace = read_trace(robot.writer.path)
    assert trace.is_ended
    assert {one.source for one in trace.records if isinstance(one, InputRecord)} == {"x", "test"}


def test_lock_step_run_with_full_disk_ends(tmp_path: Path) -> None:
    config = Config(factories={"r": [FunctionLoopFactory(lambda loop: loop.store_data("x", 1.5), "x", 100.0)]})
    clock = SimClock()
    header = program_header(["r"], config, __file__, clock)
    writer = TraceWriter(tmp_path / FILE_NAME, header, open_file=Disk(5_000).open)
    with pytest.raises(TraceError, match=r"No space left on device\. It is whole up to there") as caught:
        SimRunner(config, clock=clock, recorder=writer, pace=20.0, until_s=60.0).run()
    assert "make room" in caught.value.fix
    with pytest.raises(TraceError, match="No space left"):
        writer.close()
    trace = read_trace(writer.path)
    assert trace.records
    assert not trace.is_truncated
    assert trace.digest == writer.digest


# Who watches


class Viewer:
    """A listener that hangs from some record on, until it is released."""

    def __init__(self, hangs_from: int) -> None:
        self.hangs_from = hangs_from
        self.shown: list[int] = []
        self.answers = threading.Event()

    def add(self, record: Record) -> None:
        self.shown.append(record.seq)

    def flush(self) -> None:
        if self.shown[-1] >= self.hangs_from:
            self.answers.wait()


def test_hanging_listener_delays_neither_sync_nor_end(
    robots: Robots, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(trace_listener, "CLOSE_TIMEOUT_S", 0.05)
    disk, viewer = Disk(), Viewer(hangs_from=100)
    robot = robots.on(disk, viewer=viewer)
    run_until(robot, lambda: viewer.shown[-1:] > [100])
    syncs = len(disk.syncs)
    run_until(robot, lambda: len(disk.syncs) > syncs + 2)
    end(robot)
    viewer.answers.set()
    assert len(read_trace(robot.writer.path).records) == robot.writer.seq
    assert robot.writer.path.read_bytes() == disk.synced
    assert viewer.shown == list(range(1, len(viewer.shown) + 1))
    assert "The live view has stopped: it does not answer. The run continues" in capsys.readouterr().err


def test_slow_listener_receives_no_more_records(
    robots: Robots, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    viewer, output = Viewer(hangs_from=1), [""]
    robot = robots.on(Disk(), viewer=viewer)
    run_until(robot, lambda: bool(viewer.shown))
    monkeypatch.setattr(trace_listener, "MAX_UNSHOWN_BYTES", 30_000)  # not before: its thread may come late
    run_until(
        robot, lambda: output.append(capsys.readouterr().err) or "does not keep up. The run continues" in output[-1]
    )
    viewer.answers.set()
    end(robot)
    assert len(read_trace(robot.writer.path).records) == robot.writer.seq > len(viewer.shown)
    assert capsys.readouterr().err == ""


def test_listener_receives_all_records_before_close_returns(robots: Robots) -> None:
    viewer = Viewer(hangs_from=10**9)
    robot = robots.on(Disk(), viewer=viewer)
    robot.run(3.0)
    end(robot)
    assert viewer.shown == list(range(1, robot.writer.seq + 1))


# Before the start


def test_new_run_folder_without_free_space_raises(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        shutil, "disk_usage", lambda path: shutil._ntuple_diskusage(10**9, 10**9 - 3_000_000, 3_000_000)
    )
    with pytest.raises(TraceError, match="has 3 MB free, and a run begins with 50 MB") as caught:
        new_run_folder(tmp_path / "runs", "lander_pad", 0)
    assert "--out" in caught.value.fix
    assert list(tmp_path.iterdir()) == []
    monkeypatch.setattr(shutil, "disk_usage", lambda path: shutil._ntuple_diskusage(0, 0, 0))  # it does not know
    assert new_run_folder(tmp_path / "runs", "lander_pad", 0).is_dir()


# Power


def test_power_loss_keeps_all_records_up_to_last_sync(robots: Robots) -> None:
    chance = random.Random(5)
    disk = Disk()
    robot = robots.on(disk)
    path = robots.tmp_path / "after.jsonl"
    run_until(robot, lambda: len(disk.syncs) > 6)
    end(robot)
    records = read_trace(robot.writer.path).records
    assert robot.writer.path.read_bytes() == disk.synced  # the end of a run is synced, too
    assert len(records) == robot.writer.seq
    cut = 0
    for synced in disk.syncs[:6]:
        for _ in range(10):
            left = disk.after_power_loss(synced, chance)
            path.write_bytes(left)
            trace = read_trace(path)
            assert len(trace.records) >= synced.count(b"\n") - 2
            assert trace.records == records[: len(trace.records)]
            assert trace.is_truncated == (b"\0" in left or not left.endswith(b"\n"))
            cut += trace.is_truncated
    assert cut > 30


# Disks of this computer


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of 60 MB on a loop device; needs root."""
    image, mounted = tmp_path / "image", tmp_path / "disk"
    mounted.mkdir()
    with image.open("wb") as file:
        file.truncate(64_000_000)
    tools = ["mkfs.ext4", "mount", "umount"]
    if os.geteuid() != 0 or not all(map(shutil.which, tools)):
        pytest.skip("only root mounts a loop device")
    subprocess.run(["mkfs.ext4", "-q", "-m", "0", "-O", "^has_journal", image], check=True)
    if subprocess.run(["mount", "-o", "loop", image, mounted], capture_output=True).returncode:
        pytest.skip("this computer has no loop device to mount")
    yield mounted
    subprocess.run(["umount", "-l", mounted], check=True)


@pytest.mark.slow
def test_robot_with_disk_filled_during_run_continues_to_its_end(
    small_disk: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run_folder, "MIN_FREE_BYTES", 20_000_000)
    seen: list[Any] = []

    def loop(loop: Any) -> None:
        if loop.get_time_s() > 0.3 and not (small_disk / "ballast").exists():
            with suppress(OSError), (small_disk / "ballast").open("wb", buffering=0) as ballast:
                while True:
                    ballast.write(bytes(BLOCK))
        loop.store_data("x", "x" * 2000)
        seen.append(loop.parent.datastore.pages.get("recording"))
        if loop.get_time_s() > 3.0:
            loop.schedule(tasks.terminate("done"))

    config = Config(factories={"r": [FunctionLoopFactory(loop, "x", 100.0)]})
    folder = record_program("r", config, __file__, small_disk / "runs", clock=WallClock())
    trace = read_trace(folder / FILE_NAME)
    assert not trace.is_truncated
    assert not trace.is_ended
    assert trace.records[-1].t <= seen[-1].data["since_s"] < 3.0
    assert seen[-1].data["reason"] == "No space left on device"
    assert "note: The recording stops at t = " in capsys.readouterr().err
