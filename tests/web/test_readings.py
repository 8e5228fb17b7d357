"""Readings and commands as pages show them: converted, shortened, with ages and delays; nothing makes them fail."""

from __future__ import annotations

import math
from typing import Any

import pytest

from snr_sim.behaviors import Bridge, Drive, Read
from snr_sim.prelude.task import Page
from snr_sim.web.readings import commands_of, pages_of, readings_of, shown

BRIDGE = Bridge(
    {"near": Read("range", "distance_m", to=lambda m: 100.0 * m), "whole": Read("range", fresh_s=0.5)},
    {"left": Drive("motors", "a", -1.0, 1.0)},
)


def reading(data: Any, name: str = "near", age_s: float = 0.1) -> Any:
    page = None if data is None else Page("range", data, "r", 0.0)
    return readings_of(BRIDGE, (), {"range": page}.get, lambda one: age_s)[name]


def test_reading_is_converted_and_has_its_age_and_limit() -> None:
    assert (reading({"distance_m": 0.5}).value, reading({"distance_m": 0.5}).age_s) == (50.0, 0.1)
    assert reading({"distance_m": 0.5}).limit_s is None
    assert reading({"distance_m": 0.5}, "whole").limit_s == 0.5


def test_reading_without_a_page_is_null() -> None:
    assert (reading(None).value, reading(None).age_s) == (None, None)


def test_unknown_age_is_null() -> None:
    assert reading({"distance_m": 0.5}, age_s=math.inf).age_s is None


@pytest.mark.parametrize(
    ("data", "text"), [({"other": 1}, "KeyError: 'distance_m'"), (5, "TypeError"), ({"distance_m": "x"}, "TypeError")]
)
def test_page_with_other_content_is_shown_as_the_error(data: Any, text: str) -> None:
    assert reading(data).value.startswith(text)


def test_fields_of_pages_are_shown_without_a_bridge() -> None:
    pages = {"a": Page("a", {"x": 1, "y": math.nan}, "r", 0.0), "b": Page("b", 7, "r", 0.0)}
    found = readings_of(None, ["a", "b", "c"], pages.get, lambda one: 0.0)
    assert {name: one.value for name, one in found.items()} == {"a.x": 1, "a.y": "nan", "b": 7, "c": None}


def test_command_has_its_value_and_the_delay_until_it_was_applied() -> None:
    pages = {"motors": Page("motors", {"a": 0.5}, "r", 0.0)}
    assert commands_of(BRIDGE, pages.get)["left"].delay_s is None
    pages["motors_applied"] = Page("motors_applied", {"delay_s": 0.12}, "r", 0.0)
    command = commands_of(BRIDGE, pages.get)["left"]
    assert (command.value, command.delay_s) == (0.5, 0.12)
    pages["motors_applied"] = Page("motors_applied", {"delay_s": "late"}, "r", 0.0)
    assert commands_of(BRIDGE, pages.get)["left"].delay_s is None
    assert commands_of(BRIDGE, {}.get)["left"].value is None


def test_all_pages_that_are_read_are_listed_once() -> None:
    assert pages_of(BRIDGE) == ["range", "motors", "motors_applied"]
    assert pages_of(None) == []


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (None, None),
        (True, True),
        (2**53, 2**53),
        (2**53 + 1, "9007199254740993"),
        (-math.inf, "-inf"),
        ((1, (2.5, "a")), [1, [2.5, "a"]]),
        ([1] * 101, [1] * 100 + ["..."]),
        ([[[[[1]]]]], [[[["[1]"]]]]),
        ("b" * 1001, "b" * 997 + "..."),
        ({"a": 1}, "{'a': 1}"),
    ],
)
def test_value_is_shown_as_json_and_shortened(value: Any, expected: Any) -> None:
    assert shown(value) == expected
