"""SIGINT and SIGTERM while a grader works, waits and cleans up."""

import signal
from collections.abc import Iterator

import pytest

from snr_sim.grading.batch.stop_signals import StopSignals


@pytest.fixture(autouse=True)
def raising_handler() -> Iterator[None]:
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    yield
    signal.signal(signal.SIGTERM, before)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signal_is_deferred_until_the_end(number: signal.Signals) -> None:
    finished = []

    def work() -> None:
        with StopSignals():
            signal.raise_signal(number)
            finished.append(True)

    with pytest.raises(KeyboardInterrupt):
        work()
    assert finished


def test_signal_raises_where_interruptible() -> None:
    with StopSignals() as signals, pytest.raises(KeyboardInterrupt), signals.interruptible():
        signal.raise_signal(signal.SIGTERM)


def test_deferred_signal_raises_on_entering_interruptible() -> None:
    with StopSignals() as signals:
        signal.raise_signal(signal.SIGTERM)
        with pytest.raises(KeyboardInterrupt), signals.interruptible():
            raise AssertionError("the signal was still deferred")


def test_second_signal_does_not_interrupt_the_cleanup() -> None:
    cleaned_up = []

    def work() -> None:
        with StopSignals() as signals:
            try:
                with signals.interruptible():
                    signal.raise_signal(signal.SIGTERM)
            finally:
                signal.raise_signal(signal.SIGINT)
                cleaned_up.append(True)

    with pytest.raises(KeyboardInterrupt):
        work()
    assert cleaned_up


def test_handlers_are_restored() -> None:
    before = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
    with StopSignals():
        pass
    assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)] == before


def test_signal_without_a_python_handler_is_left_alone() -> None:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    with StopSignals():
        assert signal.getsignal(signal.SIGTERM) is signal.SIG_IGN
