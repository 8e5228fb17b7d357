"""The loops between devices and pages: a sensor's readings in, an actuator's commands out. They see promises only.

Devices are opened when a loop is set up, on the thread that will use them, and never in a replay.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import msgspec

from snr_sim.core.ages import age_s
from snr_sim.core.authors import who_stored
from snr_sim.core.loop import Loop, LoopFactory
from snr_sim.devices.commands import command_of, in_words
from snr_sim.prelude.device import Actuator, Device, Sensor, Stale
from snr_sim.prelude.errors import CommandError, DeviceError
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.page import Page
from snr_sim.prelude.promises import keeps
from snr_sim.prelude.task import Task

STALE_NOTES = 5  # a loose plug is not told of for ever


def configured(device: Any, what: str) -> Any:
    """Returns a device that has just been opened, configured.

    Raises:
        DeviceError: it is none; or what its `configure` says.
    """
    if not keeps(device, Device):
        raise DeviceError(
            f"What was opened as {what} is {device!r}, which lacks one of configure, activate, deactivate, health "
            "and close.",
            fix="derive its class from snr_sim.LifeCycle, which has them.",
        )
    device.configure()
    return device


def started(device: Any, what: str) -> Any:
    """Returns a device that has just been opened, configured and active.

    Raises:
        DeviceError: it is none; or what its `configure` and `activate` say.
    """
    device = configured(device, what)
    device.activate()
    return device


class SensorLoopFactory(LoopFactory):
    """Reads a sensor at a rate and stores each reading as a page.

    Args:
        key: of the page.
        open_device: opens the sensor.
        rate_hz: how often it is read.
        process: whether a reading sets off work (a task `process_data`), or is only there for who looks it up.
    """

    def __init__(self, key: str, open_device: Callable[[], Sensor[Any]], rate_hz: float, process: bool = True) -> None:
        super().__init__()
        self.key = key
        self.open_device = open_device
        self.rate_hz = rate_hz
        self.process = process

    def get(self, parent: NodeApi) -> SensorLoop:
        """Returns the loop `<key>_sensor`."""
        return SensorLoop(self, parent, f"{self.key}_sensor", self.rate_hz)


class SensorLoop(Loop):
    """Stores `{field: value}` of the newest reading under the sensor's key.

    While the sensor has none nothing is stored, so the page grows old (`get_age_s`), and it is said once.
    """

    factory: SensorLoopFactory

    def setup(self) -> None:
        """Opens the sensor."""
        self._stale_times = 0
        self._is_stale = False
        self.sensor = started(self.factory.open_device(), f"the sensor '{self.factory.key}'")

    def loop(self) -> None:
        """Reads once."""
        factory = self.factory
        reading = self.sensor.read()
        if type(reading) is Stale:
            self._say_stale(reading)
            return
        if self._is_stale:
            self._is_stale = False
            self._say("answers again")
        data = self.data_of(reading)  # made here, so that no snapshot is needed
        self.schedule(Task.store_page(Page(factory.key, data, self.parent.name, self.get_time_s(), factory.process)))

    def data_of(self, reading: Any) -> dict[str, Any]:
        """Returns what the page of a reading holds, with lists and arrays of its own."""
        data: dict[str, Any] = msgspec.to_builtins(reading)
        return data

    def _say_stale(self, stale: Stale) -> None:
        if not self._is_stale:
            self._is_stale = True
            self._stale_times += 1
            self._say(f"has no reading: {stale.why}")

    def _say(self, what: str) -> None:
        text = f"Sensor '{self.factory.key}', t = {self.get_time_s():.2f} s: it {what}"
        if self._stale_times < STALE_NOTES:
            self.parent.note(text)
        elif self._stale_times == STALE_NOTES:
            self.parent.note(f"{text} (no more is said of that)")

    def halt(self) -> None:
        """Ends measuring."""
        if "sensor" in self.__dict__:
            self.sensor.deactivate("the robot's program ends")

    def terminate(self) -> None:
        """Closes the sensor."""
        if "sensor" in self.__dict__:
            self.sensor.close()


class ActuatorLoopFactory(LoopFactory):
    """Writes the newest command page to an actuator, and neutral when there is none or it is too old.

    Args:
        key: of the command page.
        open_device: opens the actuator.
        rate_hz: how often it is written.
        timeout_s: age from which a command no longer counts.
    """

    def __init__(self, key: str, open_device: Callable[[], Device], rate_hz: float, timeout_s: float = 0.5) -> None:
        super().__init__()
        self.key = key
        self.open_device = open_device
        self.rate_hz = rate_hz
        self.timeout_s = timeout_s

    def get(self, parent: NodeApi) -> ActuatorLoop:
        """Returns the loop `<key>_actuator`."""
        return ActuatorLoop(self, parent, f"{self.key}_actuator", self.rate_hz)


class ActuatorLoop(Loop):
    """Writes commands; a command that is not one leaves the actuator at neutral and stops the run.

    On the wall clock a command is written when it comes: it would wait for half a tick on average, and in lock step,
    where a tick comes after all that was made at its moment, most wait for none.
    """

    factory: ActuatorLoopFactory
    _is_tapped = False  # the node hands over each command that is stored

    def begin(self) -> None:
        """Starts ticking, and is told of commands from now on."""
        self._is_tapped = True
        self.parent.tap(self.factory.key, self._on_command)
        super().begin()

    def join(self) -> None:
        """Ends ticking."""
        if self._is_tapped:
            self._is_tapped = False
            self.parent.untap(self.factory.key, self._on_command)
        super().join()

    def _on_command(self, page: Page) -> None:
        self.hurry()

    def setup(self) -> None:
        """Opens the actuator and puts it at neutral."""
        self.actuator: Actuator[Any] = started(self.factory.open_device(), f"the actuator '{self.factory.key}'")
        self.actuator.neutral()
        self._written: Page | None = None
        self._clamped: set[str] = set()

    def loop(self) -> None:
        """Writes the newest command, if it is new; neutral if it is too old."""
        page = self.parent.get_page(self.factory.key)  # asks aloud: a command nobody ever stores is reported
        if page is None:
            return
        if age_s(self.parent, page) > self.factory.timeout_s:
            self.actuator.neutral()  # also if it is new here: it was held up on its way
        elif page is not self._written:
            self._written = page
            self._write(page)

    def _write(self, page: Page) -> None:
        actuator = self.actuator
        try:
            command = command_of(page.data, actuator.command_type, actuator.limits)
            applied = actuator.write(command)
        except CommandError as error:
            actuator.neutral()
            raise self._blamed(page, error) from error
        if applied != command:
            self._say_clamped(command, applied, actuator.limits)

    def _blamed(self, page: Page, error: CommandError) -> CommandError:
        """Returns the error with whoever stored the page, whose line comes first if it is known."""
        what = f"Page '{page.key}' is no command: {error.message}"
        if isinstance(page.data, dict):
            what += f"\n  It holds {in_words(page.data)}."
        when = f"at t = {page.created_at_s:.3f} s"
        if page.origin != self.parent.name:
            return CommandError(f"{what}\n  It was made {when} by node '{page.origin}'.", fix=error.fix)
        others = [component for component in self.parent.components.values() if component is not self]
        lines, who = who_stored(page.key, others)
        return CommandError(f"{lines}{what}\n  It was stored {when} by {who}.", fix=error.fix)

    def _say_clamped(self, command: Any, applied: Any, limits: dict[str, tuple[float, float]]) -> None:
        for field in command.__struct_fields__:
            wanted, got = getattr(command, field), getattr(applied, field)
            if wanted != got and field not in self._clamped:
                self._clamped.add(field)
                others = [component for component in self.parent.components.values() if component is not self]
                lines = who_stored(self.factory.key, others)[0]
                low, high = limits[field]
                self.parent.note(
                    f"Command '{self.factory.key}.{field}' = {_shown(wanted)} is outside {limits[field]} "
                    f"and was clamped to {_shown(got)} (said once; t = {self.get_time_s():.2f} s). "
                    f"Store what is from {low:g} to {high:g}.",
                    lines,
                )

    def halt(self) -> None:
        """Goes to neutral."""
        if "actuator" in self.__dict__:
            self.actuator.neutral()
            self.actuator.deactivate("the robot's program ends")

    def terminate(self) -> None:
        """Closes the actuator."""
        if "actuator" in self.__dict__:
            self.actuator.close()


def _shown(value: Any) -> str:
    """A number, or a list of numbers, as short as can be."""
    return f"[{', '.join(map(_shown, value))}]" if isinstance(value, (list, tuple)) else f"{value:g}"
