"""Result of a setup on another thread (`Trial`): no thread waits indefinitely, and no failure is lost in between."""

import threading

import pytest

from snr_sim.core.reload.trial import Trial
from snr_sim.prelude.errors import ComponentFailed


@pytest.mark.slow
def test_whoever_waits_is_told_of_the_failure_and_the_other_side_that_it_was_heard() -> None:
    trial, failure = Trial(), ComponentFailed("no port")
    heard: list[bool] = []
    thread = threading.Thread(target=lambda: heard.append(trial.report(failure)))
    thread.start()
    assert trial.wait(30.0) is failure
    thread.join()
    assert heard == [True]


def test_a_setup_that_works_is_told_too_and_what_fails_later_is_not_heard() -> None:
    trial = Trial()
    assert trial.report(None)
    assert trial.wait(30.0) is None
    assert not trial.report(ComponentFailed("later"))


def test_a_failure_after_the_patience_is_not_heard_so_that_the_node_has_to_be_told() -> None:
    trial = Trial()
    assert trial.wait(0.0) is None
    assert not trial.report(ComponentFailed("late"))
