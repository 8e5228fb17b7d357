"""The owner of a file, and how to get access to it."""

import grp
import os
from pathlib import Path

import pytest

from snr_sim.devices.wire.permission import RULES, FileOwner, how_to_use, owner_of

OTHER = next(one for one in grp.getgrall() if one.gr_gid != 0)


def owned(tmp_path: Path, mode: int, gid: int, name: str = "ttyUSB0") -> FileOwner:
    path = tmp_path / name
    path.touch()
    path.chmod(mode)
    about = os.stat_result([mode, 0, 0, 1, 0, gid, *[0] * 4])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Path, "stat", lambda self, **_: about)
        return owner_of(path)


def test_group_has_access_only_if_read_write_and_not_root(tmp_path: Path) -> None:
    assert owned(tmp_path, 0o660, OTHER.gr_gid) == FileOwner(OTHER.gr_name, True)
    assert not owned(tmp_path, 0o600, OTHER.gr_gid).has_access
    assert not owned(tmp_path, 0o640, OTHER.gr_gid).has_access
    assert not owned(tmp_path, 0o660, 0).has_access
    assert not owned(tmp_path, 0o660, 4_000_000).has_access, "a group without a name"
    assert owned(tmp_path, 0o220, OTHER.gr_gid, "export").has_access, "a file without read access for any user"


def test_port_of_root_needs_udev_rule_and_names_console() -> None:
    fix = how_to_use(Path("/dev/ttyS0"), "dialout", FileOwner("root", False))
    assert "-aG root" not in fix
    assert "sudo fuser -v /dev/ttyS0" in fix
    assert f'{RULES} the line  KERNEL=="ttyS0", GROUP="dialout", MODE="0660"' in fix
    assert fix.endswith("sudo usermod -aG dialout $USER, then log out and in again.")
    assert "console" not in how_to_use(Path("/dev/ttyUSB0"), "dialout", FileOwner("root", False))


def test_pins_rule_covers_later_exports() -> None:
    fix = how_to_use(Path("/sys/class/pwm/pwmchip0/export"), "gpio", FileOwner("root", False))
    assert 'SUBSYSTEM=="pwm"' in fix
    assert "chgrp -R gpio" in fix


def test_missing_file_returns_usual_group(tmp_path: Path) -> None:
    assert how_to_use(tmp_path / "i2c-1", "i2c") == "sudo usermod -aG i2c $USER, then log out and in again."
