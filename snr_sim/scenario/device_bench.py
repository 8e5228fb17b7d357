"""Test bench of a robot's devices, opened as in a run but without the robot's program: for `snr io` and `snr doctor`.

Outputs are written neutral at every tick, and armed only to move one of their channels.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import msgspec

from snr_sim.core.clocks import WallClock
from snr_sim.devices.commands import ActuatorLoopFactory
from snr_sim.devices.pwm.motor_test import channel_of, motor_test_pulses_us
from snr_sim.devices.pwm.pwm_backend import STOP_US
from snr_sim.devices.readings import SensorLoopFactory
from snr_sim.plants.stepping import Stepper
from snr_sim.prelude.device import Device, Health, PwmOut, Stale
from snr_sim.prelude.errors import ConfigError, DeviceError, SnrError, UnknownNameError
from snr_sim.prelude.interfaces import implements
from snr_sim.prelude.io import parse_io
from snr_sim.prelude.signals import LOST, AppliedPulses
from snr_sim.scenario import library
from snr_sim.scenario.simulation import Request, Simulation, prepare

TICK_S = 0.05
_FIRST_READING_TIMEOUT_S = 2.0  # timeout of the first readings
ARMING_TIMEOUT_S = 15.0  # boards send neutral to speed controllers for some seconds before they follow


@dataclass
class OpenDevice:
    """One device.

    Args:
        key: of its page.
        device: None if it would not open.
        trouble: why it would not open, or why it was lost.
        reading: newest reading of a sensor, or last reply of outputs.
        stale: why there is no reading, if there is none.
    """

    key: str
    device: Any = None
    trouble: str = ""
    reading: Any = None
    stale: str = ""

    @property
    def health(self) -> Health:
        """Health of the device."""
        if self.device is None:
            return Health("error", self.trouble)
        health: Health = self.device.health()
        return Health("error", self.trouble, health.counts) if self.trouble else health

    @property
    def is_ok(self) -> bool:
        """Whether it works: a sensor has readings, or outputs could be armed."""
        return not self.trouble and not self.stale and self.health.state != "error"

    @property
    def channels(self) -> list[str]:
        """Names of the channels of outputs: 'pwm0', ..."""
        return [f"{self.key}{i}" for i in range(self.device.channels)] if implements(self.device, PwmOut) else []


class Bench:
    """The devices of one robot. Use it in a `with`: outputs are neutral and closed at its end, also after an error.

    Args:
        sensors, outputs: functions that open each device, by key.
        now_s: returns the time for the stamps of commands.
        advance: advances simulated devices to now.
    """

    def __init__(
        self,
        sensors: dict[str, Callable[[], Any]],
        outputs: dict[str, Callable[[], Any]],
        now_s: Callable[[], float],
        advance: Callable[[], None] = lambda: None,
    ) -> None:
        self._openers = sensors, outputs
        self._advance = advance
        self.now_s: Callable[[], float] = now_s
        self.sensors: list[OpenDevice] = []
        self.outputs: list[OpenDevice] = []
        self.moved: tuple[OpenDevice, int] | None = None
        self._begun_s: float | None = None
        self._asked_s = 0.0
        self.max_pulse_us: float = STOP_US  # largest pulse measured at the moved channel

    def __enter__(self) -> Bench:
        try:
            for openers, opened in zip(self._openers, (self.sensors, self.outputs), strict=True):
                for key, opener in openers.items():
                    opened.append(OpenDevice(key))
                    _open(opened[-1], opener, is_sensor=opened is self.sensors)
        except BaseException:  # Ctrl-C while a port replies slowly: close the devices that are open
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        for one in [*self.outputs, *self.sensors]:
            if one.device is not None:
                one.device.deactivate("snr io ends")
                one.device.close()

    def tick(self) -> None:
        """Read every sensor and write every output once."""
        self._advance()
        for one in self.sensors:
            _read(one)
        for one in self.outputs:
            if implements(one.device, PwmOut):
                one.reading = one.device.write_us(self._target_pulses(one, one.device), self.now_s())
        self._watch()

    def settle(self, timeout_s: float = _FIRST_READING_TIMEOUT_S) -> None:
        """Tick until every sensor has sent a reading, or until `timeout_s` of wall time."""
        until_s = time.monotonic() + timeout_s
        self.tick()
        while time.monotonic() < until_s and any(one.reading is None and not one.trouble for one in self.sensors):
            time.sleep(TICK_S)
            self.tick()

    def names(self) -> list[str]:
        """Return the names of all channels."""
        return [name for one in self.outputs for name in one.channels]

    def name_of(self, given: str) -> str:
        """Return the name of a channel, given its name, or its number if that is unique among the outputs.

        Raises:
            UnknownNameError: no channel matches, or more than one.
        """
        meant = [f"{one.key}{given}" for one in self.outputs if f"{one.key}{given}" in one.channels]
        if len(meant) > 1:
            raise UnknownNameError(f"Channel {given} may be {' or '.join(meant)}.", fix=f"--move {meant[0]}")
        return meant[0] if meant else self.names()[channel_of(given, self.names())]

    def arm(self, name: str) -> None:
        """Begin to arm the outputs of a channel; it is moved as soon as they follow.

        Raises:
            UnknownNameError: there is no such channel.
            DeviceError: its outputs cannot be armed.
        """
        channel_of(name, self.names())
        for one in self.outputs:
            if name in one.channels:
                one.device.activate()
                self.moved, self._asked_s, self._begun_s = (one, one.channels.index(name)), self.now_s(), None

    @property
    def is_moving(self) -> bool:
        """Whether a channel is being moved, or soon will be."""
        return self.moved is not None

    def stop(self, reason: str) -> None:
        """Go to neutral now."""
        self.moved = None
        for one in self.outputs:
            if one.device is not None:
                one.device.deactivate(reason)

    def _target_pulses(self, one: OpenDevice, out: PwmOut) -> list[float]:
        still = [STOP_US] * out.channels
        if self.moved is None or self.moved[0] is not one:
            return still
        if self._begun_s is None:
            if out.health().state != "active":
                return still
            self._begun_s = self.now_s()
        pulses = motor_test_pulses_us(self.moved[1], out.channels, self.now_s() - self._begun_s, out.limits_us)
        if pulses is None:
            self.stop("moved")
        return pulses or still

    def _watch(self) -> None:
        """Record the measured pulses of the moved channel.

        Raises:
            DeviceError: its outputs do not follow, or disarm by themselves.
        """
        if self.moved is None:
            return
        one, channel = self.moved
        applied: AppliedPulses = one.reading
        self.max_pulse_us = max(self.max_pulse_us, applied.pulses_us[channel])
        health = one.health
        is_late = self._begun_s is None and self.now_s() > self._asked_s + ARMING_TIMEOUT_S
        if health.state not in ("activating", "active") or is_late:
            self.stop("did not follow")
            raise DeviceError(
                f"The outputs '{one.key}' did not follow: {health.state}"
                f"{f', {health.reason}' if health.reason else ''}.",
                fix="snr doctor --io asks the port; is the battery connected, and the emergency stop cleared?",
            )


def devices_of(scenario: str, io: str) -> Simulation:
    """Return a scenario, prepared for its robot's devices. With `--io pi` that is the first role: the robot itself.

    Raises:
        UnknownNameError, ConfigError: as `prepare` does.
    """
    role = None
    if parse_io(io).kind == "pi":
        robot = library.robot_of_scenario(library.find("scenarios", scenario))
        role = library.load_robot(library.find("robots", robot)).ROLES[0]
    return prepare(Request(scenario, io=io, role=role))


def bench_of(simulation: Simulation) -> Bench:
    """Return the bench of a scenario's robot: the devices of the role that drives something.

    Raises:
        ConfigError: its robot has no devices.
    """
    clock = WallClock()
    plant = simulation.plant() if simulation.has_plant else None
    config = simulation.config(plant, clock.now_s if simulation.is_real_time else None)
    stepper = None if plant is None else Stepper(plant)

    def advance() -> None:
        if stepper is not None:
            stepper.advance_to(clock.now_s())

    now_s = clock.now_s if simulation.is_real_time or plant is None else lambda: plant.time_s
    parts = [config.get(role) for role in simulation.robot_file.ROLES if role in config.factories]
    own = next((part for part in parts if _of(part, ActuatorLoopFactory)), parts[0] if parts else [])
    sensors, outputs = _of(own, SensorLoopFactory), _of(own, ActuatorLoopFactory)
    if not (sensors or outputs):
        raise ConfigError(
            f"The robot of {simulation.scenario_name} has no sensors and no outputs.",
            fix="a scenario of a robot that has: snr list.",
        )
    return Bench(sensors, outputs, now_s, advance)


def _of(
    factories: Sequence[object], kind: type[SensorLoopFactory | ActuatorLoopFactory]
) -> dict[str, Callable[[], Any]]:
    return {factory.key: factory.open_device for factory in factories if isinstance(factory, kind)}


def _open(one: OpenDevice, opener: Callable[[], Any], is_sensor: bool) -> None:
    try:
        device = opener()
        if not implements(device, Device):
            raise DeviceError(f"What was opened as '{one.key}' is {device!r}, which does not implement `Device`.")
        one.device = device
        device.configure()
        if is_sensor:
            device.activate()
    except SnrError as error:
        one.trouble = str(error)


def _read(one: OpenDevice) -> None:
    if one.device is None or one.trouble:
        return
    try:
        reading = one.device.read()
    except DeviceError as error:
        one.trouble = str(error)
        return
    if isinstance(reading, Stale):
        one.stale = reading.reason
    else:
        one.reading, one.stale = reading, ""


def fields_of(one: OpenDevice, now_s: float) -> dict[str, Any]:
    """Return the known fields of a device as JSON values."""
    health = one.health
    fields: dict[str, Any] = {"key": one.key, "state": health.state, "reason": health.reason, "counts": health.counts}
    if implements(one.device, PwmOut):
        out: PwmOut = one.device
        applied: AppliedPulses | None = one.reading
        return {
            **fields,
            "channels": out.channels,
            "limits_us": list(out.limits_us),
            "resolution_us": out.resolution_us,
            "has_independent_failsafe": out.has_independent_failsafe,
            "pulses_us": None if applied is None or LOST in applied.reason else applied.pulses_us,
            "reasons": [] if applied is None else applied.reason,
        }
    reading = None if one.reading is None else msgspec.to_builtins(one.reading)
    stamp_s = reading.get("stamp_s") if isinstance(reading, dict) else None
    age_s = now_s - stamp_s if isinstance(stamp_s, (int, float)) and math.isfinite(stamp_s) else None
    return {**fields, "reading": reading, "age_s": age_s, "stale": one.stale}
