"""Detection of ports, buses and chips, on computers that are folders."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from snr_sim.devices.host_ports import HostInfo, HostPort
from snr_sim.devices.wire.permission import FileOwner
from snr_sim.prelude.errors import MissingExtraError

BY_ID = "usb-FTDI_FT232R_USB_UART_A50285BI-if00-port0"


@pytest.fixture
def pi(tmp_path: Path) -> Path:
    """A Raspberry Pi 5 with an Arduino, the header's I2C bus, its own PWM chip and another one."""
    for name in ("dev/serial/by-id", "proc/device-tree", "sys/class/i2c-dev/i2c-1", "sys/devices"):
        (tmp_path / name).mkdir(parents=True)
    (tmp_path / "proc/device-tree/model").write_text("Raspberry Pi 5 Model B Rev 1.0\0")
    for name in ("dev/ttyUSB0", "dev/i2c-1"):
        (tmp_path / name).touch()
    (tmp_path / "dev/serial/by-id" / BY_ID).symlink_to("../../ttyUSB0")
    (tmp_path / "sys/class/i2c-dev/i2c-1/name").write_text("Synopsys DesignWare I2C adapter\n")
    for number, device in enumerate(("107d517a80.pwm", "1f00098000.pwm")):
        chip = tmp_path / f"sys/class/pwm/pwmchip{number}"
        chip.mkdir(parents=True)
        (tmp_path / "sys/devices" / device).mkdir()
        (chip / "device").symlink_to(tmp_path / "sys/devices" / device)
        (chip / "npwm").write_text("4\n")
        (chip / "export").touch()
    return tmp_path


def machine(root: Path, forbidden: str = "nothing", ports: Callable[[], list[str]] | None = None) -> HostInfo:
    return HostInfo(
        root,
        ports or (lambda: ["/dev/ttyUSB0 (FT232R USB UART)"]),
        may_use=lambda path: path.exists() and forbidden not in str(path),
        owner_of=lambda path: FileOwner({"ttyUSB0": "dialout", "i2c-1": "i2c"}.get(path.name, "gpio"), True),
    )


def test_host_ports_of_pi_have_lasting_names(pi: Path) -> None:
    assert list(machine(pi).host_ports()) == [
        HostPort("serial", "/dev/ttyUSB0", f"FT232R USB UART, always /dev/serial/by-id/{BY_ID}"),
        HostPort("i2c", "1", "Synopsys DesignWare I2C adapter"),
        HostPort("pwm", "107d517a80.pwm", "pwmchip0, 4 channels, not a Pi header"),
        HostPort("pwm", "1f00098000.pwm", "pwmchip1, 4 channels, the one of a Raspberry Pi 5"),
    ]
    assert machine(pi).is_pi


@pytest.mark.parametrize(
    ("forbidden", "kind", "group"), [("ttyUSB0", "serial", "dialout"), ("i2c-1", "i2c", "i2c"), ("pwm", "pwm", "gpio")]
)
def test_host_ports_without_permission_name_group_to_join(pi: Path, forbidden: str, kind: str, group: str) -> None:
    fixes = {wire.kind: wire.fix for wire in machine(pi, forbidden).host_ports() if wire.fix}
    assert fixes == {kind: f"sudo usermod -aG {group} $USER, then log out and in again."}


@pytest.mark.parametrize(("forbidden", "usual"), [("ttyUSB0", "dialout"), ("i2c-1", "i2c"), ("pwm", "gpio")])
def test_host_ports_owned_by_root_need_udev_rule(pi: Path, forbidden: str, usual: str) -> None:
    roots = replace(machine(pi, forbidden), owner_of=lambda path: FileOwner("root", False))
    (fix,) = [wire.fix for wire in roots.host_ports() if wire.fix]
    assert "-aG root" not in fix
    assert "udev rule" in fix
    assert fix.endswith(f"sudo usermod -aG {usual} $USER, then log out and in again.")


def test_host_ports_without_pyserial_are_listed_and_name_extra(pi: Path) -> None:
    def missing() -> list[str]:
        raise MissingExtraError("pyserial", "hardware")

    first = next(machine(pi, ports=missing).host_ports())
    assert (first.name, "snr_sim[hardware]" in first.fix) == ("/dev/ttyUSB0", True)


def test_host_ports_of_bare_computer_are_empty(tmp_path: Path) -> None:
    bare = machine(tmp_path, ports=list)
    assert list(bare.host_ports()) == []
    assert not bare.is_pi


def test_host_ports_listed_but_gone_report_reason(tmp_path: Path) -> None:
    def gone(path: Path) -> FileOwner:
        raise FileNotFoundError(2, "No such file or directory")

    left = HostInfo(tmp_path, lambda: ["/dev/ttyUSB3"], may_use=lambda path: False, owner_of=gone)
    assert next(left.host_ports()).fix == f"{tmp_path}/dev/ttyUSB3: No such file or directory"
