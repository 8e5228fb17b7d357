"""Copies of sources in a run folder: whole after a full disk, and there after a power loss."""

from __future__ import annotations

import errno
import os
from pathlib import Path
from typing import Any

import pytest

from snr_sim import Config, SimClock
from snr_sim.recording import trace as trace_module
from snr_sim.recording.sources import FOLDER, KeepingFiles, read_kept_files
from snr_sim.recording.trace import FILE_NAME, TraceWriter
from snr_sim.scenario.program import program_header
from tests.on_thread import wait_for


def test_copies_of_a_full_disk_leave_no_part_and_later_ones_are_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept = KeepingFiles(tmp_path, lambda path: True)
    kept.keep(Path("/a/first.py"), b"first = 1\n")
    write, room = os.write, 0

    def write_part(descriptor: int, data: Any) -> int:
        if room:
            return write(descriptor, data)
        written = write(descriptor, bytes(data)[: len(data) // 2])
        if written:
            return written
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "write", write_part)
    kept.keep(Path("/a/second.py"), b"second = 2\n")
    room = 1
    kept.keep(Path("/b/second.py"), b"second = 2\n")
    assert [(one.path, one.data) for one in read_kept_files(tmp_path)] == [
        (Path("/a/first.py"), b"first = 1\n"),
        (Path("/b/second.py"), b"second = 2\n"),
    ]
    assert kept.left_out == ["second.py could not be kept for a replay: No space left on device."]


@pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="names descriptors by /proc")
def test_first_sync_of_the_trace_syncs_copies_and_a_later_one_what_came_since(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced: dict[str, int] = {}
    fsync = os.fsync

    def note(descriptor: int) -> None:
        fsync(descriptor)
        synced[str(Path(f"/proc/self/fd/{descriptor}").readlink())] = os.fstat(descriptor).st_size

    monkeypatch.setattr(os, "fsync", note)
    monkeypatch.setattr(trace_module, "FLUSH_PERIOD_S", 0.002)
    monkeypatch.setattr(trace_module, "SYNC_PERIOD_S", 0.005)
    kept = KeepingFiles(tmp_path, lambda path: True)
    config = Config(factories={"r": []})
    writer = TraceWriter(tmp_path / FILE_NAME, program_header(["r"], config, __file__, SimClock()))
    for number in (1, 2):
        kept.keep(Path(f"/a/{number}.py"), b"x = 1\n" * number)
        writer.put(0.0, b"{}")
        wait_for(lambda: all(synced.get(str(path)) == path.stat().st_size for path in (tmp_path / FOLDER).iterdir()))
        assert str(tmp_path / FOLDER) in synced
    writer.close()
