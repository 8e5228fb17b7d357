"""Recorded against replayed values: what differs is named by its path, and what is tolerated by name passes."""

import math
from typing import Any

import numpy as np
import pytest

from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.task import Page
from snr_sim.prelude.values import encode_value
from snr_sim.recording.compare import Difference, Tolerance, first_difference, only_reordered


def page(data: Any, **about: Any) -> bytes:
    return b"[" + Page("imu", data, **{"origin": "r_node", "created_at_s": 0.5, **about}).serialize() + b"]"


def difference(recorded: Any, replayed: Any, *tolerances: str) -> Difference | None:
    parsed = [Tolerance.parse(text) for text in tolerances]
    return first_difference("imu", "store_page", page(recorded), page(replayed), parsed)


# (recorded, replayed, tolerances, path of the first difference that remains or None)
CRAFTED: list[tuple[Any, Any, list[str], str | None]] = [
    ({"a": 1.0, "b": 2.0}, {"b": 2.0, "a": 1.0}, [], None),
    (0.1 + 0.2, 0.3, [], "imu"),
    (0.1 + 0.2, 0.3, ["imu=1e-15"], None),
    ({"a": 100.0}, {"a": 100.1}, ["imu.a=0.2%"], None),
    ({"a": 100.0}, {"a": 100.3}, ["imu.a=0.2%"], "imu.a"),
    ({"a": -100.0}, {"a": -100.1}, ["imu.a=0.2%"], None),
    ({"a": 1.0, "b": 1.0}, {"a": 1.1, "b": 1.1}, ["imu.a=ignore"], "imu.b"),
    ({"a": [0.0, 1.0, 2.0]}, {"a": [0.0, 1.5, 2.5]}, [], "imu.a[1]"),
    ({"a": [0.0, 1.0, 2.0]}, {"a": [0.0, 1.5, 2.5]}, ["imu.a[1]=ignore"], "imu.a[2]"),
    ({"a": [0.0, 1.0]}, {"a": [0.5, 1.5]}, ["imu.a[?]=0.6"], None),
    ({"a": [0.0, 1.0]}, {"a": [0.0]}, ["*=1e9"], "imu.a[1]"),
    ({"a": 1.0}, {"a": 1.0, "b": 0.0}, ["imu.a=1"], "imu.b"),
    ({"a": 1.0}, {"a": 1}, ["*=5"], None),
    ({"a": 1}, {"a": 1.0}, [], "imu.a"),
    ({"a": 1}, {"a": True}, ["*=5"], "imu.a"),
    ({"a": 1.0}, {"a": "1.0"}, ["*=5"], "imu.a"),
    ({"a": 1.0}, {"a": "1.0"}, ["*=ignore"], None),
    ({"a": 0.0}, {"a": -0.0}, [], "imu.a"),
    ({"a": math.nan}, {"a": math.nan}, [], None),
    ({"a": math.inf}, {"a": 1e300}, ["*=1e308"], "imu.a"),
    ({"a": 1.0}, {"a": math.nan}, ["*=100%"], "imu.a"),
    ([1, 2], (1, 2), [], "imu"),
    (np.array([1.0, 2.0]), np.array([1.0, 2.5]), [], "imu[1]"),
    (np.array([1.0, 2.0]), np.array([1.0, 2.5]), ["imu[*]=1"], None),
    (np.array([1.0, 2.0]), np.array([1.0, 2.0], np.float32), [], "imu"),
    (np.zeros(500), np.full(500, 1e-9), ["imu*=1e-6"], None),
    (np.zeros(500), np.eye(500)[7], ["imu*=1e-6"], "imu[7]"),
    (np.zeros((2, 2)), np.array([[0.0, 0.0], [0.0, 1.0]]), [], "imu[1][1]"),
    (np.zeros(2), np.zeros(3), ["*=9"], "imu"),
    (2**70, 2**70 + 1, [], "imu"),
    (b"abc", b"abd", [], "imu"),
]


@pytest.mark.parametrize(("recorded", "replayed", "tolerances", "path"), CRAFTED)
def test_first_difference_returns_first_path_outside_tolerances(
    recorded: Any, replayed: Any, tolerances: list[str], path: str | None
) -> None:
    found = difference(recorded, replayed, *tolerances)
    assert (None if found is None else found.field) == path


def test_difference_shows_values_in_python_syntax() -> None:
    assert difference({"a": 0.5}, {"a": math.inf}) == Difference("imu.a", 0.5, math.inf)
    found = difference({"a": 0.5}, {"a": math.nan})
    assert found is not None
    assert repr(found.replayed) == "nan"
    assert difference([1], (1,)) == Difference("imu", [1], (1,))


def test_page_attributes_outside_data_are_compared() -> None:
    found = first_difference("imu", "store_page", page(1.0), page(1.0, created_at_s=0.75))
    assert found == Difference("imu:created_at_s", 0.5, 0.75)
    found = first_difference("imu", "store_page", page(1.0), page(1.0, process=False))
    assert found == Difference("imu:process", True, False)


def test_event_values_are_named_by_index() -> None:
    recorded, replayed = encode_value([1, {"x": 2}]), encode_value([1, {"x": 3}])
    assert first_difference("go", "event", recorded, replayed) == Difference("go[1].x", 2, 3)


@pytest.mark.parametrize("text", ["", "imu", "=1", "imu=", "imu=much", "imu=-1", "imu=nan", "imu=-2%"])
def test_tolerance_parse_of_invalid_text_raises_with_example(text: str) -> None:
    with pytest.raises(ParameterError, match="engine"):
        Tolerance.parse(text)


def test_tolerance_parse_accepts_equals_sign_in_path() -> None:
    assert Tolerance.parse("a=b=1e-3") == Tolerance("a=b", absolute=1e-3)


@pytest.mark.parametrize(
    ("recorded", "replayed", "expected"),
    [
        ([b"[1,2]"], [b"[2,1]"], True),
        ([b"[1]", b"[2]"], [b"[2]", b"[1]"], True),
        ([b'{"a":[{"b":["x","y"]}]}'], [b'{"a":[{"b":["y","x"]}]}'], True),
        ([b"[1,2]"], [b"[1,2]"], False),
        ([b"[1,2]"], [b"[1,3]"], False),
        ([b"[1,2,2]"], [b"[1,1,2]"], False),
        ([b"[1,2]"], [b"[2,1.0]"], False),
        ([b'{"a":1,"b":2}'], [b'{"a":2,"b":1}'], False),
        ([b"[1]"], [b"[1]", b"[1]"], False),
    ],
)
def test_only_reordered_distinguishes_order_from_values(
    recorded: list[bytes], replayed: list[bytes], expected: bool
) -> None:
    assert only_reordered(recorded, replayed) is expected
