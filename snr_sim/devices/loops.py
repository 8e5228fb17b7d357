"""Loops between devices and pages: store a sensor's readings, write an actuator's commands. They use interfaces only.

Devices are opened when a loop is set up, on the thread that will use them, and never in a replay.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import msgspec

from snr_sim.core.loop import Loop, LoopFactory
from snr_sim.devices.commands import CommandInput, command_of
from snr_sim.prelude.device import Device, Sensor, Stale
from snr_sim.prelude.errors import CommandError, DeviceError
from snr_sim.prelude.interfaces import implements
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.task import Page, Task

MAX_STALE_NOTES = 5  # a loose plug is not logged indefinitely


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


class SensorLoopFactory(LoopFactory):
    """Reads a sensor at a rate and stores each reading as a page.

    Args:
        key: of the page.
        open_device: opens the sensor.
        rate_hz: how often it is read.
        process: whether a reading triggers a task `process_data`, or is only stored for later queries.
    """

    def __init__(self, key: str, open_device: Callable[[], Sensor[Any]], rate_hz: float, process: bool = True) -> None:
        super().__init__()
        self.key: str = key
        self.open_device: Callable[[], Sensor[Any]] = open_device
        self.rate_hz: float = rate_hz
        self.process: bool = process

    def get(self, parent: NodeApi) -> SensorLoop:
        """Return the loop `<key>_sensor`."""
        return SensorLoop(self, parent, f"{self.key}_sensor", self.rate_hz)

    def data_of(self, reading: Any) -> dict[str, Any]:
        """Return the data of a reading's page, with copies of lists and arrays."""
        data: dict[str, Any] = msgspec.to_builtins(reading)
        return data


class SensorLoop(DeviceLoop):
    """Stores `{field: value}` of the newest reading under the sensor's key.

    Without a reading nothing is stored, so the page grows old (`get_age_s`); this is logged once.
    """

    factory: SensorLoopFactory

    def setup(self) -> None:
        """Open the sensor."""
        self._stale_times = 0
        self._is_stale = False
        self.device: Any = start_device(self.factory.open_device(), f"the sensor '{self.factory.key}'")

    def loop(self) -> None:
        """Read once."""
        factory = self.factory
        reading = self.device.read()
        if type(reading) is Stale:
            self._log_stale(reading)
            return
        if self._is_stale:
            self._is_stale = False
            self._log_state("answers again")
        data = factory.data_of(reading)  # made here, so no snapshot is needed
        self.schedule(Task.store_page(Page(factory.key, data, self.parent.name, self.get_time_s(), factory.process)))

    def _log_stale(self, stale: Stale) -> None:
        if not self._is_stale:
            self._is_stale = True
            self._stale_times += 1
            self._log_state(f"has no reading: {stale.reason}")

    def _log_state(self, what: str) -> None:
        text = f"Sensor '{self.factory.key}', t = {self.get_time_s():.2f} s: it {what}"
        if self._stale_times < MAX_STALE_NOTES:
            self.parent.add_note(text)
        elif self._stale_times == MAX_STALE_NOTES:
            self.parent.add_note(f"{text} (not reported again)")


class ActuatorLoopFactory(LoopFactory):
    """Writes the newest command page to an actuator, and neutral when there is none or it is too old.

    Args:
        key: of the command page.
        open_device: opens the actuator.
        rate_hz: how often it is written.
        timeout_s: age from which a command is ignored.
    """

    def __init__(self, key: str, open_device: Callable[[], Device], rate_hz: float, timeout_s: float = 0.5) -> None:
        super().__init__()
        self.key: str = key
        self.open_device: Callable[[], Device] = open_device
        self.rate_hz: float = rate_hz
        self.timeout_s: float = timeout_s

    def get(self, parent: NodeApi) -> CommandLoop:
        """Return the loop `<key>_actuator`."""
        return ActuatorLoop(self, parent, f"{self.key}_actuator", self.rate_hz)


class CommandLoop(DeviceLoop):
    """Owns a device that follows the pages of its factory's key."""

    factory: ActuatorLoopFactory

    def __init__(self, factory: ActuatorLoopFactory, parent: NodeApi, name: str, max_tick_rate_hz: float) -> None:
        super().__init__(factory, parent, name, max_tick_rate_hz)
        self.commands: CommandInput = CommandInput(self, factory.key)

    def begin(self) -> None:
        """Start the ticks, and receive commands from now on."""
        self.commands.begin()
        super().begin()

    def join(self) -> None:
        """Stop the ticks."""
        self.commands.end()
        super().join()


class ActuatorLoop(CommandLoop):
    """Writes commands; an invalid command leaves the actuator at neutral and stops the run."""

    def setup(self) -> None:
        """Open the actuator and go to neutral."""
        self.device: Any = start_device(self.factory.open_device(), f"the actuator '{self.factory.key}'")
        self.device.neutral()
        self._written: Page | None = None

    def loop(self) -> None:
        """Write the newest command once; neutral if it is too old."""
        page, age_s = self.commands.newest()
        if page is None:
            return
        if age_s > self.factory.timeout_s:
            self.device.neutral()  # also if it has just arrived: it was delayed on the way
        elif page is not self._written:
            self._written = page
            self._write(page)

    def _write(self, page: Page) -> None:
        actuator = self.device
        try:
            command = command_of(page.data, actuator.command_type, actuator.limits)
            applied = actuator.write(command)
        except CommandError as error:
            actuator.neutral()
            raise self.commands.error_with_source(page, error) from error
        if applied != command:
            self.commands.note_clamped(command, applied, actuator.limits)

    def halt(self) -> None:
        """Go to neutral."""
        if self.device is not None:
            self.device.neutral()
        super().halt()
