"""How a user gets access to a port, a bus or a PWM pin: by joining its group, or by a rule that gives it one.

Joining a group helps only if that group may read and write the file, and users should not join 'root'. Fresh systems
leave some ports to root alone: then a udev rule is needed. Source of the rules' syntax: man 7 udev.
"""

from __future__ import annotations

import stat
from dataclasses import dataclass
from pathlib import Path

RULES = "/etc/udev/rules.d/90-snr.rules"
_ON_BOARD = ("ttyS", "ttyAMA", "ttyTHS")  # a system may use these for its console


@dataclass(frozen=True)
class FileOwner:
    """Group of a file."""

    group: str  # its group's name, or number if it has none
    has_access: bool  # whether members of that group may read and write it


def owner_of(path: Path) -> FileOwner:
    """Return the group of a file; raise an OSError if it does not exist."""
    about = path.stat()
    required = stat.S_IWGRP if path.name == "export" else stat.S_IRGRP | stat.S_IWGRP  # export is write-only
    try:
        name = path.group()
    except KeyError:
        return FileOwner(str(about.st_gid), False)  # a group without a name cannot be joined
    return FileOwner(name, about.st_gid != 0 and about.st_mode & required == required)


def group_of(path: Path) -> str:
    """Return the name of a file's group, or 'unknown'."""
    try:
        return path.group()
    except (OSError, KeyError):
        return "unknown"


def how_to_use(path: Path, usual: str, owner: FileOwner | None = None) -> str:
    """Return how to get access to a file.

    Args:
        path: a port, a bus, or a file of a PWM chip.
        usual: the group that such files usually belong to: 'dialout', 'i2c', 'gpio'.
        owner: its group; read from the file if not given, and as usual if there is no file.

    >>> how_to_use(Path("/dev/ttyUSB0"), "dialout", FileOwner("dialout", True))
    'sudo usermod -aG dialout $USER, then log out and in again.'
    """
    if owner is None:
        try:
            owner = owner_of(path)
        except OSError:
            owner = FileOwner(usual, True)
    if owner.has_access:
        return _join(owner.group)
    rule = f'KERNEL=="{path.name}", GROUP="{usual}", MODE="0660"'
    if usual == "gpio":
        rule = 'SUBSYSTEM=="pwm", RUN+="/bin/sh -c \'chgrp -R gpio /sys%p; chmod -R g+rwX /sys%p\'"'
    console = ""
    if path.name.startswith(_ON_BOARD):
        console = (
            f"`sudo fuser -v {path}` shows whether the system console uses it (on a Raspberry Pi: raspi-config, Serial "
            "Port, no login shell). If not: "
        )
    return (
        f"{console}its group '{owner.group}' may not use it or is not to be joined, so a udev rule must give it to "
        f"'{usual}'. Write into {RULES} the line  {rule}  and restart; then {_join(usual)}"
    )


def _join(group: str) -> str:
    return f"sudo usermod -aG {group} $USER, then log out and in again."
