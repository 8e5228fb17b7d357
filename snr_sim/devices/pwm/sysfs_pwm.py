"""PWM pins of a Raspberry Pi through the kernel's files: two or four exact pulses without further hardware.

The chip is found by the target of its `device` link, never by its number: a Pi 5's was pwmchip2 with kernel 6.6 and is
pwmchip0 with 6.12. The kernel keeps generating the last pulse when this program is killed, so these outputs can be
armed only behind the supervisor.

    /sys/class/pwm/pwmchip0/device -> .../1f00098000.pwm
                            npwm, export, unexport
                            pwm0/period, duty_cycle [ns], enable, polarity

Source of the files and their rules: the kernel's Documentation/driver-api/pwm.rst. Addresses: Raspberry Pi 5 measured
by users (raspberrypi/linux#6818), 4 and 3 from their device trees.
"""

from __future__ import annotations

import errno
import os
import time
from collections.abc import Callable
from pathlib import Path

from snr_sim.devices.pwm.passive_pwm import PwmChip
from snr_sim.devices.pwm.pwm_backend import LIMITS_US, STOP_US
from snr_sim.devices.wire.permission import group_of, how_to_use
from snr_sim.prelude.errors import DeviceError

ROOT: Path = Path("/sys/class/pwm")
CHIPS = {"1f00098000.pwm": "Raspberry Pi 5", "fe20c000.pwm": "Raspberry Pi 4", "3f20c000.pwm": "Raspberry Pi 3"}
PERIOD_NS = 20_000_000
OVERLAYS = (
    "in config.txt dtoverlay=pwm-2chan (Raspberry Pi 3, 4), or "
    "dtoverlay=pwm-2chan,pin=12,func=4,pin2=13,func2=4 (5); then restart."
)
HOLD_S = 0.1  # five pulses: a speed controller that just loses its signal may keep its thrust for seconds
PERMISSION_S = 1.0  # udev gives new files to their group a moment after they appear


def write_file(path: Path, text: str) -> None:
    """Write one of the kernel's files in a single call."""
    with path.open("w", encoding="ascii") as file:
        file.write(text)


