"""Result of a setup on another thread: no thread waits indefinitely, and no failure is lost in between."""

import threading

import pytest

from snr_sim.core.loop import SetupResult
from snr_sim.prelude.errors import ComponentFailedError


@pytest.mark.slow
def test_setup_result_wait_returns_failure() -> None:
    setup_result, failure = SetupResult(), ComponentFailedError("no port")
    answers: list[bool] = []
    thread = threading.Thread(target=lambda: answers.append(setup_result.set_result(failure)))
    thread.start()
    assert setup_result.wait(30.0) is failure
    thread.join()
    assert answers == [True]


def test_setup_result_returns_success_and_rejects_later_failure() -> None:
    setup_result = SetupResult()
    assert setup_result.set_result(None)
    assert setup_result.wait(30.0) is None
    assert not setup_result.set_result(ComponentFailedError("later"))


def test_setup_result_rejects_failure_after_timeout() -> None:
    setup_result = SetupResult()
    assert setup_result.wait(0.0) is None
    assert not setup_result.set_result(ComponentFailedError("late"))
