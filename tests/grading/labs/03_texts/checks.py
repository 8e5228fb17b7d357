"""Has the checks of labs read each kind of text that students hand in; a number is doubled, too."""

from snr_sim.grading import Lab, Student, check, failed, passed
from snr_sim.grading.lab.lab import find_lab

READERS = {
    (lab, one.name): one
    for lab in ("08_sim_to_pi", "09_debug_by_replay", "10_lunar_lander_q", "12_live_programming")
    for one in find_lab(lab).checks
}


@check(points=50)
def doubles(student: Student):
    """Doubles a number."""
    if student.call("double.py", "double", 21, budget_s=1.0) != 42:
        return failed("Twice a number is the number added to itself.")
    return passed()


@check(points=10)
def toml(student: Student):
    """Findings are read."""
    return read(student, "09_debug_by_replay", "filled_in", 1)


@check(points=10)
def text(student: Student):
    """Answers are read."""
    return read(student, "08_sim_to_pi", "answered", 1)


@check(points=10)
def table(student: Student):
    """A table of numbers is read."""
    return read(student, "10_lunar_lander_q", "policy_file")


@check(points=10)
def program(student: Student):
    """A program in LRP is read."""
    return read(student, "12_live_programming", "is_program")


@check(points=10)
def edits(student: Student):
    """Edits are read, with the texts that they name."""
    return read(student, "12_live_programming", "edited_in_flight")


def read(student: Student, lab: str, name: str, *case: int):
    """Have the check of a lab read the submission; whatever it finds is all right here."""
    READERS[lab, name].function(student, *case)
    return passed()


lab = Lab("Texts", files=["double.py"], checks=[doubles, toml, text, table, program, edits])
