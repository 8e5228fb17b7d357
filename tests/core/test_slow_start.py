"""Student code that does not return before a run is reported with its line."""

import pytest

from snr_sim.core.standstill import REPORT_PERIOD_S, START_REPORT_AFTER_S, SlowStart


@pytest.mark.parametrize(
    ("seconds", "count"), [(START_REPORT_AFTER_S - 1.0, 0), (START_REPORT_AFTER_S + REPORT_PERIOD_S, 2)]
)
def test_code_that_does_not_return_is_reported_with_its_line(seconds: float, count: int) -> None:
    reports: list[str] = []
    now_s = 0.0

    def factories() -> None:
        nonlocal now_s
        while now_s <= seconds:
            watch.check()
            now_s += 0.5

    watch = SlowStart(lambda: now_s, report=reports.append)
    factories()
    assert len(reports) == count
    for report in reports:
        first, what, fix = report.splitlines()
        assert "test_slow_start.py, line 1" in first
        assert first.endswith(": watch.check()")
        assert what.startswith("  factories() has not returned for ")
        assert fix.startswith("  Try: what is at the top level of a file")


def test_code_that_returns_is_counted_from_its_next_call() -> None:
    reports: list[str] = []
    times = iter(range(0, 100, 4))
    watch = SlowStart(lambda: float(next(times)), report=reports.append)

    def step() -> None:
        watch.check()

    for _ in range(5):
        step()
        watch.check()  # not in student code: what calls it is left out
    assert reports == []
