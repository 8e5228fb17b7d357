"""Messages between grader and child: bounded in depth, plain, and cheap."""

import json
import resource
import time
from contextlib import suppress
from pathlib import Path

import msgspec
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from snr_sim.grading import Student
from snr_sim.grading.lab.verdicts import SubmissionError
from snr_sim.grading.remote.protocol import MAX_DEPTH, ProtocolError, check_cost, decode_response, plain_value

VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=20,
)


def depth_of(value: object) -> int:
    if isinstance(value, dict):
        return 1 + max(map(depth_of, value.values()), default=0)
    return 1 + max(map(depth_of, value), default=0) if isinstance(value, list) else 0


@given(VALUES, st.integers(0, 40), st.text(alphabet='[]{}"\\', max_size=60))
def test_check_cost_rejects_exactly_too_deep_values(value: object, more: int, text: str) -> None:
    value = [value, text]
    for _ in range(more):
        value = [value]
    data = json.dumps(value).encode()
    if depth_of(value) > MAX_DEPTH:
        with pytest.raises(ProtocolError):
            check_cost(data)
    else:
        check_cost(data)


def test_numbers_that_are_slow_to_decode_are_refused() -> None:
    with pytest.raises(ProtocolError, match="More than 1000 numbers are beyond 1e99"):
        check_cost(b"[" + b"1e300," * 1001 + b"1]")
    check_cost(b"[" + b"1e300," * 1000 + b"1]")


@given(st.binary(max_size=60))
@example(b'"\x80"')
def test_invalid_bytes_raise_only_protocol_error(data: bytes) -> None:
    for read in (decode_response, lambda raw: plain_value(msgspec.Raw(raw))):
        with suppress(ProtocolError):
            read(data)


@pytest.fixture
def student(tmp_path: Path) -> Student:
    (tmp_path / "mine.py").write_text(
        "import resource\n\n\n"
        "def same(x):\n    return x\n\n\n"
        "def of(text):\n    import numpy\n    return eval(text, {'numpy': numpy})\n\n\n"
        "def zeros(x):\n    return [0] * len(x)\n\n\n"
        "def cpu_s():\n    used = resource.getrusage(resource.RUSAGE_SELF)\n    return used.ru_utime + used.ru_stime\n"
    )
    return Student(tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("(1, 2.5)", [1, 2.5]),
        ("numpy.array([[1, 2]])", [[1, 2]]),
        ("numpy.float64(0.1)", 0.1),
        ("{'a': (True, None)}", {"a": [True, None]}),
        ("2**70", 2**70),
        ("'$'", "$"),
        ("{'$': 'float', 'v': 'nan'}", {"$": "float", "v": "nan"}),
    ],
)
def test_values_return_as_plain_json_types(student: Student, text: str, value: object) -> None:
    with student:
        got = student.call("mine.py", "of", text)
    assert got == value
    assert type(got) is type(value)


@pytest.mark.slow
def test_tuples_and_non_finite_numbers_are_passed(student: Student) -> None:
    with student:
        assert student.call("mine.py", "same", (1, 2)) == [1, 2]
        assert student.call("mine.py", "same", [float("inf")], finite=False) == [float("inf")]
        with pytest.raises(SubmissionError, match="returned inf among its numbers"):
            student.call("mine.py", "same", [float("inf")])


@pytest.mark.slow
def test_result_of_another_type_raises_submission_error(student: Student) -> None:
    with student:
        assert student.call("mine.py", "same", 1, returns=float) == 1.0
        assert student.call("mine.py", "same", [1, 2], returns=list[int]) == [1, 2]
        for value, returns in ((True, float), ("1", int), ([1, "2"], list[int]), ({"a": None}, dict[str, float])):
            with pytest.raises(SubmissionError) as caught:
                student.call("mine.py", "same", value, returns=returns)
            assert caught.value.expected


@pytest.mark.slow
def test_call_overhead_is_bounded(student: Student) -> None:
    """Both sides together take the CPU time of a few JSON round trips, whatever else this computer does."""
    observations = [[1.123456789 * i, -2.2345678 * i] for i in range(100)]

    def used_s() -> float:
        used = resource.getrusage(resource.RUSAGE_SELF)
        return float(used.ru_utime + used.ru_stime + student.call("mine.py", "cpu_s"))

    with student:
        student.call("mine.py", "zeros", observations)
        before_s = used_s()
        for _ in range(1000):
            student.call("mine.py", "zeros", observations)
        call_s = used_s() - before_s
    begin_s = time.process_time()
    for _ in range(1000):
        msgspec.json.decode(msgspec.json.encode(observations))
    assert call_s < 20 * (time.process_time() - begin_s)
