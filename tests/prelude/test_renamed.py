"""Old names work for one release, and warn with the new one."""

import warnings
from typing import Any

import pytest

import snr_sim
from snr_sim.prelude import errors
from snr_sim.prelude.io import parse_io


@pytest.mark.parametrize("old", ["UnknownName", "ComponentFailed", "SensorLost", "FrameTooLarge", "MissingExtra"])
def test_old_error_name_warns_and_is_the_new_class(old: str) -> None:
    with pytest.warns(DeprecationWarning, match=f"{old} is now called {old}Error"):
        assert getattr(errors, old) is getattr(errors, f"{old}Error")


def test_unknown_name_in_errors_raises_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'Unknwon'"):
        _ = errors.Unknwon  # type: ignore[attr-defined]


def test_old_name_of_link_faults_warns_each_time() -> None:
    for _ in range(2):
        with pytest.warns(DeprecationWarning, match="LinkFaults"):
            assert snr_sim.Faults is snr_sim.LinkFaults


def test_backing_of_a_class_warns_and_sets_its_executor() -> None:
    with pytest.warns(DeprecationWarning, match=r"Vision\.backing is now called executor"):

        class Vision(snr_sim.Loop):
            backing = "process"

    assert Vision.executor == "process"
    with warnings.catch_warnings():
        warnings.simplefilter("error")

        class Other(Vision):
            executor: Any = "thread"

    assert Other.executor == "thread"


def test_page_of_its_former_module_warns() -> None:
    with pytest.warns(DeprecationWarning, match="prelude.page.Page is now called snr_sim.prelude.task.Page"):
        from snr_sim.prelude.page import Page
    assert Page is snr_sim.Page


def test_io_mirror_is_loopback() -> None:
    assert str(parse_io("mirror")) == "loopback"
