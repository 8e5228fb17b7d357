"""Deadlines: who hangs, reported once, and what a corrupt table does."""

import math

import hypothesis.strategies as st
import pytest
from hypothesis import given

from snr_sim.prelude.errors import ParameterError, SupervisionError, UnknownNameError
from snr_sim.supervision.watch import PREVIOUS, Watch


def watch_of(**timeouts_s: float) -> Watch:
    """Watches names from time 0."""
    watch = Watch()
    for name, timeout_s in timeouts_s.items():
        watch.add(name, timeout_s, 0.0)
    return watch


def test_name_hangs_once_its_silence_is_its_timeout() -> None:
    watch = watch_of(drive=5.0, gps=2.0)
    assert watch.get_hanging(1.999) == []
    assert watch.get_hanging(2.0) == ["gps"]
    watch.pet("drive", 2.0)
    assert watch.get_hanging(6.999) == ["gps"]
    assert watch.get_hanging(7.0) == ["drive", "gps"]


def test_hang_is_taken_once_until_the_next_pet() -> None:
    watch = watch_of(gps=2.0)
    assert [watch.take_hanging(now_s) for now_s in (1.0, 2.0, 3.0, 100.0)] == [[], ["gps"], [], []]
    assert watch.get_hanging(100.0) == ["gps"]
    watch.pet("gps", 100.0)
    assert [watch.take_hanging(now_s) for now_s in (101.0, 102.5, 103.0)] == [[], ["gps"], []]


def test_extend_counts_the_silence_so_far_and_previous_restores_the_timeout() -> None:
    watch = watch_of(gps=2.0)
    watch.extend("gps", 20.0)
    assert watch.get_hanging(10.0) == []
    watch.extend("gps", PREVIOUS)
    # A counter that is compared by == with the timeout would have passed it already.
    assert watch.get_hanging(10.0) == ["gps"]


def test_previous_goes_back_one_change_and_not_further() -> None:
    watch = watch_of(gps=2.0)
    watch.extend("gps", PREVIOUS)
    assert watch.deadlines["gps"].timeout_s == 2.0
    watch.extend("gps", 10.0)
    watch.extend("gps", 20.0)
    watch.extend("gps", PREVIOUS)
    watch.extend("gps", PREVIOUS)
    assert watch.deadlines["gps"].timeout_s == 10.0


def test_extend_changes_one_name_only() -> None:
    watch = watch_of(gps=2.0, drive=2.0)
    watch.extend("gps", 9.0)
    assert watch.get_hanging(3.0) == ["drive"]


def test_reset_pets_all_names() -> None:
    watch = watch_of(gps=2.0, drive=3.0)
    assert watch.take_hanging(4.0) == ["gps", "drive"]
    watch.reset(4.0)
    assert watch.get_hanging(5.9) == []
    assert watch.take_hanging(7.0) == ["gps", "drive"]


def test_removed_name_never_hangs_and_starts_over_when_added_again() -> None:
    watch = watch_of(gps=2.0, drive=2.0)
    watch.extend("gps", 50.0)
    watch.remove("gps")
    assert watch.get_hanging(60.0) == ["drive"]
    watch.add("gps", 1.0, 60.0)
    watch.add("drive", 4.0, 60.0)
    assert watch.get_hanging(61.0) == ["gps"]
    watch.extend("gps", PREVIOUS)
    assert watch.deadlines["gps"].timeout_s == 1.0


def test_unknown_name_raises_with_the_nearest_known_one() -> None:
    watch = watch_of(navigation=2.0)
    with pytest.raises(UnknownNameError, match=r"'navigaton' is not watched\.\n.*'navigation'"):
        watch.pet("navigaton", 1.0)
    with pytest.raises(UnknownNameError, match="'navigaton' is not watched"):
        watch.extend("navigaton", 3.0)
    with pytest.raises(UnknownNameError):
        watch.remove("gps")


@pytest.mark.parametrize("timeout_s", [0.0, -1.0, math.nan, math.inf, "previous", None])
def test_timeout_that_is_not_positive_and_finite_raises_and_changes_nothing(timeout_s: float) -> None:
    watch = watch_of(gps=2.0)
    with pytest.raises(ParameterError, match="timeout of 'gps' must be positive"):
        watch.add("gps", timeout_s, 1.0)
    with pytest.raises(ParameterError, match="timeout of 'gps' must be positive"):
        watch.extend("gps", timeout_s)
    assert watch.get_hanging(2.0) == ["gps"]


@pytest.mark.parametrize(
    ("field", "value"),
    [("timeout_s", math.nan), ("timeout_s", "5"), ("timeout_s", 0), ("last_pet_s", math.nan), ("last_pet_s", 11.0)],
)
def test_corrupt_deadline_raises_supervision_error_with_its_name(field: str, value: object) -> None:
    watch = watch_of(drive=20.0, gps=20.0)
    setattr(watch.deadlines["gps"], field, value)
    with pytest.raises(SupervisionError, match="deadline of 'gps' is corrupt at 10"):
        watch.get_hanging(10.0)
    with pytest.raises(SupervisionError, match="deadline of 'gps' is corrupt"):
        watch.take_hanging(10.0)


STEPS = st.lists(st.tuples(st.sampled_from(["pet", "extend", "previous", "take"]), st.integers(1, 5)), max_size=30)


@given(steps=STEPS)
def test_each_silence_of_the_timeout_is_taken_exactly_once(steps: list[tuple[str, int]]) -> None:
    watch, now_s = watch_of(gps=3.0), 0.0
    timeouts_s, last_pet_s, taken = [3.0, 3.0], 0.0, 0
    for step, number in steps:
        if step == "pet":
            watch.pet("gps", now_s)
            last_pet_s, taken = now_s, 0
        elif step == "extend":
            watch.extend("gps", float(number))
            timeouts_s = [timeouts_s[1], float(number)]
        elif step == "previous":
            watch.extend("gps", PREVIOUS)
            timeouts_s = [timeouts_s[0], timeouts_s[0]]
        else:
            now_s += number
            hangs = watch.take_hanging(now_s)
            assert hangs == (["gps"] if now_s - last_pet_s >= timeouts_s[1] and not taken else [])
            taken += len(hangs)
