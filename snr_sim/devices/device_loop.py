"""Base of the loops between devices and pages: a device is opened on the thread that will use it, never in a replay."""

from __future__ import annotations

from typing import Any

from snr_sim.core.loop import Loop
from snr_sim.prelude.device import Device
from snr_sim.prelude.errors import DeviceError
from snr_sim.prelude.interfaces import implements


def configure_device(device: Any, what: str) -> Any:
    """Configure a device that has just been opened, and return it.

    Raises:
        DeviceError: it is not a device; or an error of its `configure`.
    """
    if not implements(device, Device):
        raise DeviceError(
            f"What was opened as {what} is {device!r}, which lacks one of configure, activate, deactivate, health "
            "and close.",
            fix="derive its class from snr_sim.LifeCycle, which has them.",
        )
    device.configure()
    return device


def start_device(device: Any, what: str) -> Any:
    """Configure and activate a device that has just been opened, and return it; see `configure_device`."""
    configure_device(device, what).activate()
    return device


class DeviceLoop(Loop):
    """Owns a device from `setup` on, and closes it."""

    device: Any = None

    def halt(self) -> None:
        """Stop measuring, or go to neutral."""
        if self.device is not None:
            self.device.deactivate("the robot's program ends")

    def terminate(self) -> None:
        """Close the device."""
        if self.device is not None:
            self.device.close()
