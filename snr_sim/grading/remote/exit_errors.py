"""Errors for a student's process that has ended, or that reports a failure of the student's program."""

from __future__ import annotations

import signal

from snr_sim.grading.lab.verdicts import SubmissionError
from snr_sim.grading.remote.protocol import TIME_UP_STATUS, RemoteFailure


def cpu_limit_error() -> SubmissionError:
    """Return the error for a process that has used up its CPU time or memory."""
    return SubmissionError(
        "It used up its CPU time or its memory, and was ended.",
        "Is there a loop without an end, or a list that grows?",
    )


def exit_error(status: int | None) -> SubmissionError:
    """Return the error for a process that ended instead of answering."""
    number = -status if status is not None and status < 0 else (status or 0) - 128
    name = signal.Signals(number).name if number in set(signal.Signals) else ""
    if name in ("SIGXCPU", "SIGPROF", "SIGKILL") or status == TIME_UP_STATUS:
        return cpu_limit_error()
    if name in ("SIGSEGV", "SIGABRT", "SIGBUS", "SIGFPE"):
        return SubmissionError(f"It crashed with {name}.", "Did it run out of memory?")
    return SubmissionError(
        f"It ended with exit status {status} instead of answering.",
        "Do not end the program: no exit() and no quit(). Return from your function instead.",
    )


def submission_error(failure: RemoteFailure) -> SubmissionError:
    """Return a failure that the child reports as an exception; the text is the student's program's."""
    text = f"{failure.text}\n  Try: {failure.fix}" if failure.fix else failure.text
    if failure.is_value:
        return SubmissionError(text, "Return numbers, texts, lists, or dicts of these.")
    hints = {
        "load": "Your file could not be read to its end: run it with Python, and look at the line named.",
        "slow": "That took too long: is there a loop without an end?",
    }
    names_a_line = ", line " in failure.text.partition("\n")[0]
    if failure.is_refused and not names_a_line and failure.step != "slow":
        return SubmissionError(
            text, "What your program gives there is not what is asked for: compare it with the lab's page."
        )
    return SubmissionError(text, hints.get(failure.step, "Your program raised an error: look at the line named."))
