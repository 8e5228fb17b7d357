"""A user for one process: nobody else's, and gone with all that was its."""

import os
import signal
import subprocess
import tempfile
from pathlib import Path

import pytest

from snr_sim.grading.sandbox import confiner
from snr_sim.grading.sandbox.scratch import Scratch
from snr_sim.grading.sandbox.throwaway_user import FIRST, LAST, ThrowawayUser

pytestmark = pytest.mark.skipif(os.geteuid() != 0, reason="only root gives files and processes to other users")


def test_two_at_once_are_two() -> None:
    users = [ThrowawayUser(), ThrowawayUser()]
    numbers = {user.number for user in users}
    for user in users:
        user.close()
    assert len(numbers) == 2
    assert all(FIRST <= number <= LAST for number in numbers)


@pytest.mark.slow
def test_what_a_user_runs_and_owns_goes_with_it_and_what_others_have_stays() -> None:
    user = ThrowawayUser()
    with tempfile.TemporaryDirectory(prefix="snr-test-") as ours:
        theirs = Path(tempfile.mkdtemp(prefix="snr-test-"))
        (theirs / "file").write_text("x")
        os.chown(theirs, user.number, user.number)
        left = subprocess.Popen(["/bin/sleep", "1000"], user=user.number, group=user.number, start_new_session=True)
        user.close()
        assert left.wait() == -signal.SIGKILL
        assert not theirs.exists()
        assert Path(ours).is_dir()


@pytest.mark.slow
def test_a_user_who_still_runs_something_is_nobody_elses() -> None:
    user = ThrowawayUser()
    number = user.number
    left = subprocess.Popen(["/bin/sleep", "1000"], user=number, group=number, start_new_session=True)
    user._claim.close()  # as if its grader had been killed
    other = ThrowawayUser()
    assert other.number != number
    other.close()
    assert left.poll() is None
    left.kill()
    left.wait()


def test_a_user_for_whose_files_there_is_no_room_is_given_back(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[ThrowawayUser] = []
    given_back: list[ThrowawayUser] = []

    class Remembered(ThrowawayUser):
        def __init__(self) -> None:
            super().__init__()
            made.append(self)

        def close(self) -> None:
            super().close()
            given_back.append(self)

    def full(user: int) -> Scratch:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(confiner, "ThrowawayUser", Remembered)
    monkeypatch.setattr(confiner, "Scratch", full)
    with pytest.raises(OSError, match="No space"):
        confiner.Confiner()
    assert given_back == made
    assert len(made) == 1
