"""The grader's side of a confined process: gives it a user and a scratch folder, and clears away what was its.

This is the second choice, after bubblewrap's namespaces, and for one place: root in a container that may not mount
(without CAP_SYS_ADMIN), as Gradescope's and Docker's ordinary ones are. What differs for a program in it: `/` is the
container's (asking whether a file is there is answered, opening it is refused), the folder to write in has the name
that `tempfile` gives, and holds fewer and shorter files.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path

from snr_sim.grading.sandbox.confinement import Walls
from snr_sim.grading.sandbox.scratch import Scratch
from snr_sim.grading.sandbox.throwaway_user import ThrowawayUser

_SYS_ADMIN = 21
_NEEDED = {"CAP_CHOWN": 0, "CAP_DAC_OVERRIDE": 1, "CAP_KILL": 5, "CAP_SETGID": 6, "CAP_SETUID": 7}


class Confiner:
    """What one confined process is given.

    Raises:
        LabFault: there is no user left for it.
        OSError: there is no room for its folder.
    """

    def __init__(self) -> None:
        self._user = ThrowawayUser()
        try:
            self.scratch = Scratch(self._user.number)
        except OSError:
            self._user.close()
            raise

    def walls(self, readable: Sequence[Path], hidden: Path) -> Walls:
        """Returns what the process is told: what it may read, but for a folder in it."""
        return Walls(self._user.number, tuple(map(str, readable)), str(hidden), str(self.scratch.folder))

    def close(self) -> None:
        """Clears away whatever was the process', which has ended.

        Raises:
            LabFault: something of it cannot be ended.
        """
        self.scratch.close()
        self._user.close()


def is_for_here() -> bool:
    """Returns whether this process is root's in a container that may not mount."""
    return sys.platform == "linux" and os.geteuid() == 0 and not _rights() >> _SYS_ADMIN & 1


def missing_rights() -> list[str]:
    """Returns which of root's rights are missing that give a process to another user."""
    rights = _rights()
    return [name for name, bit in _NEEDED.items() if not rights >> bit & 1]


def _rights() -> int:
    status = Path("/proc/self/status").read_text()
    return int(status.partition("CapEff:")[2].split()[0], 16)
