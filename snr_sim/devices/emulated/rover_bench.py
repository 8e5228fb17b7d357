"""Emulated motor controllers of a rover behind serial ports of this computer, on the wall clock.

    python -m snr_sim.devices.emulated.rover_bench --links /tmp/rover

serves six controllers, of motors that turn without a load, until Ctrl-C. In a run with `--io pty` it is a process of
the run, and the motors are those of its plant:

    robot's program --> serial ports --> controllers --drives over a pipe--> plant in the run's process
                    <----------------'              <--readings-----------'
"""

from __future__ import annotations

import argparse
import select
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, TypeAlias

import msgspec

from snr_sim.core.process import spawned
from snr_sim.core.standard_streams import print_line
from snr_sim.devices.emulated.emulated_vesc import DrivenMotor, make_controller
from snr_sim.devices.emulated.pty_end import PtyEnd, until_ended
from snr_sim.devices.emulated.vesc_plant import TICK_S
from snr_sim.devices.wire.process_port import MessageCodec
from snr_sim.devices.wire.vesc_messages import Dialect
from snr_sim.prelude.device import Stale
from snr_sim.prelude.ground_signals import NEUTRAL_BRAKE_A, DriveMode, MotorReading

TARGET = "snr_sim.devices.emulated.rover_bench:run"
_MAX_MOTORS = 100  # each has two descriptors, of the 1024 that select takes
_SUPPLY_V, _TOP_RADPS, _RADPS2_PER_A, _SPEED_GAIN_A = 24.0, 20.0, 5.0, 6.0  # of motors without a load [O]


class OpenBench(msgspec.Struct, frozen=True, tag=True):
    """To the bench: open the ports; `Drives` is the answer."""

    folder: str  # for links to the ports
    motors: list[str]
    erpm_per_rpm: float
    dialect: Dialect


class Readings(msgspec.Struct, frozen=True, tag=True):
    """To the bench: the state of each motor; None for one without."""

    readings: list[MotorReading | None]


class Plug(msgspec.Struct, frozen=True, tag=True):
    """To the bench: put a motor's plug into a socket, that of another motor at the start; pull it without a socket."""

    motor: str
    socket: str = ""


class Drives(msgspec.Struct, frozen=True, tag=True):
    """From the bench: what each motor does from now on."""

    drives: list[tuple[DriveMode, float]]


BenchMessage: TypeAlias = OpenBench | Readings | Plug | Drives
CODEC: MessageCodec[BenchMessage] = MessageCodec(BenchMessage, "bench of controllers")


class RoverBench:
    """Controllers behind pseudo terminals.

    Args:
        folder: for a link to each terminal, by the socket.
        motors: what the controllers drive, by name.
        erpm_per_rpm: see `VescCodec`.
        dialect: of the controllers.
    """

    def __init__(
        self, folder: Path, motors: Mapping[str, DrivenMotor], erpm_per_rpm: float, dialect: Dialect = "seed"
    ) -> None:
        self._folder = folder
        self._controllers = {
            name: make_controller(motor, name, erpm_per_rpm, dialect) for name, motor in motors.items()
        }
        self._ends: dict[str, PtyEnd] = {}
        for name in motors:
            self.plug_in(name, name)

    def plug_in(self, motor: str, socket: str) -> None:
        """Put a controller's plug into the socket of another one at the start, or its own."""
        index = list(self._controllers).index(socket)
        self._ends[motor] = PtyEnd(_link(self._folder, index))

    def unplug(self, motor: str) -> None:
        """Pull a controller's plug."""
        self._ends.pop(motor).close()

    def step(self, others: Sequence[Any] = ()) -> None:
        """Serve the ports for `TICK_S` at most; return sooner if bytes are there, or one of `others` can be read."""
        ready = select.select([*self._ends.values(), *others], [], [], TICK_S)[0]
        for name, controller in self._controllers.items():
            end, now_s = self._ends.get(name), time.monotonic()
            if end is None:
                controller.tick(now_s)
            else:
                end.write(controller.feed(end.read() if end in ready else b"", now_s))

    def close(self) -> None:
        """Remove all ports."""
        for motor in list(self._ends):
            self.unplug(motor)


def _link(folder: Path, index: int) -> Path:
    return folder / f"1-1.{index + 1}"


