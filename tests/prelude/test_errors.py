"""Errors say what happened, and what to try."""

import pytest

from snr_sim.prelude import errors
from snr_sim.prelude.errors import MissingExtra, SnrError, nearest


def test_an_error_ends_with_what_to_try() -> None:
    assert str(SnrError("It broke.", fix="mend it.")) == "It broke.\n  Try: mend it."
    assert str(SnrError("It broke.")) == "It broke."


def test_every_error_of_the_kit_can_be_caught_as_one() -> None:
    kinds = [kind for kind in vars(errors).values() if isinstance(kind, type) and issubclass(kind, Exception)]
    assert len(kinds) > 10
    assert all(issubclass(kind, SnrError) for kind in kinds)


def test_the_nearest_name_is_offered_and_all_are_listed() -> None:
    assert nearest("motor_sped", ["depth", "motor_speed"]) == "did you mean 'motor_speed'? Known: depth, motor_speed."
    assert nearest("zzz", ["depth", "imu"]) == "Known: depth, imu."
    assert nearest("zzz", []) == "nothing of that kind is known."
    assert nearest("zzz", [f"k{i:02}" for i in range(25)]).endswith("k19 and 5 more.")


def test_a_missing_extra_is_an_import_error_and_names_the_command() -> None:
    with pytest.raises(ImportError, match=r"pip install 'snr_sim\[sim\]'"):
        raise MissingExtra("pymunk", "sim")
