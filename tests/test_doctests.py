"""The examples in docstrings run, of the library and of the robots."""

import doctest
import importlib
import sys
from pathlib import Path

import pytest

from snr_sim.scenario import library

ROOT = Path(__file__).parents[1]


def modules_with_examples(folder: str) -> list[str]:
    """Return the paths of Python files in a folder whose text has a prompt of the interpreter."""
    return sorted(
        path.relative_to(ROOT).as_posix()
        for path in (ROOT / folder).rglob("*.py")
        if ">>> " in path.read_text(encoding="utf-8")
    )


@pytest.mark.parametrize("path", modules_with_examples("snr_sim"))
def test_examples_of_a_module_run(path: str) -> None:
    result = doctest.testmod(importlib.import_module(path.removesuffix(".py").replace("/", ".")))
    assert result.attempted > 0
    assert result.failed == 0


@pytest.mark.parametrize("path", modules_with_examples("robots"))
def test_examples_of_a_robot_run(path: str) -> None:
    _, robot, *_, name = path.removesuffix(".py").split("/")
    library.load_robot(library.find("robots", robot))
    result = doctest.testmod(importlib.import_module(f"snr_sim_robot_{robot}.{name}"))
    assert sys.modules[f"snr_sim_robot_{robot}"].__file__ == str(ROOT / "robots" / robot / "robot.py")
    assert result.attempted > 0
    assert result.failed == 0