class SysfsPins(PwmChip):
    """The first channels of the Pi's PWM chip. It holds its last pulses.

    Args:
        channels, limits_us: as in PwmChip.
        now_s: the clock of waits.
        root: where the kernel's files are.
        reclaim: pins that are in use belong to a killed supervisor of this program.
        write: writes a file.
        sleep: waits for udev.
    """

    def __init__(
        self,
        channels: int,
        limits_us: tuple[float, float] = LIMITS_US,
        now_s: Callable[[], float] = time.monotonic,
        root: Path = ROOT,
        reclaim: bool = False,
        write: Callable[[Path, str], None] = write_file,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        super().__init__("The PWM chip", channels, limits_us, resolution_us=0.001)
        self._now_s, self._root, self._reclaim = now_s, root, reclaim
        self._write_file, self._sleep = write, sleep
        self._chip: Path | None = None
        self._pins: list[Path] = []

    def open(self) -> None:
        """Find the chip, export its channels, and start neutral pulses.

        Raises:
            DeviceError: no such chip, too few channels, one in use by another process, or no permission.
        """
        reclaim = self._reclaim or self._chip is not None
        self._chip, self._pins = find_chip(self._root), []
        count = int(self._read(self._chip / "npwm") or 0)
        if count < self.channels:
            raise DeviceError(
                f"{self._chip.name} has {count} channels; {self.channels} are needed.",
                fix="--io mcu:PORT or --io pca9685:BUS:ADDR, which have more.",
            )
        for channel in range(self.channels):
            self._take(self._chip, channel, reclaim)

    def send(self, pulses_us: list[float]) -> list[float]:
        """Write the length of each pulse, and check that it is still generated."""
        if len(self._pins) < self.channels:
            raise DeviceError(f"{self.title} is not open.", fix="call configure() first.")
        for pin, pulse_us in zip(self._pins, pulses_us, strict=True):
            self._write(pin / "duty_cycle", str(round(pulse_us * 1000.0)))
            if self._read(pin / "enable") != "1":
                raise DeviceError(
                    f"PWM output {pin} was disabled by another process.",
                    fix=f"run `sudo fuser -v {pin}` to find it, then stop it.",
                )
        return pulses_us

    def close(self) -> None:
        """Stop the pulses after holding neutral, and unexport the channels."""
        pins, self._pins = self._pins, []
        if pins:
            self._sleep(HOLD_S)
        for pin in pins:
            self._write(pin / "enable", "0")
            self._write(pin.parent / "unexport", pin.name.removeprefix("pwm"))

    def _take(self, chip: Path, channel: int, reclaim: bool) -> None:
        pin = chip / f"pwm{channel}"
        if not pin.exists():
            self._write(chip / "export", str(channel))
        elif not reclaim:
            raise DeviceError(
                f"{pin} is in use: another program has exported it, or left it so when it was killed.",
                fix=f"end that program; then: echo {channel} | sudo tee {chip}/unexport",
            )
        self._wait_for_permission(pin)
        self._pins.append(pin)
        neutral = str(round(STOP_US * 1000.0))
        if self._read(pin / "period") != str(PERIOD_NS):
            self._write(pin / "duty_cycle", "0")  # never longer than the period
            self._write(pin / "period", str(PERIOD_NS))
        self._write(pin / "duty_cycle", neutral)
        if self._read(pin / "polarity") not in ("normal", ""):
            self._write(pin / "enable", "0")  # it changes only while disabled
            self._write(pin / "polarity", "normal")
        self._write(pin / "enable", "1")  # after the pulse's length, so that the first one is neutral
        if self._read(pin / "enable") != "1":
            raise DeviceError(f"{pin} is still disabled: the kernel ignored the command.", fix="read `dmesg | tail`.")

    def _wait_for_permission(self, pin: Path) -> None:
        until_s = self._now_s() + PERMISSION_S
        while self._now_s() < until_s and not os.access(pin / "enable", os.W_OK):
            self._sleep(0.01)

    def _write(self, path: Path, text: str) -> None:
        try:
            self._write_file(path, text)
        except OSError as error:
            raise _access_error(path, text, error) from error

    def _read(self, path: Path) -> str:
        try:
            return path.read_text(encoding="ascii").strip()
        except OSError as error:
            if path.name == "polarity" and error.errno == errno.ENOENT:
                return ""  # not every chip has it
            raise _access_error(path, "", error) from error


def find_chip(root: Path = ROOT) -> Path:
    """Return the folder of the Pi's PWM chip; without one, a DeviceError names the missing line of config.txt."""
    found = {chip: (chip / "device").resolve().name for chip in sorted(root.glob("pwmchip*"))}
    for chip, device in found.items():
        if device in CHIPS:
            return chip
    others = ", ".join(f"{chip.name} is {device}" for chip, device in found.items()) or "nothing"
    raise DeviceError(f"No PWM chip of a Raspberry Pi in {root}; there is: {others}.", fix=OVERLAYS)


def _access_error(path: Path, text: str, error: OSError) -> DeviceError:
    if error.errno in (errno.EACCES, errno.EPERM):
        return DeviceError(
            f"{path} may not be written by this user: it belongs to group '{group_of(path)}'.",
            fix=how_to_use(path, "gpio"),
        )
    if error.errno == errno.EBUSY:
        return DeviceError(
            f"{path}: the kernel reports that it is in use.", fix="a dtoverlay or a driver has this pin."
        )
    if error.errno == errno.EINVAL:
        return DeviceError(f"{path} did not take '{text}': Invalid argument.", fix="`dmesg | tail`; another dtoverlay?")
    return DeviceError(f"{path}: {error.strerror}.", fix="was the overlay taken away? `ls /sys/class/pwm`.")
