"""The record of a graded submission: the same bytes for the same result, and back again."""

import inspect
import json
from collections.abc import Callable
from typing import Any

import msgspec
import pytest

from snr_sim.grading.reports.results import CaseResult, CheckResult, Graded, decode_graded, encode_graded
from snr_sim.schemas import read_schema


def graded(**changes: object) -> Graded:
    cases = (
        CaseResult(label="1 m to 3 m", is_visible=True, fraction=1.0, metrics={"fuel_kg": 2.0, "a": 0.5}),
        CaseResult(label="hidden 1", is_visible=False, fraction=0.0, hint="Too deep.", metrics={"fuel_kg": 4.0}),
    )
    checks = (
        CheckResult(name="loads", title="Loads.", points=0.1, max_points=0.1),
        CheckResult(name="settles", title="Settles.", points=0.2, max_points=0.4, cases=cases),
    )
    whole = Graded(
        submission="ada", lab="02_depth_hold", title="Depth hold", checks=checks,
        isolation="sandbox", includes_hidden=True, version="0.1.0",
    )  # fmt: skip
    return msgspec.structs.replace(whole, **changes)


def test_encoded_record_round_trips_independent_of_metric_order() -> None:
    one = graded()
    turned = CaseResult(label="1 m to 3 m", is_visible=True, fraction=1.0, metrics={"a": 0.5, "fuel_kg": 2.0})
    cases = (turned, one.checks[1].cases[1])
    other = graded(checks=(one.checks[0], msgspec.structs.replace(one.checks[1], cases=cases)))
    assert encode_graded(one) == encode_graded(other)
    assert decode_graded(encode_graded(one)) == one


def test_points_are_rounded_after_summation() -> None:
    assert graded().points == 0.3


def test_grader_error_has_no_points_and_rejection_has_zero() -> None:
    assert graded(checks=(), status="grader_error", error="KeyError in checks.py").points is None
    assert graded(checks=(), status="rejected", error="It is empty.").points == 0.0


def test_metrics_are_means_over_cases() -> None:
    assert graded().metrics == {"settles.fuel_kg": 3.0, "settles.a": 0.5}


def test_skipped_check_without_points_is_not_passed() -> None:
    check = CheckResult(name="style", title="Style.", points=0.0, max_points=0.0)
    assert check.is_passed
    assert not msgspec.structs.replace(check, skipped_because="'loads' failed").is_passed


@pytest.mark.parametrize("text", [b"", b"{}", encode_graded(graded())[:-9], b'{"submission": 1}'])
def test_truncated_record_raises(text: bytes) -> None:
    with pytest.raises(msgspec.MsgspecError):
        decode_graded(text)


def test_shipped_schema_equals_the_record_schema(validator: Callable[..., Callable[[Any], bool]]) -> None:
    made = json.loads(json.dumps(msgspec.json.schema(Graded)))
    for definition in made["$defs"].values():
        definition["description"] = inspect.cleandoc(definition["description"])
    shipped = read_schema("graded")
    assert {name: shipped[name] for name in made} == made, "put it into snr_sim/schemas/graded.schema.json"
    fields = json.loads(encode_graded(graded()))
    is_valid = validator("graded")
    assert is_valid(fields)
    assert not is_valid(fields | {"more": 1})
    assert not is_valid(fields | {"status": "fine"})
