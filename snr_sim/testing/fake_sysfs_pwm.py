"""The kernel's PWM files without a kernel: a folder of plain files, and a `write` that knows the kernel's rules.

What is read of it are real files, so another process, or an independent driver, sees the pulses.
"""

from __future__ import annotations

import errno
import os
import shutil
from pathlib import Path


class FakeSysfsPwm:
    """A folder as /sys/class/pwm.

    Args:
        root: where; made if it is not there.
        chips: target of the `device` link of each `pwmchip`, by its number.
        channels: of each chip.

    Attributes:
        is_there: whether the chip is; False simulates an overlay that was removed.
        history: every write that was accepted, as "pwm0/period 20000000".
    """

    def __init__(self, root: Path, chips: dict[int, str] | None = None, channels: int = 2) -> None:
        self.root: Path = root
        self.is_there: bool = True
        self.history: list[str] = []
        for number, device in ({0: "fe20c000.pwm"} if chips is None else chips).items():
            chip = root / f"pwmchip{number}"
            if chip.exists():
                continue
            chip.mkdir(parents=True)
            (root / "devices" / device).mkdir(parents=True, exist_ok=True)
            (chip / "device").symlink_to(root / "devices" / device)
            for name, text in (("npwm", str(channels)), ("export", ""), ("unexport", "")):
                (chip / name).write_text(text)

    def write(self, path: Path, text: str) -> None:
        """Write a file as the kernel accepts it.

        Raises:
            OSError: as the kernel refuses it.
        """
        if not self.is_there:
            raise OSError(errno.ENODEV, os.strerror(errno.ENODEV), str(path))
        chip, value = path.parent, text.strip()
        if path.name == "export":
            self._export(chip, int(value))
        elif path.name == "unexport":
            self._check((chip / f"pwm{value}").exists(), errno.ENODEV)
            shutil.rmtree(chip / f"pwm{value}")
        else:
            self._check_rules(path, value)
            _replace(path, value)
        self.history.append(f"{path.relative_to(path.parents[1])} {value}")

    def pulse_us(self, channel: int, chip: int = 0) -> float:
        """Return the pulse that is made; 0 for none."""
        return pulse_us(self.root / f"pwmchip{chip}" / f"pwm{channel}")

    def _export(self, chip: Path, channel: int) -> None:
        self._check(channel < int((chip / "npwm").read_text()), errno.ENODEV)
        self._check(not (chip / f"pwm{channel}").exists(), errno.EBUSY)
        (chip / f"pwm{channel}").mkdir()
        for name, text in (("period", "0"), ("duty_cycle", "0"), ("enable", "0"), ("polarity", "normal")):
            (chip / f"pwm{channel}" / name).write_text(text + "\n")

    def _check_rules(self, path: Path, value: str) -> None:
        now = {one: _number(path.parent / one) for one in ("period", "duty_cycle", "enable")}
        if path.name == "polarity":
            self._check(not now["enable"], errno.EBUSY)
            return
        self._check(value.isdecimal(), errno.EINVAL)
        new = {**now, path.name: int(value)}
        self._check(new["duty_cycle"] <= new["period"], errno.EINVAL)
        self._check(not new["enable"] or new["period"] > 0, errno.EINVAL)

    @staticmethod
    def _check(is_right: bool, number: int) -> None:
        if not is_right:
            raise OSError(number, os.strerror(number))


def pulse_us(pin: Path) -> float:
    """Return the pulse that the files of a pin ask for; 0 for none."""
    if not pin.exists() or not _number(pin / "enable"):
        return 0.0
    return _number(pin / "duty_cycle") / 1000.0


def _number(path: Path) -> int:
    return int(path.read_text())


def _replace(path: Path, value: str) -> None:
    """Change a file so that a reader sees the old or the new content, as with the kernel's."""
    new = path.with_name(f".{path.name}")
    new.write_text(value + "\n")
    new.replace(path)
