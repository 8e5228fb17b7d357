"""The reported line is the student's, not one of snr_sim or Python."""

import json
from pathlib import Path

import snr_sim
from snr_sim.core.source_location import describe_error, find_student_location, is_student_file
from snr_sim.prelude.values import decode_value


def error_of(function: object) -> Exception:
    try:
        function()  # type: ignore[operator]
    except Exception as error:
        return error
    raise AssertionError("nothing was raised")


def test_error_raised_in_library_names_innermost_student_line() -> None:
    error = error_of(lambda: decode_value(b"{"))
    place = find_student_location(error.__traceback__)
    assert place is not None
    assert place.source == 'error = error_of(lambda: decode_value(b"{"))'
    assert place.file.endswith("test_source_location.py")


def test_library_and_stdlib_and_package_files_are_not_student_files() -> None:
    kit = Path(snr_sim.__file__).parent
    assert not is_student_file(str(kit / "core" / "node.py"))
    assert not is_student_file(json.__file__)
    assert not is_student_file("<string>")
    assert not is_student_file("/somewhere/site-packages/numpy/core.py")
    assert is_student_file(str(kit / "shipped" / "robots" / "lander" / "robot.py"))
    assert is_student_file("mine.py")


def test_only_foreign_errors_are_described_with_their_class() -> None:
    own = describe_error(error_of(lambda: decode_value(b"{")), "while it read")
    assert "\n  This is not JSON" in own
    other = describe_error(error_of(lambda: {}["depth"]), "while it read")
    assert "\n  KeyError: 'depth'\n  while it read" in other
