"""Results of submissions that could not be graded, and their messages."""

from collections.abc import Iterator

import pytest

from snr_sim.grading.batch import worker
from snr_sim.grading.batch.worker import Job, ungraded_result
from snr_sim.grading.reports.results import Isolation, RequestedIsolation
from snr_sim.grading.sandbox.sandbox import IsolationMissingError


@pytest.fixture(autouse=True)
def fresh_cache() -> Iterator[None]:
    worker._isolation_here.cache_clear()
    yield
    worker._isolation_here.cache_clear()


def isolation_of_rejected(requested: RequestedIsolation) -> Isolation:
    job = Job("ada", "assignments/01_double/checks.py", "private", b"", requested, "")
    return ungraded_result(job, "rejected", "It is empty.").isolation


def test_rejected_result_has_the_isolation_of_this_computer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(worker, "resolve_isolation", lambda requested: "confined")
    assert isolation_of_rejected("required") == "confined"


def test_rejected_result_without_isolation_is_sandbox(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(requested: RequestedIsolation) -> Isolation:
        raise IsolationMissingError("There is no bubblewrap.")

    monkeypatch.setattr(worker, "resolve_isolation", missing)
    assert isolation_of_rejected("required") == "sandbox"


def test_rejected_result_reports_disabled_isolation() -> None:
    assert isolation_of_rejected("none") == "none"
