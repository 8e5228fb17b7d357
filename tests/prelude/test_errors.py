"""Errors state what happened, and a fix."""

import ast
from pathlib import Path

import pytest

from snr_sim.prelude import errors
from snr_sim.prelude.errors import MissingExtra, SnrError, nearest

KIT = Path(errors.__file__).parents[1]


def test_an_error_ends_with_what_to_try() -> None:
    assert str(SnrError("It broke.", fix="mend it.")) == "It broke.\n  Try: mend it."
    assert str(SnrError("It broke.")) == "It broke."


def test_every_error_of_the_kit_can_be_caught_as_one() -> None:
    kinds = [kind for kind in vars(errors).values() if isinstance(kind, type) and issubclass(kind, Exception)]
    assert len(kinds) > 10
    assert all(issubclass(kind, SnrError) for kind in kinds)


def test_the_nearest_name_is_offered_and_all_are_listed() -> None:
    assert nearest("motor_sped", ["depth", "motor_speed"]) == "did you mean 'motor_speed'? One of: depth, motor_speed."
    assert nearest("zzz", ["depth", "imu"]) == "one of: depth, imu."
    assert nearest("zzz", ["depth"]) == "'depth' is the only one."
    assert nearest("dept", ["depth"]) == "did you mean 'depth'?"
    assert nearest("zzz", []) == "there is none to choose from."
    assert nearest("zzz", [], "stored were") == "stored were: none."
    assert nearest("zzz", [f"k{i:02}" for i in range(25)]).endswith("k19 and 5 more.")


def test_no_message_ends_in_a_colon_before_what_to_try() -> None:
    unended = [
        f"{path.name}, line {call.lineno}"
        for path in sorted(KIT.rglob("*.py"))
        if b"fix" in path.read_bytes()  # others need not be parsed
        for call in ast.walk(ast.parse(path.read_bytes()))
        if isinstance(call, ast.Call)
        and call.args
        and any(keyword.arg == "fix" for keyword in call.keywords)
        and not _last_words(call.args[0]).endswith((".", "!", "?"))
    ]
    assert unended == []


def _last_words(message: ast.expr) -> str:
    last = message.values[-1] if isinstance(message, ast.JoinedStr) else message
    return str(last.value) if isinstance(last, ast.Constant) else "."  # what is put in ends as it may


def test_a_missing_extra_is_an_import_error_and_names_the_command() -> None:
    with pytest.raises(ImportError, match=r"pip install 'snr_sim\[sim\]'"):
        raise MissingExtra("pymunk", "sim")
