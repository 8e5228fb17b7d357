"""The grader's side of a confined process: a user and a scratch folder of its own, and the count of files in it.

The second choice, after bubblewrap's namespaces, and for one place: root in a container that may not mount
(without CAP_SYS_ADMIN), as Gradescope's and Docker's ordinary ones are. What differs for a program in it: `/` is the
container's (asking whether a file is there is answered, opening it is refused), the folder to write in has the name
that `tempfile` gives, and holds fewer and shorter files.

The kernel bounds how long a file may be, and nothing but a file system bounds how many there are; a container's root
may not make one. So seccomp stops a process that makes a file until the grader has counted.
"""

from __future__ import annotations

import errno
import os
import shutil
import socket
import struct
import sys
import tempfile
from contextlib import suppress
from pathlib import Path

from snr_sim.grading.lab.verdicts import GraderError

# What systemd keeps for services' users that come and go; within the 65536 that a container with a mapping has.
# Source: "Users, Groups, UIDs and GIDs on systemd Systems", systemd.io.
FIRST_UID, LAST_UID = 61184, 65519
MAX_FILES = 16
FILE_BYTES = 1 << 20
# struct seccomp_notif begins with id and pid; struct seccomp_notif_resp: id, value, error, flags.
_NOTICE_BYTES, _ID, _REPLY = 80, struct.Struct("=Q"), struct.Struct("=QqiI")
_RECEIVE, _SEND = 0xC0502100, 0xC0182101  # SECCOMP_IOCTL_NOTIF_...
_CONTINUE = 1
_SYS_ADMIN = 21
_NEEDED = {"CAP_CHOWN": 0, "CAP_DAC_OVERRIDE": 1, "CAP_KILL": 5, "CAP_SETGID": 6, "CAP_SETUID": 7}


class Confiner:
    """Resources of one confined process. No other process or grader here has its user; `close` releases that.

    Raises:
        GraderError: there is no user left for it.
        OSError: there is no room for its folder.
    """

    user: int

    def __init__(self) -> None:
        self.user, self._claim = _claim_user()
        self.listener: int = -1  # where the process asks whether it may make a file, once it has sent that
        try:
            self.scratch: Path = Path(tempfile.mkdtemp(prefix="snr-scratch-"))
            os.chown(self.scratch, self.user, self.user)
        except OSError:
            self._claim.close()
            raise

    def answer(self) -> bool:
        """Answer a process that is about to open a file and would make it; return False if there is none any more."""
        import fcntl  # here, as `snr check` reads this file on Windows, too

        notice = bytearray(_NOTICE_BYTES)
        try:
            fcntl.ioctl(self.listener, _RECEIVE, notice)
            (number,) = _ID.unpack_from(notice)
            is_full = len(os.listdir(self.scratch)) >= MAX_FILES
            fcntl.ioctl(
                self.listener, _SEND, _REPLY.pack(number, 0, *((-errno.ENOSPC, 0) if is_full else (0, _CONTINUE)))
            )
        except OSError as error:
            return error.errno in (errno.EINTR, errno.ENOENT)  # it was interrupted, and asks again
        return True

    def close(self) -> None:
        """Remove the files of the process, which has ended."""
        if self.listener >= 0:
            with suppress(OSError):
                os.close(self.listener)
        shutil.rmtree(self.scratch, ignore_errors=True)
        self._claim.close()


def _claim_user() -> tuple[int, socket.socket]:
    """Return a user that no other grader here has, and what reserves it until it is closed."""
    import pwd  # as `fcntl` above

    for number in range(FIRST_UID, LAST_UID + 1):
        with suppress(KeyError):
            pwd.getpwuid(number)
            continue  # a service has it
        claim = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        try:
            claim.bind(f"\0snr_sim_user_{number}")  # one process can have that name, until it ends
        except OSError:
            claim.close()
            continue
        return number, claim
    raise GraderError(
        f"All users from {FIRST_UID} to {LAST_UID} are in use, of which each confined process needs one.",
        fix="end graders that are left over: `ps -eo uid,pid,cmd` lists them.",
    )


def is_root_without_mount() -> bool:
    """Return whether this process is root's in a container that may not mount."""
    return sys.platform == "linux" and os.geteuid() == 0 and not _effective_capabilities() >> _SYS_ADMIN & 1


def missing_capabilities() -> list[str]:
    """Return which of root's rights are missing that give a process to another user."""
    rights = _effective_capabilities()
    return [name for name, bit in _NEEDED.items() if not rights >> bit & 1]


def _effective_capabilities() -> int:
    status = Path("/proc/self/status").read_text()
    return int(status.partition("CapEff:")[2].split()[0], 16)
