"""Which `--option` keys are accepted, and the errors for the others."""

from pathlib import Path
from types import ModuleType

import pytest

from snr_sim.prelude.errors import ConfigError, UnknownName
from snr_sim.scenario.options import check_options, written_options


def file(name: str, **names: object) -> ModuleType:
    module = ModuleType(name)
    module.__dict__.update(names, __file__=f"{name}.py")
    return module


def test_what_robot_and_controller_declare_is_taken() -> None:
    check_options(["port", "gain"], file("robot", OPTIONS={"port": "..."}), file("mine", OPTIONS={"gain": "..."}))


def test_of_a_robot_that_declares_nothing_any_key_goes() -> None:
    check_options(["anything"], file("robot"), file("mine", OPTIONS={"gain": "..."}))


def test_a_key_of_a_controller_that_declares_nothing_is_refused_and_the_line_to_add_is_told() -> None:
    with pytest.raises(UnknownName, match="--option gain=") as caught:
        check_options(["gain"], file("robot", OPTIONS={"port": "..."}), file("mine"))
    assert 'if mine.py reads it, add there: OPTIONS = {"gain": "what it is for"}.' in str(caught.value)


@pytest.mark.parametrize("options", [["port"], {"port": 9120}, {1: "one"}])
def test_options_that_are_no_dict_of_texts_are_refused_with_the_file(options: object) -> None:
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
