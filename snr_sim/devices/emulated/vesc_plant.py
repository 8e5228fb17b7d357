"""A rover with an emulated VESC controller at each motor: all advance together, step by step.

VescMotors --> VescPort --> EmulatedVesc --> input "motor_<wheel>" of the plant
VescSensor <----------------------'      <-- its output of that name

Their ports are those of a bus whose plugs can be pulled, and put into other sockets, at stated times.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from itertools import count
from typing import NamedTuple

from snr_sim.devices.emulated.emulated_vesc import EmulatedVesc, ScriptedFault, make_controller
from snr_sim.devices.emulated.wrapped_plant import WrappedPlant
from snr_sim.devices.wire.serial_port import PortInfo
from snr_sim.devices.wire.vesc_messages import Dialect
from snr_sim.prelude.device import Stale
from snr_sim.prelude.errors import DeviceError
from snr_sim.prelude.ground_signals import DriveCommand, DriveMode, MotorReading
from snr_sim.prelude.plant import Plant

TICK_S = 0.01  # how often a controller looks whether its timeout is over, as VESC firmware does; commands act at once


class VescPort:
    """Serial port of an emulated controller, in memory. Implements `BytePort`.

    Args:
        controller: at the other end.
        now_s: its clock.
        name: in messages.
        is_gone: whether the plug was pulled since; the controller keeps running.
    """

    def __init__(
        self, controller: EmulatedVesc, now_s: Callable[[], float], name: str, is_gone: Callable[[], bool]
    ) -> None:
        self.name: str = name
        self._controller, self._now_s, self._is_gone = controller, now_s, is_gone
        self._received = b""
        self._is_open = True

    def write(self, data: bytes) -> None:
        """Put bytes on the line; raise a DeviceError if it was closed, or unplugged."""
        self._check()
        self._received += self._controller.feed(data, self._now_s())

    def read(self) -> bytes:
        """Return the received bytes; raise the same error."""
        self._check()
        data, self._received = self._received, b""
        return data

    def wait(self, seconds: float) -> bool:
        """Return whether bytes are there: no time passes here, as only the plant's steps advance it."""
        return bool(self._received)

    def close(self) -> None:
        """Close the port; the controller keeps running. Safe to call twice."""
        self._is_open = False

    def tick(self) -> None:
        """Let the controller do what is due by now."""
        self._received += self._controller.tick(self._now_s())

    def _check(self) -> None:
        if not self._is_open:
            raise DeviceError(f"{self.name} was closed.", fix="open it again.")
        if self._is_gone():
            raise DeviceError(f"{self.name} is gone: it was unplugged.", fix="plug it in.")


class Replug(NamedTuple):
    """A controller's plug is pulled and put back, perhaps into the socket of another motor's controller."""

    motor: str
    out_s: float
    in_s: float
    socket: str  # the motor that was plugged in there at the start


class ControllerPlant(WrappedPlant, ABC):
    """A plant and the controllers of its motors, with plugs that are pulled and put back.

    Args:
        plant: with an input and an output of each motor's name.
        motors: their names.
        erpm_per_rpm: see `VescCodec`.
        replugs: which plugs are pulled, and where they are put; a socket must be free by then.
        dialect: of the controllers.
    """

    driver = ("emulated controllers", "command them over their ports.")
    devices = "Emulated controllers"

    def __init__(
        self,
        plant: Plant,
        motors: Sequence[str],
        erpm_per_rpm: float,
        replugs: Sequence[Replug] = (),
        dialect: Dialect = "stock",
    ) -> None:
        super().__init__(plant)
        self._motors, self._erpm_per_rpm = tuple(motors), erpm_per_rpm
        self._replugs, self._dialect = tuple(replugs), dialect
        self.power_up()

    def power_up(self) -> None:
        """Begin with all controllers on, and their plugs in."""
        self._tick_s = 0.0
        events = [(one.out_s, "", one) for one in self._replugs] + [
            (one.in_s, one.socket, one) for one in self._replugs
        ]
        self._events = sorted(events, key=lambda event: event[0])

    @property
    def engine(self) -> str:
        """Names of the plant's simulation, and what is emulated."""
        return f"{self.plant.engine}, emulated VESC"

    def reset(self, seed: int) -> None:
        """Reset the plant, and power up new controllers."""
        self.plant.reset(seed)
        self.power_up()

    def step(self, dt_s: float) -> None:
        """Advance both: first the controllers, then the plant."""
        now_s = self.plant.time_s
        while self._events and now_s >= self._events[0][0] - 1e-9:
            _, socket, replug = self._events.pop(0)
            if socket:
                self.plug_in(replug.motor, socket)
            else:
                self.unplug(replug.motor)
        if now_s >= self._tick_s:
            self._tick_s = now_s + TICK_S - 1e-9  # not a step later, by rounding
            self.tick()
        self.plant.step(dt_s)

    @abstractmethod
    def unplug(self, motor: str) -> None:
        """Pull the plug of a motor's controller."""

    @abstractmethod
    def plug_in(self, motor: str, socket: str) -> None:
        """Put it into the socket that was that of another motor's controller at the start, or its own."""

    @abstractmethod
    def tick(self) -> None:
        """Let the controllers do what is due; called every `TICK_S`."""


