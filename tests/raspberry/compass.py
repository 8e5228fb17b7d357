"""A student's robot that turns towards magnetic north: one file, in simulation and on a Raspberry Pi with real wires.

    python compass.py sim                   in lock step: a compass that a list plays, outputs that nothing hangs at
    python compass.py mcu:/dev/ttyUSB0      on the wall clock: a compass on I2C, thrusters behind a microcontroller

The node and its numbers, in the middle, depend on neither; the table at the end names both.
"""

from __future__ import annotations

import sys
from pathlib import Path

import msgspec

from snr_sim import Config, Endpoint, EndpointFactory, LifeCycle, Mode, SimClock, TaskType, WallClock
from snr_sim.devices.mcu.mcu import McuPwm
from snr_sim.devices.mcu.mcu_board import McuBoard
from snr_sim.devices.pwm.pwm_backend import LoopbackPwm
from snr_sim.devices.pwm.pwm_loop import PwmLoopFactory
from snr_sim.devices.readings import SensorLoopFactory
from snr_sim.devices.wire.i2c_bus import I2cBus
from snr_sim.devices.wire.mcu_messages import BAUD
from snr_sim.devices.wire.serial_port import SerialPort
from snr_sim.prelude.io import parse_io
from snr_sim.scenario.program import record_program
from snr_sim.testing.fakes import FakeSensor

CHANNELS = 8
STILL_S = 4.0  # neutral, until the outputs have armed
PUSH_US_PER_UT = 20.0
MAX_US = 350.0


class Compass(msgspec.Struct, frozen=True):
    """The earth's field across the vehicle, and along it [uT]."""

    x_ut: float
    z_ut: float
    y_ut: float
    stamp_s: float


class TurnFactory(EndpointFactory):
    def get(self, parent):
        return Turn(self, parent, "turn")


class Turn(Endpoint):
    """Turns until nothing of the field is across."""

    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.state = ""
        self.task_handlers = {(TaskType.process_data, "compass"): self.on_compass}

    def on_compass(self, task, task_id):
        self.print_state()
        across_ut = self.get_data("compass")["x_ut"]
        push_us = 0.0 if self.get_time_s() < STILL_S else PUSH_US_PER_UT * across_ut
        push_us = min(max(push_us, -MAX_US), MAX_US)
        half = CHANNELS // 2
        return self.store_data_task("pwm", {"pulses_us": [1500.0 + push_us] * half + [1500.0 - push_us] * half})

    def print_state(self):
        applied = self.get_data("pwm_applied")
        if applied is not None and applied["state"] != self.state:
            self.state = applied["state"]
            print(f"outputs: {self.state} {applied['fault']}".strip(), file=sys.stderr, flush=True)


class Lsm303(LifeCycle):
    """The magnetometer of an LSM303DLHC on I2C. Implements `Sensor`.

    Source: ST, LSM303DLHC data sheet, section 7.2: registers MR 0x02, OUT_X_H 0x03 (x, z, y; high byte first), and
    1100 counts a gauss along x and y, 980 along z, as it starts.
    """

    title = "The compass"
    address = 0x1E

    def __init__(self, bus, now_s):
        self.bus, self.now_s = bus, now_s

    def on_configure(self):
        self.bus.write(self.address, 0x02, bytes([0x00]))  # measures again and again

    def read(self):
        data = self.bus.read(self.address, 0x03, 6)
        x, z, y = (int.from_bytes(data[i : i + 2], signed=True) for i in (0, 2, 4))
        return Compass(x / 11.0, z / 9.8, y / 11.0, self.now_s())


def played():
    """What the compass shows in simulation: north is ahead, and after six seconds it is not."""
    return [Compass(0.0 if i < 300 else 10.0, 0.0, 0.0, i / 50.0) for i in range(500)]


def devices(io, clock):
    """Returns how the compass and the outputs are opened."""
    if io.kind == "sim":
        return lambda: FakeSensor(played()), lambda: LoopbackPwm(clock.now_s, CHANNELS)
    board = McuBoard(lambda: SerialPort(io.address, BAUD), clock.now_s)
    return lambda: Lsm303(I2cBus(1), clock.now_s), lambda: McuPwm(board, clock.now_s, CHANNELS)


def main():
    io = parse_io(sys.argv[1])
    clock = SimClock() if io.kind == "sim" else WallClock()
    compass, outputs = devices(io, clock)
    parts = [SensorLoopFactory("compass", compass, 50.0), TurnFactory(), PwmLoopFactory("pwm", outputs, 50.0)]
    config = Config(Mode.TEST, {"robot": parts})
    until_s = 10.0 if io.kind == "sim" else None
    print(record_program("robot", config, __file__, Path("runs"), clock=clock, until_s=until_s))


if __name__ == "__main__":
    main()
