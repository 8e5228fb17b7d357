"""Motors behind their guard: the contract in simulated time, and what a killed program leaves behind on ports."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from snr_sim.devices.emulated.rover_bench import RoverBench
from snr_sim.devices.emulated.vesc_plant import TICK_S
from snr_sim.devices.motors.guarded_motors import GuardedMotors, GuardedSensor, GuardLine
from snr_sim.devices.motors.motor_guard import ControllerSettings, MotorGuard, open_ports
from snr_sim.prelude.device import Stale
from snr_sim.prelude.ground_signals import NEUTRAL_BRAKE_A, DriveCommand, MotorReading
from snr_sim.testing.motor_contract import check_motors
from tests.devices.emulated.test_emulated_vesc import BenchMotor
from tests.devices.test_motor_backend import LIMITS, NAMES, PortsBench
from tests.devices.test_supervised_pwm import Line

SETTINGS = ControllerSettings(NAMES, 228.0, LIMITS, NEUTRAL_BRAKE_A, "seed")
PAIR = ["motor_LF", "motor_RF"]
GENEROUS_S = 30.0
SAFE_S = 0.3  # ROVER 4.3: from the end of the program until no wheel is driven


class GuardBench(PortsBench):
    """Motors behind a guard without a process, whose clock is the bench's."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        super().__init__()
        opener = ModuleType("ports_of_this_test")
        opener.open = lambda settings: open_ports(SETTINGS, self.ports, self.now_s)  # type: ignore[attr-defined]
        monkeypatch.setitem(sys.modules, opener.__name__, opener)
        self.line: Line | None = None
        self.advance(TICK_S)

    def guard_line(self) -> GuardLine:
        return GuardLine(self.now_s, SETTINGS, "ports_of_this_test:open", [], self.start_guard, self.now_s)  # type: ignore[arg-type]

    def start_guard(self) -> Line:
        self.line = Line(MotorGuard(self.now_s), self.advance)
        return self.line

    def open(self) -> GuardedMotors:
        return GuardedMotors(self.guard_line())

    def advance(self, seconds: float) -> None:
        for _ in range(round(seconds / TICK_S)):
            self.plant.step(TICK_S)
            if self.line is not None and not (self.line.is_dead or self.line.is_silent):
                self.line.supervisor.poll()


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> GuardBench:
    return GuardBench(monkeypatch)


def test_guarded_motors_pass_contract(bench: GuardBench) -> None:
    check_motors(bench)


def test_guarded_sensors_read_their_motors_and_say_what_is_lost(bench: GuardBench) -> None:
    guard = bench.guard_line()
    motors, sensors = GuardedMotors(guard), [GuardedSensor(guard, name) for name in NAMES]
    assert sensors[0].read() == Stale("The controller of motor_LF is unconfigured.")
    for device in (*sensors, motors):
        device.configure()
        device.activate()
    bench.advance(0.2)
    readings = [sensor.read() for sensor in sensors]
    assert [getattr(one, "speed_radps", one) for one in readings] == pytest.approx(range(6), abs=5e-4)
    assert all(bench.now_s() - one.stamp_s <= 0.15 for one in readings if isinstance(one, MotorReading))
    bench.unplug(1)
    for _ in range(60):
        bench.advance(0.02)
        motors.write(DriveCommand("speed", [1.0] * 6))
    lost = sensors[1].read()
    assert isinstance(lost, Stale)
    assert lost.reason == "The controller of motor_LM was unplugged from usb-1-1.2."
    assert motors.health().reason == "/dev/ttyACM1 is gone: it was unplugged."
    assert isinstance(sensors[0].read(), MotorReading)
    for device in (*sensors, motors):
        device.close()


@pytest.mark.parametrize(
    ("how", "reason"),
    [
        ("is_dead", "The process 7 was killed by SIGKILL."),
        ("is_silent", "The guard of the motors has not answered for 1 s."),
    ],
)
def test_lost_guard_is_reported_and_motors_brake_until_another_is_armed(
    bench: GuardBench, how: str, reason: str
) -> None:
    motors, command = bench.open(), DriveCommand("speed", [1.0] * 6)
    motors.configure()
    motors.activate()
    motors.write(command)
    assert bench.line is not None
    setattr(bench.line, how, True)
    bench.advance(SAFE_S + 2 * TICK_S)
    assert {mode for mode, _ in bench.does()} == {"brake"}
    for _ in range(60):
        motors.write(command)
        bench.advance(TICK_S * 2)
    assert motors.write(command).values == []
    assert motors.health().reason == reason
    motors.configure()
    assert motors.write(command).values == []
    motors.activate()
    assert motors.write(command) == command
    assert {mode for mode, _ in bench.does()} == {"speed"}


PUSH = """
import sys, time
from snr_sim.devices.motors.guarded_motors import GuardedMotors, GuardLine
from snr_sim.devices.motors.motor_guard import ControllerSettings
from snr_sim.prelude.ground_signals import DriveCommand

limits = {"speed": 18.0, "current": 6.0, "brake": 6.0, "duty": 1.0}
settings = ControllerSettings(["motor_LF", "motor_RF"], 228.0, limits, 4.0, "seed")
guard = GuardLine(time.monotonic, settings, "snr_sim.devices.motors.motor_guard:open_links", [sys.argv[1]])
motors = GuardedMotors(guard)
motors.configure()
motors.activate()
print("armed", flush=True)
while True:
    motors.write(DriveCommand("speed", [3.0, 3.0]))
    time.sleep(0.02)
"""


def serve_until(bench: RoverBench, is_so: Any) -> float:
    began_s = time.monotonic()
    while not is_so():
        assert time.monotonic() < began_s + GENEROUS_S
        bench.step()
    return time.monotonic() - began_s


@pytest.mark.slow
def test_killed_or_stopped_program_leaves_wheels_at_neutral_within_300_ms(tmp_path: Path) -> None:
    """Each is tried up to four times: a busy computer may keep any process waiting for longer than that."""
    motors = {name: BenchMotor() for name in PAIR}
    bench = RoverBench(tmp_path, motors, 228.0)

    def does(mode: str) -> bool:
        return all(motor.commands and motor.commands[-1][0] == mode for motor in motors.values())

    def is_free() -> bool:
        return all(motor.commands[-1][0] == "brake" or motor.commands[-1][1] == 0.0 for motor in motors.values())

    for how in (signal.SIGKILL, signal.SIGSTOP):
        took_s: list[float] = []
        while not took_s or took_s[-1] > SAFE_S:
            assert len(took_s) < 4, took_s
            with subprocess.Popen([sys.executable, "-c", PUSH, str(tmp_path)], stdout=subprocess.PIPE) as node:
                assert node.stdout is not None
                try:
                    serve_until(bench, lambda: does("speed"))
                    os.kill(node.pid, how)
                    took_s.append(serve_until(bench, is_free))
                    serve_until(bench, lambda: does("brake"))
                    assert [motor.commands[-1] for motor in motors.values()] == [("brake", NEUTRAL_BRAKE_A)] * 2
                finally:
                    node.kill()
        print(how.name, took_s)
    bench.close()
