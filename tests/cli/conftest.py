"""Calls of `snr` in this process, with its output and exit status; and student files as its input."""

import json
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from snr_sim.cli.main import main

CONTROLLER = """
from snr_sim import Endpoint, EndpointFactory, TaskType, tasks

def factories(robot):
    return [MineFactory()]

class MineFactory(EndpointFactory):
    def get(self, parent):
        return Mine(self, parent, "mine")

class Mine(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.ticks = 0
        self.task_handlers = {(TaskType.process_data, "radar"): self.on_radar}

    def on_radar(self, task, task_id):
        self.ticks += 1
        now_s = self.get_time_s()
        return self.store_data_task("engine", {"throttle": 0.2})
"""


@dataclass
class Answer:
    """Result of a command."""

    status: int
    out: str
    err: str

    @property
    def json(self) -> dict[str, Any]:
        """The one object on stdout; any other output is an error."""
        fields = json.loads(self.out)
        assert isinstance(fields, dict)
        return fields


Snr = Callable[..., Answer]


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder, which is the current one."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("SNR_SIM_PATH", raising=False)
    monkeypatch.setattr(sys, "path", list(sys.path))
    return tmp_path


@pytest.fixture
def snr(here: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Snr:
    """Return a function that calls `snr` with the given arguments."""

    def call(*words: object) -> Answer:
        capfd.readouterr()
        monkeypatch.setattr(sys, "argv", ["snr", *map(str, words)])
        with pytest.raises(SystemExit) as end:
            main()
        out, err = capfd.readouterr()
        assert "Traceback" not in err
        return Answer(int(end.value.code or 0), out, err)

    return call


@pytest.fixture
def mine(here: Path) -> Callable[..., Path]:
    """Return a function that writes mine.py: the controller above, with some of its text replaced."""

    def write(*changes: tuple[str, str], text: str = CONTROLLER, name: str = "mine.py") -> Path:
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        path = here / name
        path.write_text(text)
        return path

    return write
