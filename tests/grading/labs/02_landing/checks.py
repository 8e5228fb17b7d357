"""What the grader tries a submission of the smallest lab with a flight on: it lands."""

from snr_sim.grading import Lab, Student, check, failed, passed


def draw(rng):
    return [rng.getrandbits(63)]


@check(points=100, visible=[4], hidden=draw)
def lands(student: Student, seed: int):
    """Lands."""
    run = student.run_scenario("lander_vertical", seed, "pilot.py")
    if not run.success:
        return failed("Brake earlier.", actual=run.outcome)
    return passed(metrics={"sim_time_s": run.sim_time_s})


lab = Lab("Landing", files=["pilot.py"], checks=[lands])
