"""Who watches the supervisor of outputs: a second process, which puts them at neutral if the first is killed or hangs.

    robot's program --leases--> supervisor --signs of life--> guard
                                     '------> outputs <-------'  neutral, once

It is forked from the supervisor when the outputs are open, so it has everything imported and opened already, and needs
a millisecond where a fresh Python takes a third of a second. It is in a group of its own. If both are killed at once,
the last pulse stays until the next supervisor has started.
"""

from __future__ import annotations

import os
import select
import signal
from collections.abc import Sequence
from contextlib import suppress

from snr_sim.prelude.device import LEASE_S, PwmOut

HANGS_S = LEASE_S + 0.1  # an armed supervisor shows life whenever a lease comes, and when it runs out
_ARMED, _NOT_ARMED, _DISMISSED = b"a", b"n", b"d"


class Guard:
    """The guard, as its supervisor sees it. Begins at once; the supervisor must have one thread only.

    Args:
        out: open outputs that keep their last pulse.
        not_its: open files of the supervisor that the guard must not keep open, as the line to the robot's program.
    """

    def __init__(self, out: PwmOut, not_its: Sequence[int] = ()) -> None:
        read, self._write = os.pipe()
        self.pid = os.fork()
        if self.pid == 0:
            try:
                for fd in (self._write, *not_its):
                    os.close(fd)
                _keep_watch(read, out)
            finally:
                os._exit(0)  # nothing of what the supervisor would do at its end
        os.close(read)
        os.set_blocking(self._write, False)

    def sign(self, is_armed: bool) -> None:
        """Show that the supervisor lives."""
        with suppress(OSError):  # it was killed, or does not run: then there is nobody to be shown anything
            os.write(self._write, _ARMED if is_armed else _NOT_ARMED)

    def dismiss(self) -> None:
        """Have it end, and leave the outputs alone: somebody else may have them next."""
        with suppress(OSError):
            os.write(self._write, _DISMISSED)
        os.close(self._write)
        with suppress(ChildProcessError):
            os.waitpid(self.pid, 0)


def _keep_watch(signs: int, out: PwmOut) -> None:
    """Look at signs of life until they end."""
    os.setsid()
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)  # it ends with its supervisor
    newest = _NOT_ARMED
    while True:
        if not select.select([signs], [], [], HANGS_S if newest == _ARMED else None)[0]:
            out.deactivate("the supervisor hangs")
            newest = _NOT_ARMED  # done, until it shows life again
            continue
        seen = os.read(signs, 65536)
        if not seen:
            out.deactivate("the supervisor was killed")
            return
        if _DISMISSED in seen:
            return
        newest = seen[-1:]
