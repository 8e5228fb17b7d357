"""Reports to systemd: what arrives at its socket, and when."""

import os
import socket
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from snr_sim.supervision.systemd import SystemdReports


@pytest.fixture
def received(tmp_path: Path) -> Iterator[Callable[[], list[str]]]:
    """What has arrived at the socket `notify` since the last call."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sock:
        sock.bind(str(tmp_path / "notify"))
        sock.setblocking(False)

        def take() -> list[str]:
            texts: list[str] = []
            while True:
                try:
                    texts.append(sock.recv(100).decode())
                except BlockingIOError:
                    return texts

        yield take


def test_ready_watchdog_while_all_works_and_stopping_once_arrive(
    tmp_path: Path, received: Callable[[], list[str]]
) -> None:
    reports = SystemdReports({"NOTIFY_SOCKET": str(tmp_path / "notify"), "WATCHDOG_USEC": "4000000"})
    for is_working, now_s in [(False, 0.0), (True, 1.0), (True, 2.9), (True, 3.0), (False, 5.0), (True, 5.5)]:
        reports.report(is_working, False, now_s)
    assert received() == ["READY=1", "WATCHDOG=1", "WATCHDOG=1"]
    for now_s in (6.0, 6.1):
        reports.report(False, True, now_s)
    assert received() == ["STOPPING=1"]


@pytest.mark.parametrize("more", [{}, {"WATCHDOG_USEC": "2000000", "WATCHDOG_PID": str(os.getpid() + 1)}])
def test_watchdog_that_is_not_asked_for_here_is_not_sent(
    tmp_path: Path, received: Callable[[], list[str]], more: dict[str, str]
) -> None:
    reports = SystemdReports({"NOTIFY_SOCKET": str(tmp_path / "notify"), **more})
    for now_s in (0.0, 100.0):
        reports.report(True, False, now_s)
    assert received() == ["READY=1"]


def test_report_without_systemd_does_nothing(tmp_path: Path) -> None:
    for environment in ({}, {"NOTIFY_SOCKET": str(tmp_path / "gone")}, {"NOTIFY_SOCKET": "@snr-nobody"}):
        SystemdReports(environment).report(True, False, 0.0)
