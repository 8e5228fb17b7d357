"""A rover with an emulated VESC controller at each motor: all advance together, step by step.

VescMotors --> VescPort --> EmulatedVesc --> input "motor_<wheel>" of the plant
VescSensor <----------------------'      <-- its output of that name
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from snr_sim.devices.emulated.emulated_vesc import EmulatedVesc, ScriptedFault
from snr_sim.prelude.device import Stale
from snr_sim.prelude.errors import DeviceError, PlantError
from snr_sim.prelude.ground_signals import DriveCommand, DriveMode, MotorReading
from snr_sim.prelude.plant import Plant

TICK_S = 0.01  # how often a controller looks whether its timeout is over, as VESC firmware does; commands act at once


class VescPort:
    """Serial port of an emulated controller, in memory. Implements `BytePort`."""

    def __init__(self, controller: EmulatedVesc, now_s: Callable[[], float], name: str) -> None:
        self.name: str = name
        self._controller, self._now_s = controller, now_s
        self._received = b""
        self._is_open = True

    def write(self, data: bytes) -> None:
        """Put bytes on the line; raise a DeviceError if it was closed."""
        self._check()
        self._received += self._controller.feed(data, self._now_s())

    def read(self) -> bytes:
        """Return the received bytes; raise a DeviceError if it was closed."""
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


class VescPlant:
    """A plant and its controllers in lock step. Implements `Plant` except `snapshot`; what is missing is the plant's.

    Args:
        plant: with an input and an output of each motor's name.
        motors: their names.
        erpm_per_rpm: see `VescCodec`.
        faults: what goes wrong, by motor.

    Attributes:
        plant: the plant itself.
    """

    def __init__(
        self,
        plant: Plant,
        motors: Sequence[str],
        erpm_per_rpm: float,
        faults: Mapping[str, Sequence[ScriptedFault]] | None = None,
    ) -> None:
        self.plant: Plant = plant
        self._motors, self._erpm_per_rpm, self._faults = tuple(motors), erpm_per_rpm, faults or {}
        self._power_up()

    def _power_up(self) -> None:
        def controller(name: str) -> EmulatedVesc:
            motor, faults = _PlantMotor(self.plant, name), self._faults.get(name, ())
            return EmulatedVesc(motor, name, self._erpm_per_rpm, faults=faults)

        self._controllers = {name: controller(name) for name in self._motors}
        self._tick_s = 0.0
        self._ports: dict[str, VescPort] = {}
        for name in self._motors:
            self.open_port(name)  # a controller runs, whether its port is used or not

    def open_port(self, motor: str) -> VescPort:
        """Return the port of a motor's controller; one that was opened before receives no more."""
        port = VescPort(self._controllers[motor], lambda: self.plant.time_s, f"the emulated port of {motor}")
        self._ports[motor] = port
        return port

    def __getattr__(self, name: str) -> Any:
        return getattr(self.plant, name)

    @property
    def engine(self) -> str:
        """Names of the plant's simulation, and what is emulated."""
        return f"{self.plant.engine}, emulated VESC"

    def reset(self, seed: int) -> None:
        """Reset the plant, and power up new controllers."""
        self.plant.reset(seed)
        self._power_up()

    def step(self, dt_s: float) -> None:
        """Advance both: first the controllers, then the plant."""
        now_s = self.plant.time_s
        if now_s >= self._tick_s:
            self._tick_s = now_s + TICK_S - 1e-9  # not a step later, by rounding
            for port in self._ports.values():
                port.tick()
        self.plant.step(dt_s)

    def write(self, name: str, command: Any) -> None:
        """Raise a PlantError: the controllers drive the motors."""
        raise PlantError(f"'{name}' is driven by emulated controllers.", fix="command them over their ports.")

    def snapshot(self) -> Any:
        """Raise a PlantError: controllers cannot restore a state."""
        raise PlantError("Emulated controllers cannot be reset to an earlier state.", fix="use --io sim for this.")

    def restore(self, snapshot: Any) -> None:
        """Raise a PlantError, as there is no snapshot."""
        self.snapshot()


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
