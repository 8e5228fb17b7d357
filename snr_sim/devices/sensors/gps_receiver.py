"""What satellite navigation receivers on serial ports share; `gps.py` and `piksi.py` have their protocols."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import ClassVar

from snr_sim.devices.wire.serial_port import BytePort
from snr_sim.devices.wire.wire_handle import WireHandle
from snr_sim.prelude.device import Stale
from snr_sim.prelude.errors import DeviceError
from snr_sim.prelude.life_cycle import LifeCycleSensor
from snr_sim.prelude.signals import GpsReading

FRESH_S = 2.5  # most receivers report once a second
RETRY_PERIOD_S = 1.0
_SHOWN = 16


class GpsReceiver(LifeCycleSensor, ABC):
    """A receiver on a serial port. Implements `Sensor`; reads `GpsReading`, and is stale without a fix.

    At the surface only: water blocks the signals. `now_s` is the clock that stamps readings on arrival.
    """

    protocol: ClassVar[str]
    bauds: ClassVar[str]  # usual ones, as text

    def __init__(self, open_port: Callable[[], BytePort], now_s: Callable[[], float]) -> None:
        self.title: str = "The receiver"
        self._now_s = now_s
        self._port = WireHandle(open_port, self)
        self._newest: GpsReading | None = None
        self._has_fix: bool | None = None  # None before it is reported
        self._received_bytes = 0
        self._last = b""
        self._retry_s = 0.0
        self._reset()

    def on_configure(self) -> None:
        """Open the port. A missing receiver is detected only when its messages stay out."""
        self.title = f"The receiver on {self._port.open().name}"
        self._received_bytes, self._last, self._has_fix = 0, b"", None
        self._reset()

    def read(self) -> GpsReading | Stale:
        """Return the newest fix; raise a SensorLostError if it was closed."""
        try:
            if self.state == "error" and self._now_s() >= self._retry_s:
                self._retry_s = self._now_s() + RETRY_PERIOD_S
                self.configure()
                self.activate()
            if self.state == "active":
                self._receive()
        except DeviceError as error:
            self.fail(error.message)
        newest = self._newest
        since_s = newest.stamp_s if newest else None
        idle = self.idle(since_s)
        if idle is not None:
            return idle
        if newest is not None and self._is_fresh():
            return newest
        return Stale(self._stale_reason(), since_s)

    def on_close(self) -> None:
        """Close the port."""
        self._port.close()

    @abstractmethod
    def _reset(self) -> None:
        """Begin with a new decoder."""

    @abstractmethod
    def _decode(self, data: bytes) -> None:
        """Decode received bytes, and set `_newest` and `_has_fix`."""

    @abstractmethod
    def _message_count(self) -> int:
        """Return how many intact messages have come, of any kind."""

    def _is_fresh(self) -> bool:
        return self._newest is not None and self._now_s() <= self._newest.stamp_s + FRESH_S

    def _receive(self) -> None:
        data = self._port.get().read()
        self._received_bytes += len(data)
        self._last = (self._last + data)[-_SHOWN:]
        self._decode(data)

    def _stale_reason(self) -> str:
        if self._received_bytes == 0:
            return f"{self.title} sends nothing: 0 bytes. Is its TX at our RX, and does it have power?"
        if self._message_count() == 0:
            return (
                f"{self.title} sent {self._received_bytes} bytes that are not {self.protocol}, such as "
                f"{self._last.hex(' ')}: another baud rate ({self.bauds}), or another device."
            )
        if self._has_fix is False:
            return f"{self.title} has no fix: it needs the open sky, for a minute when it is cold."
        return f"{self.title} has stopped telling where it is."