class FreeMotor:
    """A motor on a bench: a flywheel without a load. Implements `DrivenMotor`."""

    def __init__(self) -> None:
        self._mode: DriveMode = "brake"
        self._value = NEUTRAL_BRAKE_A
        self._rate_radps = self._turned_rad = self._current_a = 0.0
        self._at_s = time.monotonic()

    def drive(self, mode: DriveMode, value: float) -> None:
        """Do this from now on."""
        self._advance()
        self._mode, self._value = mode, value

    def read(self) -> MotorReading:
        """Return its state."""
        self._advance()
        duty = self._rate_radps / _TOP_RADPS
        return MotorReading(
            self._rate_radps, self._current_a, 0.0, duty, _SUPPLY_V, self._turned_rad, stamp_s=self._at_s
        )

    def _advance(self) -> None:
        now_s = time.monotonic()
        step_s, self._at_s, rate_radps = now_s - self._at_s, now_s, self._rate_radps
        if self._mode == "current":
            self._current_a = self._value
        elif self._mode == "off":
            self._current_a = 0.0
        else:
            aim_radps = {"speed": self._value, "duty": self._value * _TOP_RADPS}.get(self._mode, 0.0)
            limit_a = abs(self._value) if self._mode == "brake" else _TOP_RADPS
            self._current_a = min(limit_a, max(-limit_a, _SPEED_GAIN_A * (aim_radps - rate_radps)))
        rate_radps += self._current_a * _RADPS2_PER_A * min(step_s, 0.05)
        self._rate_radps = min(_TOP_RADPS, max(-_TOP_RADPS, rate_radps))
        self._turned_rad += self._rate_radps * step_s


class _PipedMotor:
    """A motor at the other end of the pipe. Implements `DrivenMotor`."""

    def __init__(self) -> None:
        self.reading: MotorReading | None = None
        self.does: tuple[DriveMode, float] = ("brake", NEUTRAL_BRAKE_A)

    def drive(self, mode: DriveMode, value: float) -> None:
        self.does = mode, value

    def read(self) -> MotorReading | Stale:
        return self.reading or Stale("The motor has no state.")


def run(line: Connection) -> int:
    """Serve the ports of a run until its line closes."""
    spawned.unblock_signals()
    order = CODEC.receive(line)
    assert isinstance(order, OpenBench)
    folder, motors = Path(order.folder), {name: _PipedMotor() for name in order.motors}
    bench, sent = RoverBench(folder, motors, order.erpm_per_rpm, order.dialect), None
    with suppress(EOFError, OSError):
        while True:
            drives = [motor.does for motor in motors.values()]
            if drives != sent:
                line.send_bytes(CODEC.encode(Drives(drives)))
                sent = drives
            bench.step([line])
            while line.poll():
                _follow(bench, motors, CODEC.receive(line))
    bench.close()
    folder.rmdir()
    return 0


def _follow(bench: RoverBench, motors: Mapping[str, _PipedMotor], message: BenchMessage) -> None:
    if isinstance(message, Readings):
        for motor, reading in zip(motors.values(), message.readings, strict=True):
            motor.reading = reading
    elif isinstance(message, Plug) and message.socket:
        bench.plug_in(message.motor, message.socket)
    elif isinstance(message, Plug):
        bench.unplug(message.motor)


def main() -> None:
    """Serve a rover's ports, until a signal arrives or the parent process ends."""
    parser = argparse.ArgumentParser(description="Emulated motor controllers behind serial ports.")
    parser.add_argument("--links", type=Path, required=True, help="folder for a link to each port")
    parser.add_argument("--motors", default="LF LM LB RF RM RB", help="names of their wheels")
    parser.add_argument("--erpm-per-rpm", type=float, default=228.0, help="turns of the field in one of the wheel")
    options = parser.parse_args()
    names = [f"motor_{name}" for name in options.motors.split()]
    if not 0 < len(set(names)) == len(names) <= _MAX_MOTORS:
        parser.error(f"--motors has {len(names)} names: 1 to {_MAX_MOTORS} different ones, such as --motors 'LF RF'.")
    if not 0.0 < options.erpm_per_rpm < float("inf"):
        parser.error(f"--erpm-per-rpm is {options.erpm_per_rpm:g}: a number above 0, such as 228.")
    try:
        options.links.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        parser.error(f"--links {options.links} cannot be a folder: {error.strerror}.")
    links = [_link(options.links, index) for index in range(len(names))]
    if any(link.exists() for link in links):
        parser.error(f"--links {options.links} has ports already, of another bench: take another folder, or empty it.")
    bench, is_running = (
        RoverBench(options.links, {name: FreeMotor() for name in names}, options.erpm_per_rpm),
        until_ended(),
    )
    for link, name in zip(links, names, strict=True):
        print_line(sys.stdout, f"{name} at {link}")
    try:
        while is_running():
            bench.step()
    finally:
        bench.close()


if __name__ == "__main__":
    main()
