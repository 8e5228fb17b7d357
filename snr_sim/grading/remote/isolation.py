"""Which isolation of students' programs this computer has, found out by trying.

If bubblewrap starts a process, it is the "sandbox" (`sandbox.py`). If not, and the user is root who may not mount, a
process is "confined" by itself (`confinement.py`). Else official grading refuses, and reports what to install.
"""

from __future__ import annotations

import os
import tempfile
from functools import lru_cache
from pathlib import Path

import msgspec

from snr_sim.grading.lab.verdicts import LabFault
from snr_sim.grading.remote.child_process import ChildProcess
from snr_sim.grading.remote.protocol import Hello
from snr_sim.grading.reports.results import Isolation
from snr_sim.grading.sandbox.confiner import FIRST, LAST, is_for_here, missing_rights
from snr_sim.grading.sandbox.sandbox import (
    NOBODY,
    IsolationMissing,
    Limits,
    closed_to_others,
    find_bubblewrap,
    is_root,
)


@lru_cache(maxsize=1)
def find_isolation() -> Isolation:
    """Return the isolation of this computer: the sandbox wherever it works.

    Raises:
        IsolationMissing: there is none.
    """
    try:
        try_sandbox()
    except IsolationMissing as missing:
        if not is_for_here():
            raise
        try:
            try_confinement()
        except IsolationMissing as lacking:
            raise IsolationMissing(f"{missing.message} {lacking.message}", fix=f"{missing.fix} {lacking.fix}") from None
        return "confined"
    return "sandbox"


@lru_cache(maxsize=1)
def try_sandbox() -> None:
    """Start a process in the sandbox once, and check that it answers.

    Raises:
        IsolationMissing: it does not.
    """
    find_bubblewrap()
    user, words = _user_of_a_trial("sandbox")
    if user != NOBODY:
        raise forbidden(words or "the process in the sandbox is not nobody's")


@lru_cache(maxsize=1)
def try_confinement() -> None:
    """Start a confined process once, and check that it answers.

    Raises:
        IsolationMissing: it does not.
    """
    if missing := missing_rights():
        raise unconfined(f"root has no {missing[0]} here")
    if closed := closed_to_others():
        raise IsolationMissing(
            f"Nor can a program confine itself here: it is another user's, who may not enter {closed}, and Python, its "
            "packages or the kit are in there.",
            fix=f"Or have the environment elsewhere, as in /opt, or let others pass: chmod o+x {closed}",
        )
    user, words = _user_of_a_trial("confined")
    if user is None or not FIRST <= user <= LAST:
        raise unconfined(words or "the process is another user's than it should be")


def _user_of_a_trial(isolation: Isolation) -> tuple[int | None, str]:
    """Return the user of a process in this isolation, or its output if it failed."""
    with tempfile.TemporaryDirectory(prefix="snr-grading-") as name:
        os.chmod(name, 0o755)
        child = ChildProcess(Path(name), isolation, Limits())
        try:
            answer = child.ask(Hello(), 10.0)
        except LabFault as error:
            return None, child.printed or error.message
        finally:
            child.close()
    return msgspec.json.decode(answer.value), ""


def forbidden(words: str) -> IsolationMissing:
    """Return the error for a process that bubblewrap could not start."""
    _, is_seccomp, why = words.rpartition("SeccompMissing: ")
    if is_seccomp:
        return IsolationMissing(
            f"A sandbox needs seccomp filters besides, which are not to be had here: {why.strip()}.",
            fix="grade on Linux for x86-64 or aarch64, where the kernel and the container allow seccomp filters.",
        )
    if "setting up uid map" in words or "ermission" in words or "not permitted" in words:
        return IsolationMissing(
            f"This computer does not let bubblewrap make namespaces: {words.strip()}",
            fix="a container needs --privileged."
            if is_root()
            else "run the grader as root; or allow user namespaces, on Ubuntu: sysctl -w "
            "kernel.apparmor_restrict_unprivileged_userns=0",
        )
    return IsolationMissing(
        f"bubblewrap could not start Python: {words.strip()}",
        fix="bubblewrap must know its options: 0.5 or newer does."
        if "nknown option" in words
        else "Python and its packages must be readable for everybody; is part of them linked from elsewhere?",
    )


def unconfined(words: str) -> IsolationMissing:
    """Return the error for a process that could not confine itself: its last line has the reason."""
    reason = words.strip().rpartition("\n")[2]
    return IsolationMissing(
        f"Nor can a program confine itself here without namespaces: {reason}",
        fix="Or take a kernel with Landlock and seccomp (Linux 5.13 or newer), a container that allows their system "
        "calls, and a Python that everybody may read.",
    )
