"""A game controller as pages: the loop between any pad and the node. An unplugged pad releases all sticks and buttons.

The pad implements the sensor interface: `devices/pygame_gamepad.py` is a real one, and a test uses a `FakeSensor` of
readings.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import msgspec

from snr_sim.core.loop import LoopFactory
from snr_sim.devices.device_loop import DeviceLoop, start_device
from snr_sim.prelude.device import Sensor, Stale
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.signals import GamepadReading


class GamepadLoopFactory(LoopFactory):
    """Reads a pad at a rate and stores the fields of each `GamepadReading` as a page.

    Arguments are those of `SensorLoopFactory`.
    """

    def __init__(self, key: str, open_device: Callable[[], Sensor[GamepadReading]], rate_hz: float = 50.0) -> None:
        super().__init__()
        self.key: str = key
        self.open_device: Callable[[], Sensor[GamepadReading]] = open_device
        self.rate_hz: float = rate_hz

    def get(self, parent: NodeApi) -> GamepadLoop:
        """Return the loop `<key>_sensor`."""
        return GamepadLoop(self, parent, f"{self.key}_sensor", self.rate_hz)


class GamepadLoop(DeviceLoop):
    """Stores readings; while the pad has none, a reading at rest from the same tick on.

    Other sensors store no page meanwhile. A pad is unplugged by accident, and comes back.
    """

    factory: GamepadLoopFactory

    def setup(self) -> None:
        """Open the pad."""
        self.device: Any = start_device(self.factory.open_device(), f"the pad '{self.factory.key}'")
        self._last = GamepadReading([], [], [], is_connected=False)

    def loop(self) -> None:
        """Read once."""
        reading = self.device.read()
        if isinstance(reading, Stale):
            if self._last.is_connected:
                self.log.warning("%s", reading.reason)
            reading = neutral_reading(self._last)
        self._last = reading
        self.store_data(self.factory.key, msgspec.to_builtins(self._last))


def neutral_reading(reading: GamepadReading) -> GamepadReading:
    """Return the reading of a pad that is unplugged: as many axes and buttons, all released.

    Its stamp stays that of the last real reading.

    >>> neutral_reading(GamepadReading([0.5, -1.0], [True], [[0, 1]], stamp_s=7.5))
    GamepadReading(axes=[0.0, 0.0], buttons=[False], hats=[[0, 0]], is_connected=False, stamp_s=7.5)
    """
    still, up, middle = [0.0] * len(reading.axes), [False] * len(reading.buttons), [[0, 0]] * len(reading.hats)
    return GamepadReading(still, up, middle, is_connected=False, stamp_s=reading.stamp_s)
