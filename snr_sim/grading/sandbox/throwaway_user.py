"""A user for one process: nobody else's, from a range that is kept for such, and gone with all that was its.

So the kernel tells two students' processes, which run at the same time, apart as it tells two people apart.
"""

from __future__ import annotations

import os
import shutil
import signal
import socket
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from snr_sim.grading.lab.verdicts import LabFault

# What systemd keeps for services' users that come and go; within the 65536 that a container with a mapping has.
# Source: "Users, Groups, UIDs and GIDs on systemd Systems", systemd.io.
FIRST, LAST = 61184, 65519
_SHARED = ("/tmp", "/var/tmp", "/dev/shm")
_END_S = 5.0


class ThrowawayUser:
    """A user that no process and no other grader on this computer has; `close` gives it back.

    Raises:
        LabFault: there is none left.
    """

    def __init__(self) -> None:
        taken = {user for _, user in _processes()}
        for number in range(FIRST, LAST + 1):
            if number in taken or _is_known(number):
                continue
            claim = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
            try:
                claim.bind(f"\0snr_sim_user_{number}")  # one can have that name, until it ends
            except OSError:
                claim.close()
                continue
            self.number = number
            self._claim = claim
            return
        raise LabFault(
            f"All users from {FIRST} to {LAST} are in use, of which each confined process needs one.",
            fix="are processes of theirs left over? Look with `ps -eo uid,pid,cmd`.",
        )

    def close(self) -> None:
        """Ends what runs as this user, removes what it owns in shared folders, and gives it back.

        Raises:
            LabFault: one of its processes cannot be ended.
        """
        give_up_s = time.monotonic() + _END_S
        while left := [pid for pid, user in _processes() if user == self.number]:
            for pid in left:
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
            if time.monotonic() > give_up_s:
                raise LabFault(f"The process {left[0]} of a student's program cannot be ended.")
        for folder in _SHARED:
            _remove_of(self.number, Path(folder))
        self._claim.close()


def _is_known(number: int) -> bool:
    import pwd  # here, as `snr check` reads this file on Windows, too

    try:
        pwd.getpwuid(number)
    except KeyError:
        return False
    return True


def _processes() -> Iterator[tuple[int, int]]:
    """Yields number and user of each process that has not ended."""
    for name in filter(str.isdigit, os.listdir("/proc")):
        with suppress(OSError):
            status = Path("/proc", name, "status").read_bytes()
            if not status.partition(b"\nState:\t")[2].startswith(b"Z"):
                yield int(name), int(status.partition(b"\nUid:\t")[2].split(None, 1)[0])


def _remove_of(user: int, folder: Path) -> None:
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            with suppress(OSError):
                if entry.stat(follow_symlinks=False).st_uid != user:
                    continue
                if entry.is_dir(follow_symlinks=False):
                    shutil.rmtree(entry.path, ignore_errors=True)
                else:
                    os.unlink(entry.path)