class VescPlant(ControllerPlant):
    """The controllers in memory, in lock step with the plant.

    Args:
        faults: what goes wrong, by motor.
    """

    def __init__(
        self,
        plant: Plant,
        motors: Sequence[str],
        erpm_per_rpm: float,
        faults: Mapping[str, Sequence[ScriptedFault]] | None = None,
        replugs: Sequence[Replug] = (),
        dialect: Dialect = "stock",
    ) -> None:
        self._faults = faults or {}
        super().__init__(plant, motors, erpm_per_rpm, replugs, dialect)

    def power_up(self) -> None:
        """Begin with new controllers."""
        super().power_up()

        def controller(name: str) -> EmulatedVesc:
            motor, faults = _PlantMotor(self.plant, name), self._faults.get(name, ())
            return make_controller(motor, name, self._erpm_per_rpm, self._dialect, faults)

        self._controllers = {name: controller(name) for name in self._motors}
        self._plugged: dict[PortInfo, str] = {}  # which motor's controller
        self._plugs: dict[str, object] = {}  # another one each time that a motor's controller is plugged in
        self._ports: dict[str, VescPort] = {}
        for name in self._motors:
            self.plug_in(name, name)

    def list_ports(self) -> list[PortInfo]:
        """Return the ports that are plugged in now."""
        return list(self._plugged)

    def open_port(self, path: str) -> VescPort:
        """Return a port by its device file; one that was opened before receives no more.

        Raises:
            DeviceError: there is none.
        """
        motor = next((motor for info, motor in self._plugged.items() if info.path == path), None)
        if motor is None:
            raise DeviceError(f"There is no serial port {path}.", fix="is it plugged in?")
        return self._connect(motor, path)

    def _connect(self, motor: str, path: str) -> VescPort:
        controller, plug = self._controllers[motor], self._plugs[motor]
        port = VescPort(controller, lambda: self.plant.time_s, path, lambda: self._plugs.get(motor) is not plug)
        self._ports[motor] = port
        return port

    def unplug(self, motor: str) -> None:
        """Pull the plug of a motor's controller."""
        self._plugged = {info: name for info, name in self._plugged.items() if name != motor}
        del self._plugs[motor]

    def plug_in(self, motor: str, socket: str) -> None:
        """Put it into a socket. As under Linux, it gets the first device file that is free."""
        taken = {info.path for info in self._plugged}
        path = next(path for path in (f"/dev/ttyACM{i}" for i in count()) if path not in taken)
        self._plugs[motor] = object()
        self._plugged[PortInfo(path, usb_path=f"1-1.{self._motors.index(socket) + 1}")] = motor
        self._connect(motor, path)  # a controller runs, whether its port is used or not

    def tick(self) -> None:
        """Let the controllers do what is due by now."""
        for port in self._ports.values():
            port.tick()


class _PlantMotor:
    """A motor of the plant. Implements `DrivenMotor`."""

    def __init__(self, plant: Plant, name: str) -> None:
        self._plant, self._name = plant, name

    def drive(self, mode: DriveMode, value: float) -> None:
        """Do this from now on."""
        self._plant.write(self._name, DriveCommand(mode, [value]))

    def read(self) -> MotorReading | Stale:
        """Return its state, or what the plant has instead."""
        reading: MotorReading | Stale = self._plant.read(self._name)
        return reading
