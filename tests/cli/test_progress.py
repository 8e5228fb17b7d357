"""The progress line: when it is shown, and what else is printed meanwhile."""

import logging
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from io import StringIO

import pytest

from snr_sim.cli.plain_console import progress
from snr_sim.core.runners import show_log


class Terminal(StringIO):
    """Standard error of a person."""

    def isatty(self) -> bool:
        return True


@contextmanager
def at_terminal() -> Iterator[Terminal]:
    """Standard error is a terminal meanwhile; not by a fixture, as pytest would put its own in its place again."""
    with pytest.MonkeyPatch.context() as patch:
        terminal = Terminal()
        patch.setattr(sys, "stderr", terminal)
        patch.setenv("TERM", "xterm")
        yield terminal


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The wall clock of the progress line."""
    now_s = [100.0]
    monkeypatch.setattr("snr_sim.cli.plain_console.time.monotonic", lambda: now_s[0])
    return now_s


@pytest.fixture
def log() -> Iterator[logging.Logger]:
    logger = logging.getLogger("snr")
    before = logger.handlers[:], logger.level, logger.propagate
    show_log(logging.INFO)
    yield logger
    logger.handlers[:], logger.level, logger.propagate = before


@pytest.mark.slow
def test_only_a_long_run_shows_progress(clock: list[float]) -> None:
    with at_terminal() as terminal, progress("lander_pad", after_s=2.0) as tick:
        assert tick is not None
        for clock[0] in (100.0, 101.9):
            tick(5.0)
        assert terminal.getvalue() == ""
        clock[0] = 102.1
        tick(31.25)
    assert "lander_pad: t = 31.2 s" in terminal.getvalue()


def test_pipe_shows_no_progress(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stderr", StringIO())
    with progress("lander_pad", after_s=0.0) as tick:
        assert tick is None


@pytest.mark.slow
def test_log_line_is_printed_above_progress_line(clock: list[float], log: logging.Logger) -> None:
    with at_terminal() as terminal, progress("lander_pad", after_s=0.0) as tick:
        assert tick is not None
        tick(1.0)
        while "t = 1.0 s" not in terminal.getvalue():  # it is drawn by a thread
            threading.Event().wait(0.02)
        shown = terminal.getvalue()
        log.info("touch")
        output = terminal.getvalue()[len(shown) :]
    assert "INFO snr: touch\n" in output
    assert output.startswith(("\r", "\x1b"))  # the progress line is taken away first
