"""Errors state what happened, and a fix."""

import ast
from pathlib import Path

import pytest

from snr_sim.prelude import errors
from snr_sim.prelude.errors import MissingExtraError, SnrError, suggest

KIT = Path(errors.__file__).parents[1]


def test_error_text_ends_with_fix() -> None:
    assert str(SnrError("It broke.", fix="fix it.")) == "It broke.\n  Try: fix it."
    assert str(SnrError("It broke.")) == "It broke."


def test_every_error_derives_from_snr_error() -> None:
    kinds = [kind for kind in vars(errors).values() if isinstance(kind, type) and issubclass(kind, Exception)]
    assert len(kinds) > 10
    assert all(issubclass(kind, SnrError) for kind in kinds)


def test_suggest_returns_nearest_and_lists_all() -> None:
    assert suggest("motor_sped", ["depth", "motor_speed"]) == "did you mean 'motor_speed'? One of: depth, motor_speed."
    assert suggest("zzz", ["depth", "imu"]) == "one of: depth, imu."
    assert suggest("zzz", ["depth"]) == "'depth' is the only one."
    assert suggest("dept", ["depth"]) == "did you mean 'depth'?"
    assert suggest("zzz", []) == "there is none to choose from."
    assert suggest("zzz", [], "stored were") == "stored were: none."
    assert suggest("zzz", [f"k{i:02}" for i in range(25)]).endswith("k19 and 5 more.")


def test_no_message_ends_in_a_colon_before_the_fix() -> None:
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
        raise MissingExtraError("pymunk", "sim")
