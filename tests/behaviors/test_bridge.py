"""What a program reads and commands of its robot: names, limits of time, and that a robot that is held stays still."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from snr_sim.behaviors import Bridge, Drive, FixedPages, Read
from snr_sim.behaviors.bridge import Robot
from snr_sim.prelude.errors import ConfigError

DRIVES = {
    "left": Drive("motors", "l", -9, 9),
    "right": Drive("motors", "r", -9, 9),
    "lamp": Drive("lamp", "p", 0, 9, 1),
}
NEUTRAL = {"l": 0.0, "r": 0.0, "p": 1.0}


@pytest.mark.parametrize("name", ["stop", "class", "command", "take_tasks", "_x", "a-b", ""])
def test_part_with_a_name_of_python_or_of_robot_is_refused(name: str) -> None:
    with pytest.raises(ConfigError, match="cannot be named"):
        Bridge({name: Read("range")})


def fields(tasks: list[Any]) -> dict[str, float]:
    return {field: value for task in tasks for field, value in task.val_list[0].data.items()}


@given(st.lists(st.tuples(st.sampled_from([*DRIVES, "hold", "release", "undo"]), st.integers(0, 9))))
def test_robot_that_is_held_is_commanded_neutral_and_then_what_counts(words: list[tuple[str, int]]) -> None:
    robot = Robot(Bridge({}, DRIVES), FixedPages({}), lambda: 0.0)
    commanded, stored, is_held = dict(NEUTRAL), dict(NEUTRAL), False
    robot.mark()
    before = dict(commanded)
    for word, value in words:
        if word in DRIVES:
            getattr(robot, word).start(value)
            commanded[DRIVES[word].field] = float(value)
        elif word == "undo":
            robot.undo()
            commanded = dict(before)
        else:
            is_held = word == "hold"
            stored |= fields(robot.hold(is_held=is_held))
        if value == 9:
            stored |= fields(robot.take_tasks())
        if value == 9 or word in ("hold", "release"):  # neither comes within a block, whose commands are undone
            robot.mark()
            before = dict(commanded)
    stored |= fields(robot.take_tasks())
    assert stored == (NEUTRAL if is_held else commanded)


class OnePage(FixedPages):
    """One page, of some age. Implements Owner."""

    def __init__(self) -> None:
        super().__init__({"range": 7})
        self.age_s = 0.0

    def get_age_s(self, key: object) -> float:
        return self.age_s


@given(st.floats(0.0, 1e5), st.floats(2e-6, 100.0), st.booleans())
def test_reading_of_the_entry_itself_is_not_since_the_entry(entered_s: float, later_s: float, is_after: bool) -> None:
    """Also where the two differences of times are rounded differently."""
    owner, now_s = OnePage(), entered_s + later_s
    owner.age_s = now_s - (entered_s + later_s / 2.0 if is_after else entered_s)
    in_state_s = (round(now_s * 1e9) - round(entered_s * 1e9)) / 1e9
    robot = Robot(Bridge({"range": Read("range")}), owner, lambda: in_state_s)
    if later_s > 4e-6 or not is_after:
        assert robot.range.read_since_entry() == (7 if is_after else None)  # type: ignore[attr-defined]
