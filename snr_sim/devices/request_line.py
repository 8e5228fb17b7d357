"""Sensors and an actuator behind one slow line, on which one request at a time is on its way.

Such is a robot that a program on another computer drives: it asks for a reading, waits for the answer, asks for the
next. A request takes half its time to the robot, where it is executed, and half of it back. Three sensors in turn and
a command take four requests. A command that has changed goes before the next reading; of several, only the newest. The
page of a reading has the time at which it was measured; page `<command key>_applied` has each command as it was applied
and its `delay_s`.

Source of the behaviour: Fabry and Campusano, "Live Programming the Lego Mindstorms" (IWST 2014), section 3.2.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import msgspec

from snr_sim.devices.commands import ActuatorLoopFactory, CommandLoop, command_of
from snr_sim.devices.device_loop import start_device
from snr_sim.prelude.device import Device, Sensor, Stale
from snr_sim.prelude.errors import CommandError, ParameterError
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.task import Page, Task

if TYPE_CHECKING:
    import numpy as np


REACTION_S = 0.0005  # in which a program may answer a reading before the line is used for the next one


class RequestLineFactory(ActuatorLoopFactory):
    """Readings of sensors as pages, and the newest command page to an actuator, one request after the other.

    Args:
        sensors: what opens each, by the key of its page; asked in this order.
        command_key: of the command page.
        open_actuator: opens the actuator.
        request_s: how long a request takes, there and back.
        timeout_s: age from which a command is ignored.
        jitter_s: the most that chance adds to a request.
        rng: of the jitter.

    Raises:
        ParameterError: a time is not positive, or there are no sensors.
    """

    def __init__(
        self,
        sensors: Mapping[str, Callable[[], Sensor[Any]]],
        command_key: str,
        open_actuator: Callable[[], Device],
        request_s: float,
        timeout_s: float = 0.5,
        jitter_s: float = 0.0,
        rng: np.random.Generator | None = None,
    ) -> None:
        super().__init__(command_key, open_actuator, 0.0, timeout_s)
        if not sensors:
            raise ParameterError("A request line without sensors.", fix="name one or more.")
        if not (request_s > 0.0 and timeout_s > 0.0 and jitter_s >= 0.0):
            raise ParameterError(
                f"A request line with request_s={request_s!r}, timeout_s={timeout_s!r}, jitter_s={jitter_s!r}.",
                fix="give times in seconds, such as request_s=0.03.",
            )
        if jitter_s > 0.0 and rng is None:
            raise ParameterError("A request line with jitter and without chance.", fix="rng=context.rng('line').")
        self.sensors: dict[str, Callable[[], Sensor[Any]]] = dict(sensors)
        self.request_s: float = request_s
        self.jitter_s: float = jitter_s
        self.rng: np.random.Generator | None = rng

    def get(self, parent: NodeApi) -> RequestLine:
        """Return the loop `<command key>_line`."""
        return RequestLine(self, parent, f"{self.key}_line", self.rate_hz)


class RequestLine(CommandLoop):
    """The line. Its ticks are the moments at which a request is at the robot, and at which its answer is back."""

    factory: RequestLineFactory
    _devices: tuple[Any, ...] = ()

    def setup(self) -> None:
        """Open all devices, and go to neutral."""
        factory = self.factory
        self._keys = list(factory.sensors)
        self._actuator: Any = self._started(factory.open_device, f"the actuator '{factory.key}'")
        self._actuator.neutral()
        self._sensors = {key: self._started(opens, f"the sensor '{key}'") for key, opens in factory.sensors.items()}
        self._turn = 0  # of the sensors
        self._request = ""  # key of what is on its way
        self._answer: Page | None = None
        self._is_back = False  # the request has been executed, and its answer is on its way
        self._begun_s = 0.0
        self._applied: Any = self._actuator.command_type()
        self._sent: Any = None
        self._sent_page: Page | None = None

    def _started(self, open_device: Callable[[], Any], what: str) -> Any:
        self._devices += (open_device(),)
        return start_device(self._devices[-1], what)

    def loop(self) -> None:
        """Execute the request at the robot, or take its answer and send the next request."""
        now_s = self.get_time_s()
        if self._request and not self._is_back:
            self._execute()
            self._is_back = True
        elif self._answer is not None:
            self.schedule(Task.store_page(self._answer))
            self._answer = None
            self._begun_s = now_s  # as if the next request began now: it does once the program has seen the answer
            self.next_tick_at_s = now_s + min(REACTION_S, 0.25 * self.factory.request_s)
            return
        else:
            self._send()
            self._is_back = False
            now_s, self._begun_s = self._begun_s or now_s, 0.0
        factory = self.factory
        extra_s = factory.jitter_s * float(factory.rng.random()) if factory.rng is not None else 0.0
        self.next_tick_at_s = now_s + 0.5 * (factory.request_s + extra_s)

    def _send(self) -> None:
        """Decide what is asked next: a command that differs from the one applied, otherwise the next sensor."""
        requested = self._requested_command()
        if requested != self._applied:
            self._request, self._sent = self.factory.key, requested
            return
        self._request = self._keys[self._turn]
        self._turn = (self._turn + 1) % len(self._keys)

    def _requested_command(self) -> Any:
        """Return the newest command; neutral without one, or if it is too old."""
        actuator = self._actuator
        page, age_s = self.commands.newest()
        if page is None or age_s > self.factory.timeout_s:
            self._sent_page = None
            return actuator.command_type()
        try:
            requested = command_of(page.data, actuator.command_type, actuator.limits)
        except CommandError as error:
            actuator.neutral()
            raise self.commands.error_with_source(page, error) from error
        self._sent_page = page
        return requested

    def _execute(self) -> None:
        if self._request == self.factory.key:
            self._write()
            return
        reading = self._sensors[self._request].read()
        if type(reading) is not Stale:
            data = msgspec.to_builtins(reading)
            self._answer = Page(self._request, data, self.parent.name, self.get_time_s(), True)

    def _write(self) -> None:
        actuator, page = self._actuator, self._sent_page
        try:
            applied = actuator.write(self._sent)
        except CommandError as error:
            actuator.neutral()
            assert page is not None
            raise self.commands.error_with_source(page, error) from error
        if applied != self._sent:
            self.commands.note_clamped(self._sent, applied, actuator.limits)
        self._applied = self._sent
        if page is not None:
            data = {**msgspec.to_builtins(applied), "delay_s": self.get_time_s() - page.created_at_s}
            self.store_data(f"{self.factory.key}_applied", data, process=False)

    def halt(self) -> None:
        """Go to neutral."""
        for device in self._devices:
            device.deactivate("the robot's program ends")

    def terminate(self) -> None:
        """Close all devices."""
        for device in self._devices:
            device.close()
