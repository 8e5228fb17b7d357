"""Byte formats of devices: framing, encoding and decoding, and the ports and buses that carry them."""

from typing import TYPE_CHECKING

from snr_sim.lazy import lazy_names

if TYPE_CHECKING:
    from snr_sim.devices.wire.i2c_bus import I2cBus as I2cBus
    from snr_sim.devices.wire.serial_port import BytePort as BytePort
    from snr_sim.devices.wire.serial_port import SerialPort as SerialPort
else:
    __all__, __getattr__, __dir__ = lazy_names(__name__)
