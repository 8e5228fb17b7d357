"""What benches of devices share: a clock that only the test moves, and parts on a bus or a cable with a plug."""

from collections.abc import Mapping
from typing import Any

from snr_sim.devices.device_loop import start_device
from snr_sim.devices.wire.i2c_bus import I2cBus
from snr_sim.prelude.device import Stale
from snr_sim.prelude.errors import DeviceError
from snr_sim.testing.fake_i2c import FakeBus, I2cDevice


class Bench:
    can_unplug = True
    time_s = 0.0

    def now_s(self) -> float:
        return self.time_s

    def advance(self, seconds: float) -> None:
        self.time_s += seconds


class I2cBench(Bench):
    def __init__(self, parts: Mapping[int, I2cDevice]) -> None:
        self.raw = FakeBus(dict(parts))

    def bus(self) -> I2cBus:
        return I2cBus(1, self.raw.opened)

    def unplug(self) -> None:
        self.raw.is_there = False

    def plug_in(self) -> None:
        self.raw.is_there = True


class SerialReceiver(Bench):
    """The far end of a satellite receiver's cable."""

    name = "/dev/ttyS0"

    def __init__(self) -> None:
        self.pending = b""
        self.is_plugged = True

    def open(self) -> "SerialReceiver":
        self._check()
        return self

    def started(self, kind: Any) -> Any:
        """Return a receiver of this class, measuring."""
        return start_device(kind(self.open, self.now_s), "the receiver")

    def write(self, data: bytes) -> None:
        self._check()

    def read(self) -> bytes:
        self._check()
        sent, self.pending = self.pending, b""
        return sent

    def wait(self, seconds: float) -> bool:
        return bool(self.pending)

    def close(self) -> None:
        pass

    def _check(self) -> None:
        if not self.is_plugged:
            raise DeviceError("/dev/ttyS0 is gone: [Errno 5] Input/output error.", fix="is the cable in?")


def stale(reading: object) -> str:
    """Return why there is no reading."""
    assert isinstance(reading, Stale), reading
    return reading.reason
