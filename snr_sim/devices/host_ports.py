"""Connectors of this computer: serial ports, I2C buses, PWM chips; and whether this user may use them.

Only names and permissions are read; nothing is opened. Sources of the paths: Linux' devices.txt and
Documentation/driver-api/pwm.rst; /dev/serial/by-id is made by systemd's udev rules.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from snr_sim.devices.pwm.sysfs_pwm import CHIPS, OVERLAYS
from snr_sim.devices.wire import serial_port
from snr_sim.devices.wire.permission import FileOwner, how_to_use, owner_of
from snr_sim.prelude.errors import MissingExtraError


@dataclass(frozen=True)
class HostPort:
    """One connector."""

    kind: str  # 'serial', 'i2c' or 'pwm'
    name: str  # as `--io` accepts it: a port, the number of a bus, a chip
    about: str  # further information
    fix: str = ""  # what to do before it can be used; empty if it can be


def may_use(path: Path) -> bool:
    """Return whether this user may read and write a file."""
    return os.access(path, os.R_OK | os.W_OK)


@dataclass(frozen=True)
class HostInfo:
    """A computer, or in a test a folder with the same files."""

    root: Path = Path("/")  # root folder of its files
    ports: Callable[[], list[str]] = serial_port.ports  # serial ports, each optionally with its device in brackets
    may_use: Callable[[Path], bool] = may_use
    owner_of: Callable[[Path], FileOwner] = owner_of

    @property
    def model(self) -> str:
        """Its model if known: 'Raspberry Pi 4 Model B Rev 1.4'."""
        return _text_of(self.root / "proc/device-tree/model")

    @property
    def is_pi(self) -> bool:
        """Whether it is a Raspberry Pi."""
        return "Raspberry Pi" in self.model

    def host_ports(self) -> Iterator[HostPort]:
        """Yield all connectors."""
        yield from self._serial()
        yield from self._i2c()
        yield from self._pwm()

    def _serial(self) -> Iterator[HostPort]:
        folder = self.root / "dev/serial/by-id"
        lasting = {link.readlink().name: link for link in sorted(folder.glob("*")) if link.is_symlink()}
        try:
            listed = [port.partition(" (") for port in self.ports()]
        except MissingExtraError as error:
            names = sorted(path.name for kind in ("ttyUSB*", "ttyACM*") for path in (self.root / "dev").glob(kind))
            for name in names:
                yield HostPort("serial", f"/dev/{name}", "not asked what it is", error.fix)
            return
        for name, _, what in listed:
            link = lasting.get(Path(name).name)
            details = [what.removesuffix(")")] if what else []
            details += [f"always /dev/serial/by-id/{link.name}"] if link is not None else []
            yield HostPort(
                "serial", name, ", ".join(details), self._permission_fix(self.root / name.lstrip("/"), "dialout")
            )

    def _i2c(self) -> Iterator[HostPort]:
        for path in sorted((self.root / "dev").glob("i2c-*")):
            about = _text_of(self.root / "sys/class/i2c-dev" / path.name / "name")
            yield HostPort("i2c", path.name.removeprefix("i2c-"), about, self._permission_fix(path, "i2c"))

    def _pwm(self) -> Iterator[HostPort]:
        for chip in sorted((self.root / "sys/class/pwm").glob("pwmchip*")):
            device = (chip / "device").resolve().name
            known = CHIPS.get(device)
            channels = _text_of(chip / "npwm") or "?"
            about = f"{chip.name}, {channels} channels, {f'the one of a {known}' if known else 'not a Pi header'}"
            yield HostPort("pwm", device, about, self._permission_fix(chip / "export", "gpio") if known else "")

    def _permission_fix(self, path: Path, usual: str) -> str:
        try:
            return "" if self.may_use(path) else how_to_use(path, usual, self.owner_of(path))
        except OSError as error:
            return f"{path}: {error.strerror}"

    def missing(self, kind: str) -> str:
        """Return how to add what is missing to a Raspberry Pi, or to any computer."""
        return {
            "serial": "plug the board in with a cable that carries data; `dmesg | tail` shows its name.",
            "i2c": "sudo raspi-config nonint do_i2c 0 on a Raspberry Pi; else sudo modprobe i2c-dev.",
            "pwm": OVERLAYS,
        }[kind]


def _text_of(path: Path) -> str:
    """Return the text in one of the kernel's files; empty if there is none."""
    try:
        return path.read_text(errors="replace").strip("\0\n ")
    except OSError:
        return ""
