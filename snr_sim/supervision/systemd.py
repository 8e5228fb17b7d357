"""Reports of a supervisor to systemd, which has started its program and restarts it if it fails or hangs.

Source: sd_notify(3) and sd_watchdog_enabled(3) of systemd. `snr new service` writes a unit for it.
"""

from __future__ import annotations

import math
import os
import socket
from collections.abc import Mapping
from contextlib import suppress


class SystemdReports:
    """Sends "ready" once all works, and from then on as often as asked while it does; without systemd, nothing.

    Args:
        environment: of the program.
    """

    def __init__(self, environment: Mapping[str, str] = os.environ) -> None:
        address = environment.get("NOTIFY_SOCKET", "")
        self._address = f"\0{address[1:]}" if address.startswith("@") else address
        limit_us = environment.get("WATCHDOG_USEC", "")
        is_asked = limit_us.isdecimal() and environment.get("WATCHDOG_PID", str(os.getpid())) == str(os.getpid())
        self._period_s = int(limit_us) / 2e6 if is_asked else math.inf
        self._due_s = -math.inf
        self._is_ready = self._is_ending = False

    def report(self, is_working: bool, is_ending: bool, now_s: float) -> None:
        """Send what is due; `is_ending` says that nothing is started again."""
        if is_ending and not self._is_ending:
            self._is_ending = True
            self._send("STOPPING=1")
        elif is_working and not self._is_ready:
            self._is_ready, self._due_s = True, now_s + self._period_s
            self._send("READY=1")
        elif is_working and now_s >= self._due_s:
            self._due_s = now_s + self._period_s
            self._send("WATCHDOG=1")

    def _send(self, text: str) -> None:
        if self._address:
            with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sock, suppress(OSError):
                sock.setblocking(False)  # a supervisor does not wait for systemd
                sock.sendto(text.encode(), self._address)
