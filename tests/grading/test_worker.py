"""Results of submissions that could not be graded, and their messages."""

from collections.abc import Iterator

import pytest

from snr_sim.grading.batch import worker
from snr_sim.grading.batch.worker import Job, without_marks
from snr_sim.grading.reports.results import Demanded, Isolation
from snr_sim.grading.sandbox.sandbox import IsolationMissing


@pytest.fixture(autouse=True)
def looked_up_anew() -> Iterator[None]:
    worker._kept_here.cache_clear()
    yield
    worker._kept_here.cache_clear()


def isolation_of_a_refused_one(demanded: Demanded) -> Isolation:
    job = Job("ada", "assignments/01_double/checks.py", "private", b"", demanded, "")
    return without_marks(job, "refused", "It is empty.").isolation


def test_what_was_refused_says_how_programs_are_kept_here(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(worker, "sandboxed", lambda demanded: "confined")
    assert isolation_of_a_refused_one("required") == "confined"


def test_where_programs_cannot_be_kept_apart_it_says_what_was_wanted(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(demanded: Demanded) -> Isolation:
        raise IsolationMissing("There is no bubblewrap.")

    monkeypatch.setattr(worker, "sandboxed", missing)
    assert isolation_of_a_refused_one("required") == "sandbox"


def test_without_isolation_it_says_so() -> None:
    assert isolation_of_a_refused_one("none") == "none"
