"""The motor controllers of a vehicle by name, whichever ports they are plugged into.

    list of ports --> PortWatch --appeared, gone--> MotorPorts <--bytes--> Handshake, one for each port
                                                        '--open_port(name)--> VescLine

A name stays with its controller, so swapped cables change nothing. Two controllers of one name have neither of them.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress

from snr_sim.devices.motors.handshake import SAME_S, Handshake
from snr_sim.devices.motors.port_watch import PortWatch
from snr_sim.devices.wire.serial_port import BytePort, PortInfo
from snr_sim.prelude.errors import DeviceError

AGAIN_S = 30.0  # then a port without a name is asked again
REOPEN_S = 1.0  # one that failed sooner: it may have been unplugged, and put back before the next list of ports
_WAIT_S, _WAITS = 0.02, 100  # at the start, when no port has been asked; a handshake takes 1.1 s


class MotorPorts:
    """Asks all ports who is there, and opens them by name. Thread-safe.

    Args:
        watch: over the ports.
        open_path: opens a port by its device file.
        now_s: the clock of handshakes.
        chips: see `Handshake`.
    """

    def __init__(
        self,
        watch: PortWatch,
        open_path: Callable[[str], BytePort],
        now_s: Callable[[], float],
        chips: Mapping[str, str] | None = None,
    ) -> None:
        self._watch, self._open_path, self._now_s, self._chips = watch, open_path, now_s, chips or {}
        self._ports: dict[str, _Port] = {}  # by identity
        self._lost: dict[str, str] = {}
        self._waits = _WAITS
        self._lock = threading.RLock()

    def poll(self) -> dict[str, str]:
        """Look what was plugged in and out, and ask on, without waiting.

        Returns:
            The names whose opened ports must be closed, each once, and why.
        """
        with self._lock:
            self._look()
            lost, self._lost = self._lost, {}
            return lost

    def open_port(self, name: str) -> BytePort:
        """Return the port of a controller. Wait while ports are being asked, for 2 s in all calls together.

        One that was opened before is asked again: meanwhile another controller may be there.

        Raises:
            DeviceError: the name is at no port, at two, or at one that is still being asked.
        """
        with self._lock:
            self._look()
            while self._waits and not self._found(name) and (asking := self._asking()):
                self._waits -= 1
                with suppress(DeviceError):  # it is gone, which the next step notes
                    asking[0].wait(_WAIT_S)
                self._look()
            for port in self._found(name):
                if port.line is None:
                    self._ask(port)
            found = self._found(name)
            line = found[0].line if len(found) == 1 else None
            if line is None:
                raise self._error(name, found)
            found[0].line, found[0].is_used = None, True
            self._lost.pop(name, None)
            return line

    def _look(self) -> None:
        now_s = self._now_s()
        changes = self._watch.poll(now_s)
        for identity in changes.gone:
            port = self._ports.pop(identity)
            port.close()
            if port.is_used:
                self._lost[port.name] = f"The controller of {port.name} was unplugged from {port.info.title}."
        for identity, info in changes.appeared.items():
            self._ports[identity] = port = _Port(info)
            self._ask(port)
        for port in self._ports.values():
            if now_s >= port.again_s - SAME_S:
                self._ask(port)
            port.step(now_s)
        for name in sorted({port.name for port in self._ports.values() if port.is_used}):
            found = self._found(name)
            if len(found) > 1:
                self._lost[name] = self._error(name, found).message
                for port in found:
                    port.is_used = False

    def _ask(self, port: _Port) -> None:
        now_s = self._now_s()
        port.ask(self._open_path, Handshake(self._chips), now_s)
        port.step(now_s)

    def _found(self, name: str) -> list[_Port]:
        return [port for port in self._ports.values() if port.name == name]

    def _asking(self) -> list[BytePort]:
        return [port.line for port in self._ports.values() if port.line is not None and not port.name]

    def _error(self, name: str, found: list[_Port]) -> DeviceError:
        if len(found) > 1:
            titles = " and ".join(port.info.title for port in found)
            how_many = "both" if len(found) == 2 else "all"
            return DeviceError(
                f"Controllers on {titles} {how_many} say they are '{name}'. Neither is driven.",
                fix="give one another name, or unplug it.",
            )
        others = "; ".join(f"{port.info.title} {port.status}" for port in self._ports.values() if not port.name)
        return DeviceError(
            f"No controller says it is '{name}'.{f' Other ports: {others}.' if others else ''}",
            fix="is its cable in, and does it have power?",
        )


class _Port:
    """A port, and what is known of its device.

    Attributes:
        line: while it is open here; a port that was handed out is not.
        name: of its controller; empty if unknown.
        status: the same as text.
        again_s: when to ask again.
        is_used: the port was handed out.
    """

    def __init__(self, info: PortInfo) -> None:
        self.info: PortInfo = info
        self.line: BytePort | None = None
        self.name: str = ""
        self.status: str = ""
        self.again_s: float = math.inf
        self.is_used: bool = False

    def ask(self, open_path: Callable[[str], BytePort], handshake: Handshake, now_s: float) -> None:
        """Open the port, and begin a handshake."""
        self.close()
        self._handshake = handshake
        self.name, self.status, self.is_used = "", "is being asked for its name", False
        self.again_s = now_s + AGAIN_S
        try:
            self.line = open_path(self.info.path)
        except DeviceError as error:
            self._fail(f"cannot be opened: {error.message}", now_s)

    def step(self, now_s: float) -> None:
        """Exchange the bytes that are due, and note the result."""
        line, handshake = self.line, self._handshake
        if line is None or self.name:
            return
        try:
            while sent := handshake.step(line.read(), now_s):
                line.write(sent)
        except DeviceError as error:
            self._fail(f"cannot be used: {error.message}", now_s)
            return
        if handshake.name:
            self.again_s = math.inf
        if handshake.is_controller:
            self.name, self.status = handshake.name, f"is '{handshake.name}'"
        elif handshake.is_done:
            self.close()
            self.status = handshake.failure or f"is '{handshake.name}', which is not a motor controller"

    def _fail(self, status: str, now_s: float) -> None:
        self.close()
        self.status, self.again_s = status, now_s + REOPEN_S

    def close(self) -> None:
        """Close the port, if it was not handed out."""
        line, self.line = self.line, None
        if line is not None:
            line.close()
