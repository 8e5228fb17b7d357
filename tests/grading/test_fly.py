"""A flight with the student's components in a process of their own is the flight that `snr run` makes."""

import shutil
from pathlib import Path

import pytest

from snr_sim.flight import Flight
from snr_sim.grading.student import Student
from snr_sim.recording.reader import read_trace
from snr_sim.recording.trace import FILE_NAME, TraceWriter
from snr_sim.simulation import Request, prepare

ROBOTS = Path(__file__).parents[2] / "robots"
SCENARIOS = Path(__file__).parents[2] / "scenarios"
SHORT = """
def verdict(plant: Watched) -> Verdict | None:
    return Verdict("over", True) if plant.time_s > 5.0 else None

def metrics(plant: Watched, seed: int) -> dict[str, Any]:
    return {}
"""


def digest_of_run(folder: Path, request: Request) -> str:
    """The digest of a run without a grader."""
    simulation = prepare(request)
    plant = simulation.plant()
    config = simulation.config(plant)
    recorder = TraceWriter(folder / FILE_NAME, simulation.header(plant, config), simulation.opening())
    Flight(simulation, plant, config, recorder).run()
    recorder.close()
    return recorder.digest


@pytest.mark.parametrize(
    ("scenario", "controller"),
    [
        ("lander_vertical", "lander/controllers/coast.py"),
        ("lander_vertical", "lander/controllers/optimal.py"),
        ("lander_pad", "lander/controllers/pad.py"),
        ("urov_depth_hold", "urov/controllers/holds.py"),
    ],
)
def test_a_flight_has_the_same_trace_as_a_run_to_the_last_bit(scenario: str, controller: str, tmp_path: Path) -> None:
    if scenario.startswith("urov"):  # the first seconds are enough: it is armed, and the link is up
        text = (SCENARIOS / f"{scenario}.py").read_text() + SHORT
        scenario = str(tmp_path / "urov_short.py")
        Path(scenario).write_text(text)
    submission = tmp_path / "submission"
    submission.mkdir()
    file = Path(shutil.copy(ROBOTS / controller, submission)).name
    flown = Student(submission, record_to=tmp_path / "runs").fly(scenario, 3, file)
    assert flown.folder is not None
    digest = read_trace(flown.folder / FILE_NAME).digest
    assert digest == digest_of_run(tmp_path, Request(scenario, seed=3, controller=str(submission / file)))
