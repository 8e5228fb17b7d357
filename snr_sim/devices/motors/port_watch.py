"""Which serial ports have appeared and which are gone, each by an identity that does not depend on their order."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable

import msgspec

from snr_sim.devices.wire.serial_port import PortInfo
from snr_sim.prelude.errors import DeviceError

PERIOD_S = 0.5
_CONSOLES = re.compile(r"/dev/tty(S|AMA)\d+")  # of the kernel, on a computer's own pins


class PortChanges(msgspec.Struct, frozen=True):
    """What is different since the ports were listed before, by identity."""

    appeared: dict[str, PortInfo] = {}
    gone: tuple[str, ...] = ()


class PortWatch:
    """Lists the ports now and then, and compares.

    A port's identity is the serial number of its USB device; if it has none, or one there has the same, the USB path;
    else its device file. A port of which anything has changed is gone, and another one has appeared.

    Args:
        list_ports: returns all ports; a DeviceError counts as no news.
        others: ports that belong to other devices, as path, USB path or serial number: they are left alone.
        period_s: between two lists.
    """

    def __init__(
        self, list_ports: Callable[[], Iterable[PortInfo]], others: Collection[str] = (), period_s: float = PERIOD_S
    ) -> None:
        self._list_ports, self._others, self._period_s = list_ports, frozenset(others), period_s
        self._ports: dict[str, PortInfo] = {}
        self._due_s: float | None = None

    def poll(self, now_s: float) -> PortChanges:
        """Return the changes since the last call; none before the next list is due."""
        if self._due_s is not None and now_s < self._due_s:
            return PortChanges()
        self._due_s = now_s + self._period_s
        try:
            listed = [port for port in self._list_ports() if not self._is_left_alone(port)]
        except DeviceError:
            return PortChanges()
        gone = tuple(identity for identity, port in self._ports.items() if port not in listed)
        for identity in gone:
            del self._ports[identity]
        known = set(self._ports.values())
        appeared: dict[str, PortInfo] = {}
        for port in listed:
            if port not in known:
                identity = next(one for one in _candidates(port) if one not in self._ports)
                self._ports[identity] = appeared[identity] = port
        return PortChanges(appeared, gone)

    def _is_left_alone(self, port: PortInfo) -> bool:
        names = {port.path, port.serial_number, port.usb_path} - {""}
        return _CONSOLES.fullmatch(port.path) is not None or not names.isdisjoint(self._others)


def _candidates(port: PortInfo) -> list[str]:
    """Return what may identify a port, the best first; the last is unique among ports that are there."""
    return [one for one in (port.serial_number, port.usb_path) if one] + [port.path]
