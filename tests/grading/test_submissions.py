"""Submissions of a class: each has a unique name, and invalid ones are reported."""

import os
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from snr_sim.grading.batch.submissions import name_submissions
from snr_sim.prelude.errors import SnrError


def test_submission_names_are_unique_and_safe(tmp_path: Path) -> None:
    for name in ("1/ada", "2/Ada", "3/..", "4/a b;c$(d)", "5/=SUM(A1)", "6/" + "long" * 50):
        (tmp_path / name).mkdir(parents=True, exist_ok=True)
    given = [tmp_path / "1/ada", tmp_path / "2/Ada", tmp_path / "4/a b;c$(d)", tmp_path / "5/=SUM(A1)"]
    names = [one.id for one in name_submissions([*given, tmp_path / "6" / ("long" * 50), given[0]])]
    assert names[:4] == ["ada", "Ada-2", "a_b_c_d", "SUM_A1"]
    assert len(names) == 5
    assert len(names[4]) == 60


def test_names_are_kept_when_submissions_are_added(tmp_path: Path) -> None:
    first, late = tmp_path / "a" / "ada", tmp_path / "b" / "ada"
    first.mkdir(parents=True)
    late.mkdir(parents=True)
    known = name_submissions([first])
    assert [one.id for one in name_submissions([late, first], known)] == ["ada-2", "ada"]


def test_names_are_kept_when_the_class_folder_moves(tmp_path: Path) -> None:
    (tmp_path / "a" / "ada").mkdir(parents=True)
    known = name_submissions([tmp_path / "a" / "ada"])
    (tmp_path / "a").rename(tmp_path / "b")
    assert [one.id for one in name_submissions([tmp_path / "b" / "ada"], known)] == ["ada"]


def test_folder_of_submissions_raises(tmp_path: Path) -> None:
    for name in ("ada", "bob"):
        (tmp_path / "class" / name).mkdir(parents=True)
    with pytest.raises(SnrError, match="holds 2: ada, bob") as error:
        name_submissions([tmp_path / "class"])
    assert error.value.fix == f"give what is in it: {tmp_path}/class/*."
    with pytest.raises(SnrError, match="There is no submission"):
        name_submissions([tmp_path / "nobody"])


def test_class_folder_with_a_loose_file_raises_only_when_alone(tmp_path: Path) -> None:
    for name in ("ada", "bob"):
        (tmp_path / "class" / name).mkdir(parents=True)
    (tmp_path / "class" / "notes.py").touch()
    with pytest.raises(SnrError, match="holds 2: ada, bob"):
        name_submissions([tmp_path / "class"], required_files=["depth_hold.py"])
    assert (
        len(name_submissions([tmp_path / "class", tmp_path / "class" / "ada"], required_files=["depth_hold.py"])) == 2
    )
    (tmp_path / "class" / "depth_hold.py").touch()
    assert len(name_submissions([tmp_path / "class"], required_files=["depth_hold.py"])) == 1


def test_students_folder_of_folders_does_not_stop_the_others(tmp_path: Path) -> None:
    for name in ("ada/src", "ada/tests", "bob"):
        (tmp_path / name).mkdir(parents=True)
    given = [tmp_path / "ada", tmp_path / "bob"]
    assert [one.id for one in name_submissions(given, required_files=["depth_hold.py"])] == ["ada", "bob"]
    (tmp_path / "bob" / "left").mkdir()
    (tmp_path / "bob" / "right").mkdir()
    with pytest.raises(SnrError, match=r"'.*ada' is not a submission, but holds 2: src, tests"):  # all are of classes
        name_submissions(given)


@pytest.mark.skipif(sys.platform != "linux", reason="this system has no such names")
def test_name_of_a_submission_that_is_not_text_raises(tmp_path: Path) -> None:
    given = tmp_path / os.fsdecode(b"Zo\xeb.zip")
    given.touch()
    with pytest.raises(SnrError, match=r"The name 'Zo\\udceb\.zip' is not text") as error:
        name_submissions([given])
    assert error.value.fix == "rename it."


def test_unreadable_folder_raises(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuses(folder: Path) -> Iterator[Path]:
        raise PermissionError(13, "Permission denied", str(folder))

    monkeypatch.setattr(Path, "iterdir", refuses)  # as for users other than root; tests may run as root
    with pytest.raises(SnrError, match=r"cannot be read: Permission denied\.") as error:
        name_submissions([tmp_path])
    assert error.value.fix
    (tmp_path / "ada.zip").touch()
    assert len(name_submissions([tmp_path, tmp_path / "ada.zip"])) == 2  # the import reports it
