"""Timeout of an answer, in virtual time: a program that waits for nothing is found by its state."""

import math

import pytest

from snr_sim.grading.remote import cpu_timeout
from snr_sim.grading.remote.cpu_timeout import CpuTimeout

WORD_PERIOD_S = 0.1


class Program:
    """A program that prints a word ten times a second, and which its grader sees at each word and at each poll."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, cpu_share: float, is_awake_between: bool) -> None:
        self._cpu_share = cpu_share
        self._is_awake_between = is_awake_between
        self._words = 0
        self._has_printed = False
        self._now_s = 0.0
        monkeypatch.setattr(cpu_timeout.time, "monotonic", lambda: self._now_s)
        monkeypatch.setattr(cpu_timeout, "process_state", lambda pid: self._state())

    def _state(self) -> tuple[bool, float]:
        """It had no time yet to fall asleep after a word: its grader, on the same core, has interrupted it."""
        return not (self._has_printed or self._is_awake_between), self._cpu_share * self._now_s

    def runs_until_over_s(self, timeout: CpuTimeout, max_s: float = 100.0) -> float:
        while self._now_s < max_s:
            word_s = (self._words + 1) * WORD_PERIOD_S
            poll_s = self._now_s + timeout.poll_period_s
            self._has_printed = word_s <= poll_s
            self._words += self._has_printed
            self._now_s = min(word_s, poll_s)
            if timeout.is_over():
                return self._now_s
        return math.inf


def test_program_that_prints_while_it_waits_is_over_soon(monkeypatch: pytest.MonkeyPatch) -> None:
    program = Program(monkeypatch, cpu_share=0.0, is_awake_between=False)
    timeout = CpuTimeout(80.0, 5.0, 1)
    assert program.runs_until_over_s(timeout) < 5.0
    assert not timeout.is_cpu_used_up


def test_program_that_prints_while_it_works_has_its_cpu_time(monkeypatch: pytest.MonkeyPatch) -> None:
    program = Program(monkeypatch, cpu_share=0.5, is_awake_between=True)
    timeout = CpuTimeout(80.0, 5.0, 1)
    assert program.runs_until_over_s(timeout) == pytest.approx((5.0 + cpu_timeout._SLACK_S) / 0.5, abs=2.0)
    assert timeout.is_cpu_used_up


def test_program_that_gets_no_core_has_its_wall_time(monkeypatch: pytest.MonkeyPatch) -> None:
    program = Program(monkeypatch, cpu_share=0.0, is_awake_between=True)
    timeout = CpuTimeout(80.0, 5.0, 1)
    assert program.runs_until_over_s(timeout) == pytest.approx(80.0, abs=1.0)
    assert not timeout.is_cpu_used_up
