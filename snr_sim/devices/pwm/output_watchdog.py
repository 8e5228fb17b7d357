"""Guard of the supervisor of outputs: a second process that sets them to neutral if the first is killed or hangs.

    robot's program --leases--> supervisor --heartbeats--> guard
                                     '------> outputs <-------'  neutral, once

It is forked from the supervisor when the outputs are open, so everything is imported and open already, and it starts in
a millisecond instead of a third of a second for a new Python. It has its own process group. If both are killed at once,
the last pulse stays until the next supervisor has started.
"""

from __future__ import annotations

import os
import select
import signal
from collections.abc import Sequence
from contextlib import suppress

from snr_sim.prelude.device import LEASE_S, PwmOut

HANG_TIMEOUT_S = LEASE_S + 0.1  # an armed supervisor sends a heartbeat when a lease arrives and when it expires
_ARMED, _NOT_ARMED, _STOPPED = b"a", b"n", b"d"


class OutputWatchdog:
    """The guard, as its supervisor sees it. Starts at once; the supervisor must have one thread only.

    Args:
        out: open outputs that keep their last pulse.
        inherited_fds: open files of the supervisor that the guard must close, such as the line to the robot's program.
    """

    def __init__(self, out: PwmOut, inherited_fds: Sequence[int] = ()) -> None:
        read, self._write = os.pipe()
        self.pid = os.fork()
        if self.pid == 0:
            try:
                for fd in (self._write, *inherited_fds):
                    os.close(fd)
                _watch(read, out)
            finally:
                os._exit(0)  # skips the exit handlers of the supervisor
        os.close(read)
        os.set_blocking(self._write, False)

    def feed(self, is_armed: bool) -> None:
        """Send a heartbeat."""
        with suppress(OSError):  # the guard was killed or does not run: no process reads it
            os.write(self._write, _ARMED if is_armed else _NOT_ARMED)

    def stop(self) -> None:
        """End the guard without changing the outputs: another process may own them next."""
        with suppress(OSError):
            os.write(self._write, _STOPPED)
        os.close(self._write)
        with suppress(ChildProcessError):
            os.waitpid(self.pid, 0)


def _watch(heartbeat_fd: int, out: PwmOut) -> None:
    """Read heartbeats until they end."""
    os.setsid()
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)  # it ends with its supervisor
    newest = _NOT_ARMED
    while True:
        if not select.select([heartbeat_fd], [], [], HANG_TIMEOUT_S if newest == _ARMED else None)[0]:
            out.deactivate("the supervisor hangs")
            newest = _NOT_ARMED  # outputs are neutral; wait for the next heartbeat
            continue
        received = os.read(heartbeat_fd, 65536)
        if not received:
            out.deactivate("the supervisor was killed")
            return
        if _STOPPED in received:
            return
        newest = received[-1:]
