"""Robots, scenarios and controllers are found in order, and a student's files are treated like those of snr_sim."""

import os
import sys
from pathlib import Path

import pytest

from snr_sim.prelude.errors import ConfigError, UnknownNameError
from snr_sim.recording.sources import sha256_of
from snr_sim.scenario import library

ROBOT = """
from .mixer import mix
from .parts.arm import REACH_M

ROLES = ("moth",)
IO = ("sim",)
MIXED = mix()

def roles(context, controller):
    return {"moth": list(controller)}
"""
SCENARIO = """
from snr_sim_robot_moth.mixer import mix

ROBOT = "moth"
ENGINES = ("none",)
CONTROLLER = "idle"
TIME_LIMIT_S = 1.0

def parameters(seed): return None
def plant(seed, engine): return None
def verdict(plant): return None
def metrics(plant, seed): return {}
"""


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    here = tmp_path / "here"
    here.mkdir()
    monkeypatch.chdir(here)
    monkeypatch.delenv("SNR_SIM_PATH", raising=False)
    monkeypatch.setattr(sys, "path", list(sys.path))
    return here


def put_moth(folder: Path, mixed: str = "'ours'") -> Path:
    robot = folder / "robots" / "moth"
    (robot / "parts").mkdir(parents=True)
    (robot / "controllers").mkdir()
    (robot / "robot.py").write_text(ROBOT)
    (robot / "mixer.py").write_text(f"def mix(): return {mixed}\n")
    (robot / "parts" / "arm.py").write_text("REACH_M = 0.3\n")
    (robot / "controllers" / "idle.py").write_text("def factories(robot): return []\n")
    (folder / "scenarios").mkdir()
    (folder / "scenarios" / "moth_hover.py").write_text(SCENARIO)
    return robot


# Finding


