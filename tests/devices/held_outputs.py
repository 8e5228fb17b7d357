"""Outputs that supervisors open in tests, and a robot's program that commands thrust until it is killed."""

import mmap
import sys
import time
from pathlib import Path

from snr_sim.devices.pwm.passive_pwm import PassivePwm
from snr_sim.devices.pwm.pca9685 import Pca9685
from snr_sim.devices.pwm.supervised_pwm import SupervisedPwm
from snr_sim.devices.pwm.sysfs_pwm import SysfsPins
from snr_sim.devices.wire.i2c_bus import I2cBus
from snr_sim.testing.fake_i2c import FakeBus, FakePca9685
from snr_sim.testing.fake_sysfs_pwm import FakeSysfsPwm

FAST = [1900.0, 1900.0]
STOP = [1500.0, 1500.0]


def open_tree(root: str, reclaim: bool) -> PassivePwm:
    """Open the kernel's PWM files in a folder."""
    write = FakeSysfsPwm(Path(root)).write
    pins = SysfsPins(2, root=Path(root), reclaim=reclaim, write=write)
    return PassivePwm(pins, time.monotonic, esc_start_s=0.05, is_supervised=True)


def open_chip(file: str, reclaim: bool) -> PassivePwm:
    """Open a PCA9685 whose registers are in a file."""
    bus = FakeBus({0x40: chip_in(file)})
    chip = Pca9685(lambda: I2cBus(1, bus.opened), 0x40, 2)
    return PassivePwm(chip, time.monotonic, esc_start_s=0.05, is_supervised=True)


def chip_in(file: str) -> FakePca9685:
    """Return a PCA9685 whose registers are a file of 256 bytes."""
    with Path(file).open("r+b") as opened:
        return FakePca9685(registers=mmap.mmap(opened.fileno(), 256))


def supervised(opener: str, place: str) -> SupervisedPwm:
    """Return the outputs behind a supervisor."""
    like = globals()[opener](place, False)
    return SupervisedPwm(like, time.monotonic, f"held_outputs:{opener}", [place])


def push(opener: str, place: str) -> None:
    """Arm, and command full thrust; print when it is applied."""
    out = supervised(opener, place)
    out.configure()
    out.activate()
    has_printed = False
    while True:
        pulses = FAST if out.health().state == "active" else STOP
        applied = out.write_us(pulses, time.monotonic())
        if not has_printed and pulses is FAST and not applied.reason:
            print("pushing", flush=True)
            has_printed = True
        if out.health().state == "inactive":
            out.activate()  # a busy computer: a lease has expired
        if out.health().state == "error":
            print(out.health(), flush=True)
            return
        time.sleep(0.02)


if __name__ == "__main__":
    push(*sys.argv[1:])
