"""Motors behind their guard, as the robot's program sees them: they are safe when this program dies."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import msgspec

from snr_sim.devices.motors import motor_guard
from snr_sim.devices.motors.motor_backend import MotorBackend
from snr_sim.devices.motors.motor_guard import READ_PERIOD_S, TARGET, ControllerSettings
from snr_sim.devices.motors.vesc_motors import FRESH_S
from snr_sim.devices.supervisor_client import SupervisorClient
from snr_sim.devices.wire import lease_messages as wire
from snr_sim.prelude.device import LEASE_S, Stale
from snr_sim.prelude.errors import DeviceError
from snr_sim.prelude.ground_signals import DriveCommand, MotorReading
from snr_sim.prelude.life_cycle import LifeCycleSensor
from snr_sim.prelude.plant import Plant


class GuardLine:
    """The guard of all motors, which those who drive and read them share. It ends with the last of them.

    Args:
        now_s: the clock of commands and readings.
        settings: of the controllers.
        opener: "module:function", called in the guard with `args` and the settings; returns `GuardedPorts`.
        args: JSON.
        open_line: starts a guard.
        monotonic_s: the clock that all processes of this computer share.
    """

    def __init__(
        self,
        now_s: Callable[[], float],
        settings: ControllerSettings,
        opener: str,
        args: list[Any],
        open_line: Callable[[], wire.SupervisorPort] = lambda: wire.SupervisorPort(TARGET),
        monotonic_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self.now_s: Callable[[], float] = now_s
        self.settings: ControllerSettings = settings
        self.client: SupervisorClient = SupervisorClient("The guard of the motors", open_line, monotonic_s)
        self._opener, self._args = opener, [*args, msgspec.to_builtins(settings)]
        self._users: set[int] = set()

    @classmethod
    def of_links(cls, now_s: Callable[[], float], settings: ControllerSettings, links: str) -> GuardLine:
        """Return the guard of controllers behind `links`: see `PortsFile`."""
        return cls(now_s, settings, f"{motor_guard.__name__}:open_links", [links])

    def open(self, user: object) -> None:
        """Start the guard if there is none, and open all controllers; raise a DeviceError if one is lost."""
        self._users.add(id(user))
        try:
            self.client.check()
        except DeviceError:  # it was not open, has ended, or hangs
            self.client.end()
        self.client.open(self._opener, self._args)

    def release(self, user: object) -> None:
        """Release it for one device."""
        self._users.discard(id(user))
        if not self._users:
            self.client.end()


class GuardedMotors(MotorBackend):
    """The motors.

    Args:
        guard: of their controllers.
        plant: if given, gets all commands too: the vehicle around real motors on a bench.
    """

    title = "The guarded motors"

    def __init__(self, guard: GuardLine, plant: Plant | None = None) -> None:
        self._plant = plant
        super().__init__(guard.now_s, len(guard.settings.names), guard.settings.limits)
        self._guard = guard

    def put(self, command: DriveCommand, until_s: float) -> bool:
        """Send the guard a command; return False if that has failed, or a controller is lost."""
        if self._plant is not None:
            self._plant.write("drive", msgspec.structs.replace(command, until_s=until_s))
        try:
            self._guard.client.lease([command.mode, command.values], 0.0, until_s - self._now_s())
        except DeviceError as error:
            if self.state == "active":
                self.fail(error.message)
            return False
        return True

    def brake(self) -> None:
        """Send the guard the command for neutral; without a guard, the motors are at neutral by themselves."""
        self.put(DriveCommand(), self._now_s() + LEASE_S)

    def counts(self) -> dict[str, int]:
        """Return the counters of the controllers."""
        return self._guard.client.status.counts

    def on_configure(self) -> None:
        """Open the controllers."""
        self._guard.open(self)

    def on_activate(self) -> None:
        """Order the guard to arm."""
        self._guard.client.order(wire.ArmOutputs())

    def on_deactivate(self, reason: str) -> None:
        """Order the guard to disarm."""
        if self._guard.client.line is not None:
            self._guard.client.order(wire.DisarmOutputs(reason))

    def on_close(self) -> None:
        """Release the guard."""
        self._guard.release(self)


class GuardedSensor(LifeCycleSensor):
    """State of one motor, by its guard. Implements `Sensor`; reads `MotorReading`.

    Args:
        guard: of all motors.
        name: of the motor.
    """

    def __init__(self, guard: GuardLine, name: str) -> None:
        self.title: str = f"The controller of {name}"
        self._guard, self._index = guard, guard.settings.names.index(name)

    def read(self) -> MotorReading | Stale:
        """Return the newest reading; raise a SensorLostError if it was closed."""
        idle = self.idle()
        if idle is not None:
            return idle
        client = self._guard.client
        try:
            status = client.ask(READ_PERIOD_S)
        except DeviceError as error:
            return Stale(error.message)
        readings, shift_s = status.readings, self._guard.now_s() - client.monotonic_s()
        if not readings:
            return Stale(status.reason or f"{self.title} has not been read yet.")
        found = readings[self._index]
        since_s = None if found.since_s is None else found.since_s + shift_s
        if found.reading is None:
            return Stale(found.reason, since_s)
        stamp_s = found.reading.stamp_s + shift_s
        if self._guard.now_s() - stamp_s > 2.0 * FRESH_S:
            return Stale(f"{client.title} sends nothing new.", stamp_s)
        return msgspec.structs.replace(found.reading, stamp_s=stamp_s)

    def on_configure(self) -> None:
        """Open the guard; a controller that is lost makes its own readings stale."""
        with suppress(DeviceError):
            self._guard.open(self)

    def on_close(self) -> None:
        """Release the guard."""
        self._guard.release(self)
