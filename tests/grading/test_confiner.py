"""A user and a folder for one process: no other grader has them, and both are released."""

import os
import tempfile
from contextlib import closing
from pathlib import Path

import pytest

from snr_sim.grading.sandbox.confiner import FIRST_UID, LAST_UID, Confiner

pytestmark = pytest.mark.skipif(os.geteuid() != 0, reason="only root gives files and processes to other users")


def test_confiners_get_separate_users_and_folders_and_release_them() -> None:
    with closing(Confiner()) as one, closing(Confiner()) as other:
        confiners = (one, other)
        for confiner in confiners:
            assert FIRST_UID <= confiner.user <= LAST_UID
            assert confiner.scratch.stat().st_uid == confiner.user
            assert confiner.scratch.stat().st_mode & 0o777 == 0o700
            (confiner.scratch / "left").write_text("x")
    assert one.user != other.user
    assert not any(confiner.scratch.exists() for confiner in confiners)
    with closing(Confiner()) as again:
        assert again.user == one.user


def test_user_is_released_when_its_folder_cannot_be_created(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    with closing(Confiner()) as before:
        first = before.user
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "absent"))
    with pytest.raises(OSError, match="No such file"):
        Confiner()
    monkeypatch.undo()
    with closing(Confiner()) as after:
        assert after.user == first
