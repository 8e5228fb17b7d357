"""The Pi's PWM pins through files with the kernel's rules; an independent driver writes the same."""

import errno
import os
from pathlib import Path
from typing import Any

import pytest
from rpi_hardware_pwm import HardwarePWM

from snr_sim.devices.device_loop import start_device
from snr_sim.devices.pwm.passive_pwm import PassivePwm
from snr_sim.devices.pwm.sysfs_pwm import SysfsPins, find_chip
from snr_sim.prelude.errors import DeviceError
from snr_sim.prelude.signals import LOST
from snr_sim.testing.fake_sysfs_pwm import FakeSysfsPwm
from snr_sim.testing.pwm_contract import check_pwm_out
from tests.devices import benches


class Bench(benches.Bench):
    """A Raspberry Pi 4."""

    def __init__(self, root: Path, channels: int = 2) -> None:
        self.channels = channels
        self.tree = FakeSysfsPwm(root, channels=channels)

    def open(self, is_supervised: bool = True, esc_start_s: float = 0.1, **more: Any) -> PassivePwm:
        settings = {
            "root": self.tree.root,
            "write": self.tree.write,
            "sleep": self.advance,
            "now_s": self.now_s,
            **more,
        }
        return PassivePwm(SysfsPins(self.channels, **settings), self.now_s, esc_start_s, is_supervised)

    def pins_us(self) -> list[float]:
        return [self.tree.pulse_us(channel) for channel in range(self.channels)]

    def unplug(self) -> None:
        self.tree.is_there = False

    def plug_in(self) -> None:
        self.tree.is_there = True


def test_sysfs_pwm_passes_pwm_contract(tmp_path: Path) -> None:
    check_pwm_out(Bench(tmp_path))


@pytest.mark.parametrize("pulse_us", [1100.0, 1234.0, 1500.0, 1900.0])
def test_sysfs_pwm_equals_independent_driver(tmp_path: Path, pulse_us: float, monkeypatch: pytest.MonkeyPatch) -> None:
    ours = Bench(tmp_path / "ours")
    out = start_device(ours.open(esc_start_s=0.0), "the outputs")
    out.write_us([1500.0] * 2, 0.0)
    out.write_us([pulse_us] * 2, 0.0)
    tree = FakeSysfsPwm(tmp_path / "theirs")
    monkeypatch.setattr(HardwarePWM, "chippath", str(tree.root / "pwmchip0"))
    monkeypatch.setattr(HardwarePWM, "echo", lambda self, message, file: tree.write(Path(file), f"{message}\n"))
    monkeypatch.setattr(
        HardwarePWM, "__setattr__", lambda self, name, value: object.__setattr__(self, name, _moved(value, tree))
    )
    theirs = HardwarePWM(pwm_channel=0, hz=50)
    theirs.start(pulse_us / 200.0)
    assert tree.pulse_us(0) == ours.pins_us()[0] == pulse_us
    files = ("period", "duty_cycle", "enable", "polarity")
    read = [[(root / "pwmchip0/pwm0" / name).read_text() for name in files] for root in (tmp_path / "ours", tree.root)]
    assert read[0] == read[1]


def _moved(value: Any, tree: FakeSysfsPwm) -> Any:
    return value.replace("/sys/class/pwm", str(tree.root)) if isinstance(value, str) else value


@pytest.mark.parametrize("device", ["1f00098000.pwm", "fe20c000.pwm", "3f20c000.pwm"])
def test_find_chip_uses_device_link_not_number(tmp_path: Path, device: str) -> None:
    tree = FakeSysfsPwm(tmp_path, {0: "some-fan.pwm", 2: device})
    assert find_chip(tree.root).name == "pwmchip2"


def test_find_chip_missing_names_config_line(tmp_path: Path) -> None:
    with pytest.raises(DeviceError, match=r"No PWM chip of a Raspberry Pi in .*; there is: nothing") as e:
        find_chip(tmp_path)
    assert "dtoverlay=pwm-2chan,pin=12,func=4,pin2=13,func2=4 (5)" in e.value.fix
    FakeSysfsPwm(tmp_path, {0: "some-fan.pwm"})
    with pytest.raises(DeviceError, match=r"pwmchip0 is some-fan.pwm"):
        find_chip(tmp_path)


def test_sysfs_pwm_writes_pulse_length_before_enable(tmp_path: Path) -> None:
    bench = Bench(tmp_path, channels=1)
    bench.open().configure()
    written = [line for line in bench.tree.history if "/pwm" in line or line.startswith("pwm0/")]
    assert written.index("pwm0/duty_cycle 1500000") < written.index("pwm0/enable 1")


def test_sysfs_pwm_pin_of_another_program_raises_and_is_unchanged(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    chip = bench.tree.root / "pwmchip0"
    bench.tree.write(chip / "export", "1")
    with pytest.raises(DeviceError, match="pwm1 is in use: another program has exported it") as e:
        bench.open().configure()
    assert e.value.fix.endswith(f"echo 1 | sudo tee {chip}/unexport")
    assert bench.tree.pulse_us(1) == 0.0


def test_sysfs_pwm_reclaims_running_pins_at_neutral(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    killed = start_device(bench.open(esc_start_s=0.0), "the outputs")
    killed.write_us([1500.0] * 2, 0.0)
    killed.write_us([1900.0] * 2, 0.0)
    bench.tree.history.clear()
    next_one = bench.open(reclaim=True)  # kept: outputs without a reference release their pins
    next_one.configure()
    assert bench.tree.history[0] == "pwm0/duty_cycle 1500000"
    assert bench.pins_us() == [1500.0, 1500.0]


def test_sysfs_pwm_too_few_pins_suggests_other_outputs(tmp_path: Path) -> None:
    tree = FakeSysfsPwm(tmp_path)
    with pytest.raises(DeviceError, match="pwmchip0 has 2 channels; 8 are needed") as e:
        SysfsPins(8, root=tree.root, write=tree.write).open()
    assert "--io mcu:PORT" in e.value.fix


def test_sysfs_pwm_without_permission_names_group(tmp_path: Path) -> None:
    def refused(path: Path, text: str) -> None:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))

    with pytest.raises(DeviceError, match="export may not be written by this user: it belongs to group '") as e:
        Bench(tmp_path).open(write=refused).configure()
    assert "usermod -aG gpio" in e.value.fix


def test_sysfs_pwm_pin_disabled_by_another_process_is_lost(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    out = start_device(bench.open(esc_start_s=0.0), "the outputs")
    out.write_us([1500.0] * 2, 0.0)
    bench.tree.write(bench.tree.root / "pwmchip0/pwm1/enable", "0")
    assert LOST in out.write_us([1600.0] * 2, 0.0).reason
    assert "pwm1 was disabled by another process" in out.health().reason


def test_sysfs_pwm_close_unexports_pins(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    out = bench.open()
    out.configure()
    out.close()
    assert not (bench.tree.root / "pwmchip0/pwm0").exists()
    bench.open().configure()


def test_sysfs_pwm_without_supervisor_is_not_armed(tmp_path: Path) -> None:
    out = Bench(tmp_path).open(is_supervised=False)
    out.configure()
    with pytest.raises(DeviceError, match="The PWM chip keeps its last pulse if this program is killed"):
        out.activate()
