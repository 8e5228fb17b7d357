"""The owner of a file, and how to get access to it."""

import grp
import os
from pathlib import Path

import pytest

from snr_sim.devices.wire.permission import RULES, Owner, how_to_use, owner_of

OTHER = next(one for one in grp.getgrall() if one.gr_gid != 0)


def owned(tmp_path: Path, mode: int, gid: int, name: str = "ttyUSB0") -> Owner:
    path = tmp_path / name
    path.touch()
    path.chmod(mode)
    about = os.stat_result([mode, 0, 0, 1, 0, gid, *[0] * 4])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Path, "stat", lambda self, **_: about)
        return owner_of(path)


def test_a_group_helps_only_if_it_may_read_and_write_and_is_not_root(tmp_path: Path) -> None:
    assert owned(tmp_path, 0o660, OTHER.gr_gid) == Owner(OTHER.gr_name, True)
    assert not owned(tmp_path, 0o600, OTHER.gr_gid).helps
    assert not owned(tmp_path, 0o640, OTHER.gr_gid).helps
    assert not owned(tmp_path, 0o660, 0).helps
    assert not owned(tmp_path, 0o660, 4_000_000).helps, "a group without a name"
    assert owned(tmp_path, 0o220, OTHER.gr_gid, "export").helps, "which nobody reads"


def test_a_port_that_is_roots_alone_needs_a_rule_and_perhaps_a_console_has_it() -> None:
    fix = how_to_use(Path("/dev/ttyS0"), "dialout", Owner("root", False))
    assert "-aG root" not in fix
    assert "sudo fuser -v /dev/ttyS0" in fix
    assert f'{RULES} the line  KERNEL=="ttyS0", GROUP="dialout", MODE="0660"' in fix
    assert fix.endswith("sudo usermod -aG dialout $USER, then log out and in again.")
    assert "console" not in how_to_use(Path("/dev/ttyUSB0"), "dialout", Owner("root", False))


def test_pins_are_given_to_gpio_with_all_that_is_exported_later() -> None:
    fix = how_to_use(Path("/sys/class/pwm/pwmchip0/export"), "gpio", Owner("root", False))
    assert 'SUBSYSTEM=="pwm"' in fix
    assert "chgrp -R gpio" in fix


def test_what_is_gone_is_taken_to_be_as_usual(tmp_path: Path) -> None:
    assert how_to_use(tmp_path / "i2c-1", "i2c") == "sudo usermod -aG i2c $USER, then log out and in again."
