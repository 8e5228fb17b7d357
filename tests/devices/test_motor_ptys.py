"""Controllers by name over real serial ports of the kernel: a pty for each, on the wall clock."""

import os
import pty
import select
import threading
import time
import tty
from collections.abc import Callable, Iterator

import pytest

from snr_sim.devices.emulated.emulated_vesc import EmulatedVesc
from snr_sim.devices.motors.motor_ports import MotorPorts
from snr_sim.devices.motors.port_watch import PortWatch
from snr_sim.devices.motors.vesc_line import VescLine
from snr_sim.devices.motors.vesc_motors import VescMotors
from snr_sim.devices.wire.serial_port import PortInfo, SerialPort
from snr_sim.prelude.errors import DeviceError
from snr_sim.prelude.ground_signals import NEUTRAL_BRAKE_A, DriveCommand
from tests.devices.emulated.test_emulated_vesc import BenchMotor

pytestmark = pytest.mark.slow

NAMES = ("motor_LF", "motor_RF")
LIMITS = {"speed": 18.0, "current": 6.0, "brake": 6.0, "duty": 1.0}
TIMEOUT_S = 30.0  # only a failed test takes as long


class Controllers:
    """Emulated controllers at the far ends of ptys, served by a thread; `None` is a mute device."""

    def __init__(self, *names: str | None) -> None:
        self.motors = {name: BenchMotor() for name in NAMES}
        self.far: dict[int, EmulatedVesc | None] = {}
        self.listed: dict[str | None, PortInfo] = {}
        self.near: dict[str | None, int] = {}
        self._lock, self._ends = threading.Lock(), False
        for name in names:
            self.plug_in(name)
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def plug_in(self, name: str | None) -> None:
        far, near = pty.openpty()
        tty.setraw(near)
        path = os.ttyname(near)
        with self._lock:
            self.far[far] = None if name is None else EmulatedVesc(self.motors[name], name, 228.0, "seed", "2.18")
            self.listed[name], self.near[name] = PortInfo(path, usb_path=f"1-1.{far}"), near

    def unplug(self, name: str) -> None:
        with self._lock:
            del self.listed[name]
            os.close(self.near.pop(name))
            fd = next(fd for fd, one in self.far.items() if one is not None and one._name == name)
            del self.far[fd]
            os.close(fd)

    def _serve(self) -> None:
        while not self._ends:
            with self._lock:
                ready, _, _ = select.select(list(self.far), [], [], 0.0)
                for fd, controller in self.far.items():
                    data = os.read(fd, 4096) if fd in ready else b""
                    if controller is not None and (sent := controller.feed(data, time.monotonic())):
                        os.write(fd, sent)
            time.sleep(0.001)

    def close(self) -> None:
        self._ends = True
        self._thread.join()
        for fd in [*self.far, *self.near.values()]:
            os.close(fd)


@pytest.fixture
def controllers() -> Iterator[Controllers]:
    made = Controllers(None, *NAMES)
    yield made
    made.close()


def until(is_so: Callable[[], bool]) -> None:
    end_s = time.monotonic() + TIMEOUT_S
    while not is_so():
        assert time.monotonic() < end_s
        time.sleep(0.02)


def test_controllers_on_ptys_are_found_by_name_unplugged_and_found_again(controllers: Controllers) -> None:
    ports = MotorPorts(PortWatch(lambda: list(controllers.listed.values())), SerialPort, time.monotonic)
    lines = [VescLine(name, lambda name=name: ports.open_port(name), time.monotonic, 228.0, "seed") for name in NAMES]  # type: ignore[misc]
    motors = VescMotors(lines, LIMITS, NEUTRAL_BRAKE_A, poll=ports.poll)
    motors.configure()
    motors.activate()
    command = DriveCommand("current", [1.0, 2.0])

    def does(*expected: float) -> bool:
        motors.write(command)
        return [controllers.motors[name].commands[-1] for name in NAMES] == [("current", one) for one in expected]

    until(lambda: does(1.0, 2.0))
    controllers.unplug("motor_LF")

    def is_lost() -> bool:
        motors.write(command)
        return motors.health().state == "error"

    until(is_lost)
    until(lambda: controllers.motors["motor_RF"].commands[-1] == ("brake", NEUTRAL_BRAKE_A))
    controllers.plug_in("motor_LF")

    def is_found() -> bool:
        try:
            motors.configure()
        except DeviceError:
            return False
        return True

    until(is_found)
    assert motors.health().state == "inactive"
    motors.activate()
    until(lambda: does(1.0, 2.0))
    motors.close()