def test_find_searches_folder_then_path_then_package(
    here: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert library.find("robots", "lander").place == "the kit"
    for name in ("first", "second"):
        put_moth(tmp_path / name)
        (tmp_path / name / "robots" / "moth").rename(tmp_path / name / "robots" / "lander")
    paths = [str(tmp_path / name) for name in ("missing", "first", "second")]
    monkeypatch.setenv("SNR_SIM_PATH", os.pathsep.join([*paths, ""]))
    found = library.find("robots", "lander")
    assert (found.place, found.path) == ("SNR_SIM_PATH", tmp_path / "first" / "robots" / "lander")
    (put_moth(here)).rename(here / "robots" / "lander")
    found = library.find("robots", "lander")
    assert (found.place, found.path) == ("the current folder", here / "robots" / "lander")
    given = library.find("robots", str(tmp_path / "second" / "robots" / "lander"))
    assert given.place == "the path given"
    assert [one.place for one in library.list_available("robots") if one.name == "lander"] == ["the current folder"]


def test_a_scenario_is_found_by_name_or_by_file(here: Path) -> None:
    put_moth(here)
    by_name = library.find("scenarios", "moth_hover")
    by_file = library.find("scenarios", "./scenarios/moth_hover.py")
    assert (by_name.path, by_name.name) == (by_file.path, by_file.name)


def test_folder_without_robot_file_is_not_found(here: Path) -> None:
    (here / "lander").mkdir()
    assert library.find("robots", "lander").place == "the kit"


@pytest.mark.parametrize("name", ["lnder", "", "../lander", "/nowhere/lander", "x" * 300])
def test_unknown_name_raises_with_searched_folders(here: Path, name: str) -> None:
    with pytest.raises(UnknownNameError, match=r"There is no robot .*Looked in: robots, ") as caught:
        library.find("robots", name)
    assert "lander" in caught.value.fix


# Loading


def test_a_robots_files_import_each_other_without_init_files(here: Path) -> None:
    put_moth(here)
    robot = library.load_robot(library.find("robots", "moth"))
    assert robot.MIXED == "ours"
    assert robot.REACH_M == 0.3
    scenario = library.load_scenario(library.find("scenarios", "moth_hover"))
    assert scenario.mix() == "ours"
    assert library.controllers(library.find("robots", "moth")) == ["idle"]


def test_an_edit_within_the_same_second_is_seen_in_every_file(here: Path) -> None:
    folder = put_moth(here)
    own = here / "mine.py"
    for text in ("'ours'", "'mine'", "'last'"):
        (folder / "mixer.py").write_text(f"def mix(): return {text}\n")
        own.write_text(f"import neighbour\ndef factories(robot): return neighbour.VALUE + {text}\n")
        (here / "neighbour.py").write_text(f"VALUE = {text}\n")
        found = library.find("robots", "moth")
        mixed = library.load_robot(found).MIXED
        assert mixed == text.strip("'")
        assert library.load_controller(found, "./mine.py").factories(None) == 2 * mixed
    assert not list(here.rglob("__pycache__"))


def test_a_robot_that_is_loaded_again_is_not_compiled_again(here: Path) -> None:
    put_moth(here)
    found = library.find("robots", "moth")
    first, again = (library.load_robot(found) for _ in range(2))
    assert first is not again
    assert first.roles is not again.roles
    assert first.roles.__code__ is again.roles.__code__


def test_controller_imports_siblings_but_not_over_standard_library(here: Path) -> None:
    put_moth(here)
    (here / "gains.py").write_text("KP = 2.0\n")
    (here / "queue.py").write_text("1 / 0\n")
    (here / "mine.py").write_text("import gains, queue\ndef factories(robot): return [gains.KP, queue.Queue]\n")
    made = library.load_controller(library.find("robots", "moth"), "mine.py").factories(None)
    assert made[0] == 2.0
    assert made[1].__module__ == "queue"


def test_hash_of_used_file_changes_with_file(here: Path) -> None:
    folder = put_moth(here)
    (here / "mine.py").write_text("import gains\ndef factories(robot): return []\n")
    (here / "gains.py").write_text("KP = 2.0\n")
    (here / "unused.py").write_text("")

    before = hashes(in_use_by("mine.py"))
    assert set(before) == {
        "scenario/moth_hover.py", "robot/robot.py", "robot/mixer.py", "robot/parts/arm.py", "controller/mine.py",
        "controller/gains.py",
    }  # fmt: skip
    (folder / "mixer.py").write_text("def mix(): return 'other'\n")
    (here / "gains.py").write_text("KP = 3.0\n")
    after = hashes(in_use_by("mine.py"))
    assert {name for name in before if before[name] != after[name]} == {"robot/mixer.py", "controller/gains.py"}


def hashes(used: list[library.UsedSources]) -> dict[str, str]:
    return {name: sha256_of(path) for name, path in library.files_in_use(used).items()}


def in_use_by(controller: str) -> list[library.UsedSources]:
    robot, scenario = library.find("robots", "moth"), library.find("scenarios", "moth_hover")
    library.load_robot(robot)
    library.load_scenario(scenario)
    return library.used_sources(scenario, robot, library.load_controller(robot, controller))


def test_other_loaded_modules_are_not_in_use(here: Path) -> None:
    folder = put_moth(here)
    (here / "mine.py").write_text("def factories(robot):\n    from gains import KP\n    return [KP]\n")
    (here / "gains.py").write_text("KP = 2.0\n")
    (here / "other.py").write_text("import gains\ndef factories(robot): return []\n")
    (folder / "spare.py").write_text("")
    alone = hashes(in_use_by("idle"))
    for other in ("other.py", "robots/moth/spare.py"):
        library.load_program(other)  # in the robot's folder under a name that is not the robot's
    mine = in_use_by("mine.py")
    robot = library.find("robots", "moth")
    library.load_controller(robot, "mine.py").factories(None)
    assert hashes(in_use_by("idle")) == alone
    assert [name for name in hashes(mine) if "controller" in name] == ["controller/mine.py"]


@pytest.mark.parametrize(
    ("file", "old", "new", "expected"),
    [
        ("robots/moth/robot.py", "ROLES =", "ROLE =", "robot.py has no `ROLES`, which a robot needs"),
        ("robots/moth/robot.py", '("moth",)', '("moth")', "ROLES is 'moth', not a tuple of names"),
        ("robots/moth/robot.py", '("moth",)', "()", "not a tuple of names"),
        ("robots/moth/robot.py", '("sim",)', "5", "IO is 5, not a tuple of names"),
        ("robots/moth/robot.py", "def roles", "1 / 0\ndef roles", "robot.py, line 9: 1 / 0\n"),
        ("robots/moth/robot.py", ".mixer", ".mixr", "robot.py, line 2: from .mixr import mix\n"),
        ("robots/moth/mixer.py", "return", "return (", "mixer.py, line 1: "),
        ("scenarios/moth_hover.py", 'ROBOT = "moth"', "", "does not say which robot it is for"),
        ("scenarios/moth_hover.py", "def verdict", "def verdct", "has no `verdict`, which a scenario needs"),
        ("scenarios/moth_hover.py", "def plant", "def plant(", "moth_hover.py, line 10: "),
        ("scenarios/moth_hover.py", '("none",)', '"none"', "ENGINES is 'none', not a tuple of names"),
        ("scenarios/moth_hover.py", "= 1.0", "= '1'", "TIME_LIMIT_S is '1', not a number of seconds"),
        ("scenarios/moth_hover.py", "= 1.0", "= -1.0", "TIME_LIMIT_S is -1.0, not a number of seconds"),
    ],
)
def test_file_without_required_names_is_reported(here: Path, file: str, old: str, new: str, expected: str) -> None:
    put_moth(here)
    text = (here / file).read_text()
    assert old in text
    (here / file).write_text(text.replace(old, new))
    with pytest.raises(ConfigError) as caught:
        load_all()
    assert expected in str(caught.value)
    assert "snr_sim/library" not in str(caught.value)


def load_all() -> None:
    scenario = library.find("scenarios", "moth_hover")
    library.load_robot(library.find("robots", library.robot_of_scenario(scenario)))
    library.load_scenario(scenario)


def test_the_robot_of_a_scenario_may_be_annotated(here: Path) -> None:
    put_moth(here)
    path = here / "scenarios" / "moth_hover.py"
    path.write_text(path.read_text().replace('ROBOT = "moth"', 'ROBOT: str = "moth"'))
    assert library.robot_of_scenario(library.find("scenarios", "moth_hover")) == "moth"


def test_program_is_loaded_without_its_main_part(here: Path) -> None:
    (here / "robot.py").write_text("x = 1\nif __name__ == '__main__':\n    1 / 0\n")
    assert library.load_program("robot.py").x == 1
    for wrong in ("", "no.py", "."):
        with pytest.raises(UnknownNameError, match="There is no file"):
            library.load_program(wrong)
