"""A robot's file of motor controllers at real ports: which motor each drives, and what was measured of it.

links = "/dev/serial/by-path"      # a folder with a link to each port, by its socket; or a CAN bus, can:socketcan:can0

[vesc]                             # chip number of a controller --> motor; written by `snr io --identify`
                                   # on a CAN bus, the controller's number there, "7"; written by you
"3a00270000505345" = "motor_LF"

[timeout_s]                        # how long it drives without a command; written by `snr io --check-timeout`
"3a00270000505345" = 0.26
"""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import msgspec

from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.task import ensure_type_info

LINKS = "/dev/serial/by-path"


class PortsFile(msgspec.Struct, forbid_unknown_fields=True):
    """What the file holds.

    Args:
        links: folder of links, or a CAN bus as text: see `can_bus.py`.
        vesc: motors by chip number, or number on the CAN bus.
        timeout_s: measured timeouts by the same.
    """

    links: str = LINKS
    vesc: dict[str, str] = {}
    timeout_s: dict[str, float] = {}

    def write(self, path: Path) -> None:
        """Write the file; raise a ParameterError if that is not possible."""
        lines = [f"links = {_quoted(self.links)}", "", "[vesc]"]
        lines += [f"{_quoted(chip)} = {_quoted(motor)}" for chip, motor in self.vesc.items()]
        lines += ["", "[timeout_s]"]
        lines += [f"{_quoted(chip)} = {seconds:.3f}" for chip, seconds in self.timeout_s.items()]
        try:
            path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        except OSError as error:
            raise ParameterError(
                f"{path} cannot be written: {error.strerror}.", fix="--io ports:FILE in a folder of yours."
            ) from error


def read_ports(path: Path) -> PortsFile:
    """Return what a file holds, which may not exist yet; raise a ParameterError if it is not such a file."""
    if not path.exists():
        return PortsFile()
    try:
        return msgspec.convert(tomllib.loads(path.read_text(encoding="utf-8")), ensure_type_info(PortsFile))
    except (OSError, ValueError, msgspec.ValidationError) as error:
        raise ParameterError(
            f"{path} is not a file of ports: {error}.", fix="rename it: snr io --identify writes a new one."
        ) from error


def _quoted(text: Any) -> str:
    return msgspec.json.encode(text).decode()
