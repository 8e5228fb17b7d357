"""The reported line is the student's, not one of snr_sim or Python."""

import json
from pathlib import Path

import snr_sim
from snr_sim.core.blame import describe_error, is_student_file, student_place
from snr_sim.prelude.values import decode_value


def error_of(function: object) -> Exception:
    try:
        function()  # type: ignore[operator]
    except Exception as error:
        return error
    raise AssertionError("nothing was raised")


def test_the_innermost_line_of_the_student_is_named_also_when_the_kit_raised_below_it() -> None:
    error = error_of(lambda: decode_value(b"{"))
    place = student_place(error.__traceback__)
    assert place is not None
    assert place.source == 'error = error_of(lambda: decode_value(b"{"))'
    assert place.file.endswith("test_blame.py")


def test_files_of_the_kit_of_python_and_of_packages_are_not_the_students() -> None:
    kit = Path(snr_sim.__file__).parent
    assert not is_student_file(str(kit / "core" / "node.py"))
    assert not is_student_file(json.__file__)
    assert not is_student_file("<string>")
    assert not is_student_file("/somewhere/site-packages/numpy/core.py")
    assert is_student_file(str(kit / "shipped" / "robots" / "lander" / "robot.py"))
    assert is_student_file("mine.py")


def test_errors_of_the_kit_come_without_their_class_and_others_with_it() -> None:
    own = describe_error(error_of(lambda: decode_value(b"{")), "while it read")
    assert "\n  This is not JSON" in own
    other = describe_error(error_of(lambda: {}["depth"]), "while it read")
    assert "\n  KeyError: 'depth'\n  while it read" in other
