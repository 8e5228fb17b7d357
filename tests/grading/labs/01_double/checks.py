"""What the grader tries a submission of the smallest lab on: a number is doubled."""

from snr_sim.grading import Lab, Student, check, failed, passed

from .grader.twice import twice


def draw(rng):
    return [rng.randrange(10, 10**6) for _ in range(1)]


@check(points=40)
def loads(student: Student):
    """Loads."""
    if student.call("double.py", "double", 1, budget_s=1.0) != 2:
        return failed("Try it by hand: double(1).")
    return passed()


@check(points=60, visible=[2], hidden=draw, needs=["loads"])
def doubles(student: Student, case: int):
    """Doubles a number."""
    if "13" in (student.folder / "double.py").read_text():
        raise KeyError("a mistake in the lab")
    got = student.call("double.py", "double", case, budget_s=1.0)
    if got == "nonsense":
        raise KeyError("a mistake that nonsense brings to light")
    if type(got) is not int or got != twice(case):
        return failed("Twice a number is the number added to itself.", expected=str(twice(case)), actual=str(got))
    return passed(metrics={"number": float(case)})


lab = Lab("Double", files=["double.py"], checks=[loads, doubles], leaderboard={"doubles.number": "desc"})
