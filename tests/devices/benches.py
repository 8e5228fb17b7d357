"""What benches of devices share: a clock that only the test moves, and parts on an I2C bus with a plug."""

from collections.abc import Mapping

from snr_sim.devices.wire.i2c_bus import I2cBus
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
