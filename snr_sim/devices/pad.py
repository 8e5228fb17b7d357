"""A game controller as pages: the loop between any pad and the node. An unplugged pad releases all sticks and buttons.

The pad implements the sensor interface: `devices/pygame_pad.py` is a real one, and a test uses a `FakeSensor` of
readings.
"""

from __future__ import annotations

from collections.abc import Callable

import msgspec

from snr_sim.core.loop import LoopFactory
from snr_sim.devices.loops import DeviceLoop, started
from snr_sim.prelude.device import Sensor, Stale
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.signals import PadReading


class PadLoopFactory(LoopFactory):
    """Reads a pad at a rate and stores each reading as a page.

    Args:
        key: of the page; it holds the fields of a `PadReading`.
        open_device: opens the pad.
        rate_hz: how often it is read.
    """

    def __init__(self, key: str, open_device: Callable[[], Sensor[PadReading]], rate_hz: float = 50.0) -> None:
        super().__init__()
        self.key = key
        self.open_device = open_device
        self.rate_hz = rate_hz

    def get(self, parent: NodeApi) -> PadLoop:
        """Return the loop `<key>_pad`."""
        return PadLoop(self, parent, f"{self.key}_pad", self.rate_hz)


class PadLoop(DeviceLoop):
    """Stores readings; while the pad has none, a reading at rest from the same tick on.

    Other sensors store no page meanwhile. A pad is unplugged by accident, and comes back.
    """

    factory: PadLoopFactory

    def setup(self) -> None:
        """Open the pad."""
        self.device = started(self.factory.open_device(), f"the pad '{self.factory.key}'")
        self._last = PadReading([], [], [], is_connected=False)

    def loop(self) -> None:
        """Read once."""
        reading = self.device.read()
        if isinstance(reading, Stale):
            if self._last.is_connected:
                self.log.warning("%s", reading.why)
            reading = at_rest(self._last)
        self._last = reading
        self.store_data(self.factory.key, msgspec.to_builtins(self._last))


def at_rest(reading: PadReading) -> PadReading:
    """Return the reading of a pad that is unplugged: as many axes and buttons, all released.

    Its stamp stays that of the last real reading.

    >>> at_rest(PadReading([0.5, -1.0], [True], [[0, 1]], stamp_s=7.5))
    PadReading(axes=[0.0, 0.0], buttons=[False], hats=[[0, 0]], is_connected=False, stamp_s=7.5)
    """
    still, up, middle = [0.0] * len(reading.axes), [False] * len(reading.buttons), [[0, 0]] * len(reading.hats)
    return PadReading(still, up, middle, is_connected=False, stamp_s=reading.stamp_s)
