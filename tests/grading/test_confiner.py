"""A user and a folder for one process: no other grader has them, and both are released."""

import os
import tempfile
from contextlib import closing
from pathlib import Path

import pytest

from snr_sim.grading.sandbox.confiner import FIRST, LAST, Confiner

pytestmark = pytest.mark.skipif(os.geteuid() != 0, reason="only root gives files and processes to other users")


def test_two_at_once_are_two_users_with_a_folder_each_which_go_with_them() -> None:
    with closing(Confiner()) as one, closing(Confiner()) as other:
        confiners = (one, other)
        for confiner in confiners:
            assert FIRST <= confiner.user <= LAST
            assert confiner.scratch.stat().st_uid == confiner.user
            assert confiner.scratch.stat().st_mode & 0o777 == 0o700
            (confiner.scratch / "left").write_text("x")
    assert one.user != other.user
    assert not any(confiner.scratch.exists() for confiner in confiners)
    with closing(Confiner()) as again:
        assert again.user == one.user


def test_a_user_for_whose_files_there_is_no_room_is_given_back(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    with closing(Confiner()) as before:
        first = before.user
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "absent"))
    with pytest.raises(OSError, match="No such file"):
        Confiner()
    monkeypatch.undo()
    with closing(Confiner()) as after:
        assert after.user == first
