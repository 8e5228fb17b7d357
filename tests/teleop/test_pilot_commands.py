"""Commands of a pilot where they arrive: valid ones, their order, the emergency stop, and who commands."""

import math
from typing import Any

import msgspec
import pytest

from snr_sim.prelude.errors import CommandError, ParameterError, UnknownNameError
from snr_sim.teleop.pilot_commands import NewestControls, pilot_of, read_controls


class Drive(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Controls of a rover."""

    number: int = 0
    mode: str = "speed"
    is_armed: bool = False
    is_stop: bool = False
    clears_stop: bool = False
    ahead: float = 0.0


def read(data: Any) -> Drive:
    return read_controls(Drive, data, ("speed", "duty"), ["ahead"])


@pytest.fixture
def newest() -> NewestControls[Drive]:
    return NewestControls(Drive(), restart_s=0.25)


def test_page_becomes_controls() -> None:
    assert read({"number": 3, "ahead": -1.0}) == Drive(number=3, ahead=-1.0)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({"aheat": 0.5}, "page 'controls' is invalid.*aheat"),
        (None, "page 'controls' is invalid"),
        ({"ahead": 1.01}, "Stick 'ahead' must be in -1 to 1, not 1.01"),
        ({"ahead": math.nan}, "Stick 'ahead' must be in -1 to 1, not nan"),
    ],
)
def test_page_that_holds_no_controls_is_refused(data: Any, message: str) -> None:
    with pytest.raises(CommandError, match=message):
        read(data)


def test_unknown_mode_is_refused_with_the_nearest_one() -> None:
    with pytest.raises(UnknownNameError, match=r"no mode 'sped'(.|\n)*speed"):
        read({"mode": "sped"})


def test_controls_that_were_overtaken_do_not_count(newest: NewestControls[Drive]) -> None:
    assert newest.age_s(1.0) is None
    assert newest.take(Drive(number=5, ahead=0.5), 1.0)
    assert not newest.take(Drive(number=4, ahead=0.1), 1.2)
    assert (newest.controls.ahead, newest.controls_s) == (0.5, 1.0)
    assert newest.age_s(1.5) == 0.5


def test_any_number_counts_after_a_silence(newest: NewestControls[Drive]) -> None:
    newest.take(Drive(number=500), 1.0)
    assert newest.take(Drive(number=1, ahead=0.3), 1.3)
    assert newest.controls.ahead == 0.3


def test_stop_counts_in_any_order_until_disarmed_controls_clear_it(newest: NewestControls[Drive]) -> None:
    newest.take(Drive(number=5), 1.0)
    newest.take(Drive(number=2, is_stop=True), 1.1)
    assert newest.is_stopped
    newest.take(Drive(number=6, is_armed=True, clears_stop=True), 1.2)
    newest.take(Drive(number=7, is_stop=True, clears_stop=True), 1.3)
    assert newest.is_stopped
    newest.take(Drive(number=8, clears_stop=True), 1.4)
    assert not newest.is_stopped


def test_pilot_is_scripted_unless_a_person_is_asked_for() -> None:
    assert (pilot_of({}), pilot_of({"pilot": "manual", "deadman": "yes"})) == ("scripted", "manual")
    with pytest.raises(UnknownNameError, match="no such pilot"):
        pilot_of({"pilot": "manuel"})
    with pytest.raises(UnknownNameError, match="yes or no, not on"):
        pilot_of({"pilot": "manual", "deadman": "on"})
    with pytest.raises(ParameterError, match="requires pilot=manual"):
        pilot_of({"deadman": "yes"})
