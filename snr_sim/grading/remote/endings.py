"""Errors for a student's process that has ended, or that reports a failure of the student's program."""

from __future__ import annotations

import signal

from snr_sim.grading.lab.verdicts import Misbehaved
from snr_sim.grading.remote.protocol import TIME_UP_STATUS, Said


def spent() -> Misbehaved:
    """Return the error for a process that has used up its CPU time or memory."""
    return Misbehaved(
        "It used up its CPU time or its memory, and was ended.",
        "Is there a loop without an end, or a list that grows?",
    )


def ended_badly(status: int | None) -> Misbehaved:
    """Return the error for a process that ended instead of answering."""
    number = -status if status is not None and status < 0 else (status or 0) - 128
    name = signal.Signals(number).name if number in set(signal.Signals) else ""
    if name in ("SIGXCPU", "SIGPROF", "SIGKILL") or status == TIME_UP_STATUS:
        return spent()
    if name in ("SIGSEGV", "SIGABRT", "SIGBUS", "SIGFPE"):
        return Misbehaved(f"It crashed with {name}.", "Did it run out of memory?")
    return Misbehaved(
        f"It ended with exit status {status} instead of answering.",
        "Do not end the program: no exit() and no quit(). Return from your function instead.",
    )


def misbehaved(said: Said) -> Misbehaved:
    """Return a failure that the child reports as an exception; the text is the student's program's."""
    text = f"{said.text}\n  Try: {said.fix}" if said.fix else said.text
    if said.is_value:
        return Misbehaved(text, "Return numbers, texts, lists, or dicts of these.")
    hints = {
        "load": "Your file could not be read to its end: run it with Python, and look at the line named.",
        "slow": "That took too long: is there a loop without an end?",
    }
    names_a_line = ", line " in said.text.partition("\n")[0]
    if said.is_refused and not names_a_line and said.step != "slow":
        return Misbehaved(
            text, "What your program gives there is not what is asked for: compare it with the lab's page."
        )
    return Misbehaved(text, hints.get(said.step, "Your program raised an error: look at the line named."))
