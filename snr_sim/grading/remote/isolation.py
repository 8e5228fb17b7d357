"""Which isolation of students' programs this computer has, found out by trying.

If bubblewrap starts a process, it is the "sandbox" (`sandbox.py`). If not, and the user is root who may not mount, a
process is "confined" by itself (`confinement.py`). Else official grading refuses, and reports what to install.
"""

from __future__ import annotations

import tempfile
from functools import lru_cache
from pathlib import Path

import msgspec

from snr_sim.grading.lab.verdicts import GraderError
from snr_sim.grading.remote.protocol import Hello
from snr_sim.grading.remote.student_process import StudentProcess
from snr_sim.grading.reports.results import Isolation
from snr_sim.grading.sandbox.confiner import FIRST_UID, LAST_UID, is_root_without_mount, missing_capabilities
from snr_sim.grading.sandbox.sandbox import (
    NOBODY,
    IsolationMissingError,
    Limits,
    find_bubblewrap,
    find_private_folder,
    is_root,
)


@lru_cache(maxsize=1)
def find_isolation() -> Isolation:
    """Return this computer's isolation: the sandbox wherever it works; raise IsolationMissingError if there is none."""
    try:
        try_sandbox()
    except IsolationMissingError as missing:
        if not is_root_without_mount():
            raise
        try:
            try_confinement()
        except IsolationMissingError as no_confinement:
            raise IsolationMissingError(
                f"{missing.message} {no_confinement.message}", fix=f"{missing.fix} {no_confinement.fix}"
            ) from None
        return "confined"
    return "sandbox"


@lru_cache(maxsize=1)
def try_sandbox() -> None:
    """Start a process in the sandbox once, and check that it answers; raise IsolationMissingError if it does not."""
    find_bubblewrap()
    user, words = _try_isolation("sandbox")
    if user != NOBODY:
        raise bubblewrap_error(words or "the process in the sandbox does not run as the unprivileged user")


@lru_cache(maxsize=1)
def try_confinement() -> None:
    """Start a confined process once, and check that it answers; raise IsolationMissingError if it does not."""
    if missing := missing_capabilities():
        raise confinement_error(f"root has no {missing[0]} here")
    if closed := find_private_folder():
        raise IsolationMissingError(
            f"Nor can a program confine itself here: it is another user's, who may not enter {closed}, and Python, its "
            "packages or the kit are in there.",
            fix=f"Or have the environment elsewhere, as in /opt, or let others pass: chmod o+x {closed}",
        )
    user, words = _try_isolation("confined")
    if user is None or not FIRST_UID <= user <= LAST_UID:
        raise confinement_error(words or "the process is another user's than it should be")


def _try_isolation(isolation: Isolation) -> tuple[int | None, str]:
    """Return the user of a process in this isolation, or its output if it failed."""
    with tempfile.TemporaryDirectory(prefix="snr-grading-") as name:
        Path(name).chmod(0o755)
        child = StudentProcess(Path(name), isolation, Limits())
        try:
            answer = child.ask(Hello(), 10.0)
        except GraderError as error:
            return None, child.printed or error.message
        finally:
            child.close()
    return msgspec.json.decode(answer.value), ""


def bubblewrap_error(words: str) -> IsolationMissingError:
    """Return the error for a process that bubblewrap could not start."""
    _, is_seccomp, reason = words.rpartition("SeccompMissingError: ")
    if is_seccomp:
        return IsolationMissingError(
            f"A sandbox also needs seccomp filters, which are not available here: {reason.strip()}.",
            fix="grade on Linux for x86-64 or aarch64, where the kernel and the container allow seccomp filters.",
        )
    if "setting up uid map" in words or "ermission" in words or "not permitted" in words:
        return IsolationMissingError(
            f"This computer does not allow bubblewrap to create namespaces: {words.strip()}",
            fix="a container needs --privileged."
            if is_root()
            else "run the grader as root; or allow user namespaces, on Ubuntu: sysctl -w "
            "kernel.apparmor_restrict_unprivileged_userns=0",
        )
    return IsolationMissingError(
        f"bubblewrap could not start Python: {words.strip()}",
        fix="bubblewrap must know its options: 0.5 or newer does."
        if "nknown option" in words
        else "Python and its packages must be readable by all users; is part of them linked from elsewhere?",
    )


def confinement_error(words: str) -> IsolationMissingError:
    """Return the error for a process that could not confine itself: its last line has the reason."""
    reason = words.strip().rpartition("\n")[2]
    return IsolationMissingError(
        f"Nor can a program confine itself here without namespaces: {reason}",
        fix="Or take a kernel with Landlock and seccomp (Linux 5.13 or newer), a container that allows their system "
        "calls, and a Python that all users can read.",
    )
