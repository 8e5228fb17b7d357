"""Which `--option` keys are accepted, and the errors for the others."""

from pathlib import Path
from types import ModuleType

import pytest

from snr_sim.prelude.errors import ConfigError, UnknownNameError
from snr_sim.scenario.options import check_options, written_options


def file(name: str, **names: object) -> ModuleType:
    module = ModuleType(name)
    module.__dict__.update(names, __file__=f"{name}.py")
    return module


def test_options_of_robot_and_controller_are_accepted() -> None:
    check_options(["port", "gain"], file("robot", OPTIONS={"port": "..."}), file("mine", OPTIONS={"gain": "..."}))


def test_robot_without_options_accepts_any_key() -> None:
    check_options(["anything"], file("robot"), file("mine", OPTIONS={"gain": "..."}))


def test_undeclared_controller_key_is_rejected_with_line_to_add() -> None:
    with pytest.raises(UnknownNameError, match="--option gain=") as caught:
        check_options(["gain"], file("robot", OPTIONS={"port": "..."}), file("mine"))
    assert 'if mine.py reads it, add there: OPTIONS = {"gain": "what it is for"}.' in str(caught.value)


@pytest.mark.parametrize("options", [["port"], {"port": 9120}, {1: "one"}])
def test_invalid_options_dict_is_rejected_with_file(options: object) -> None:
    with pytest.raises(ConfigError, match=r"robot\.py: OPTIONS is "):
        check_options([], file("robot", OPTIONS=options), file("mine"))


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ('OPTIONS = {"port": "of the link"}', {"port": "of the link"}),
        ('OPTIONS: dict[str, str] = {"port": "of the link"}', {"port": "of the link"}),
        ("OPTIONS: dict[str, str]", {}),
        ("OPTIONS = made_elsewhere()", {}),
        ("ROLES = 1", {}),
        ("def (", {}),
    ],
)
def test_options_are_read_from_a_file_without_running_it(tmp_path: Path, text: str, found: dict[str, str]) -> None:
    path = tmp_path / "robot.py"
    path.write_text(f"{text}\nraise SystemExit\n")
    assert written_options(path) == found
