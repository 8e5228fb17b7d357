"""A plant whose motors have emulated controllers at serial ports of this computer; see `rover_bench.py`."""

from __future__ import annotations

import shutil
import tempfile
import weakref
from pathlib import Path

from snr_sim.devices.emulated.rover_bench import (
    CODEC,
    TARGET,
    BenchMessage,
    Drives,
    OpenBench,
    Plug,
    Readings,
)
from snr_sim.devices.emulated.vesc_plant import ControllerPlant
from snr_sim.devices.wire.process_port import ProcessPort
from snr_sim.prelude.errors import DeviceError
from snr_sim.prelude.ground_signals import DriveCommand, MotorReading

START_S = 30.0  # until a new Python on a small computer has opened them


class PtyPlant(ControllerPlant):
    """The controllers in a process of their own, on the wall clock; the plant must keep up with it.

    Attributes:
        folder: of the links to their ports.
    """

    def power_up(self) -> None:
        """Begin with new controllers, in a new process, which ends with this plant."""
        super().power_up()
        self.folder: Path = Path(tempfile.mkdtemp(prefix="snr_sim_ports_"))
        self._bench: ProcessPort[BenchMessage] = ProcessPort(TARGET, CODEC)
        self._end = weakref.finalize(self, _end_bench, self._bench, self.folder)
        self._bench.write(OpenBench(str(self.folder), list(self._motors), self._erpm_per_rpm, self._dialect))
        if not self._bench.wait(START_S):
            raise DeviceError("The emulated controllers have not started.", fix="is the computer overloaded?")
        self.tick()  # controllers without readings do not answer

    def reset(self, seed: int) -> None:
        """Reset the plant, and power up new controllers."""
        self._end()
        super().reset(seed)

    def unplug(self, motor: str) -> None:
        """Pull the plug of a motor's controller."""
        self._bench.write(Plug(motor))

    def plug_in(self, motor: str, socket: str) -> None:
        """Put it into a socket."""
        self._bench.write(Plug(motor, socket))

    def tick(self) -> None:
        """Do what the controllers command, and send them the state of the motors."""
        for message in self._bench.read():
            assert isinstance(message, Drives)
            for name, (mode, value) in zip(self._motors, message.drives, strict=True):
                self.plant.write(name, DriveCommand(mode, [value]))
        if self._bench.has_room:  # else it has not read the last ones yet
            readings = (self.plant.read(name) for name in self._motors)
            self._bench.write(Readings([one if isinstance(one, MotorReading) else None for one in readings]))


def _end_bench(bench: ProcessPort[BenchMessage], folder: Path) -> None:
    """End the process, and remove the folder, which it leaves if it was killed."""
    bench.close()
    shutil.rmtree(folder, ignore_errors=True)
