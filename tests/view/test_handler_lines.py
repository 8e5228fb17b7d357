"""The lines of handlers in the text of pages: from the files that the run was recorded with."""

from __future__ import annotations

from pathlib import Path

import pytest

from snr_sim.prelude.errors import TraceError
from snr_sim.recording.sources import KeptFile
from snr_sim.view import handler_lines as module
from snr_sim.view.handler_lines import handler_lines

GENTLE = b"""
class Gentle:
    def on_radar(self, radar):
        pass

    def begin(self):
        pass


class Other:
    def begin(self):
        pass


def on_nothing():
    pass
"""


def keep(monkeypatch: pytest.MonkeyPatch, *files: tuple[str, bytes]) -> None:
    kept = [KeptFile(Path(name), "", True, data) for name, data in files]
    monkeypatch.setattr(module, "read_kept_files", lambda run: kept)


def test_method_of_one_class_has_its_line(monkeypatch: pytest.MonkeyPatch) -> None:
    keep(monkeypatch, ("a/gentle.py", GENTLE))
    assert handler_lines(Path()) == {"on_radar": "gentle.py line 3"}


def test_name_in_two_files_has_none(monkeypatch: pytest.MonkeyPatch) -> None:
    keep(monkeypatch, ("a/gentle.py", GENTLE), ("b/other.py", GENTLE))
    assert handler_lines(Path()) == {}


@pytest.mark.parametrize("data", [b"def (", b"\xff\xfe", b"\x00", b"(" * 10_000, b""])
def test_file_that_is_not_python_has_none(monkeypatch: pytest.MonkeyPatch, data: bytes) -> None:
    keep(monkeypatch, ("a/gentle.py", data), ("landing.lrp", b"(machine m)"))
    assert handler_lines(Path()) == {}


def test_damaged_folder_has_none(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(run: Path) -> None:
        raise TraceError("The table is damaged.", fix="none.")

    monkeypatch.setattr(module, "read_kept_files", fail)
    assert handler_lines(Path()) == {}
