"""Emulated controllers at serial ports of the kernel: by hand, and in a run with `--io pty`."""

import os
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import pytest

from snr_sim.devices.emulated.pty_plant import PtyPlant
from snr_sim.devices.emulated.rover_bench import FreeMotor, main
from snr_sim.devices.motors.motor_ports import MotorPorts
from snr_sim.devices.motors.port_watch import PortWatch
from snr_sim.devices.motors.vesc_line import VescLine
from snr_sim.devices.motors.vesc_motors import VescMotors, VescSensor
from snr_sim.devices.wire.serial_port import SerialPort, list_links
from snr_sim.prelude.ground_signals import NEUTRAL_BRAKE_A, DriveCommand, MotorReading
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import SimulationRun

LIMITS = {"speed": 18.0, "current": 6.0, "brake": 6.0, "duty": 1.0}


def test_free_motor_follows_each_mode(monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = 0.0
    monkeypatch.setattr(time, "monotonic", lambda: now_s)
    motor, ends = FreeMotor(), []
    for mode, value in (("speed", 5.0), ("current", -1.0), ("off", 0.0), ("brake", 4.0), ("duty", -0.5)):
        motor.drive(mode, value)  # type: ignore[arg-type]
        for _ in range(100):
            now_s += 0.01
            reading = motor.read()
        ends.append(reading.speed_radps)
    assert ends == pytest.approx([5.0, 0.0, 0.0, 0.0, -10.0], abs=0.1)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--links", "file"], "--links file cannot be a folder"),
        (["--links", "used"], "has ports already, of another bench"),
        (["--links", "new", "--motors", "A A"], "--motors has 2 names"),
        (["--links", "new", "--erpm-per-rpm", "nan"], "--erpm-per-rpm is nan"),
    ],
)
def test_bench_that_cannot_serve_says_why_and_opens_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], words: list[str], message: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "used").mkdir()
    for path in ("file", "used/1-1.2"):
        (tmp_path / path).touch()
    monkeypatch.setattr(sys, "argv", ["rover_bench", *words])
    monkeypatch.setattr("snr_sim.devices.emulated.rover_bench.until_ended", lambda: lambda: False)
    with pytest.raises(SystemExit, match="2"):
        main()
    assert message in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGINT])
def test_bench_by_hand_serves_controllers_and_removes_its_ports(tmp_path: Path, how: signal.Signals) -> None:
    words = ["-m", "snr_sim.devices.emulated.rover_bench", "--links", str(tmp_path), "--motors", "A B"]
    with subprocess.Popen([sys.executable, *words], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == f"motor_A at {tmp_path}/1-1.1\n"
        assert process.stdout.readline() == f"motor_B at {tmp_path}/1-1.2\n"
        ports = MotorPorts(PortWatch(partial(list_links, tmp_path)), SerialPort, time.monotonic)
        names = ("motor_B", "motor_A")
        lines = [VescLine(name, partial(ports.open_port, name), time.monotonic, 228.0, "seed") for name in names]
        motors, sensor = VescMotors(lines, LIMITS, NEUTRAL_BRAKE_A, poll=ports.poll), VescSensor(lines[0])
        for device in (motors, sensor):
            device.configure()
            device.activate()
        end_s = time.monotonic() + 30.0
        while not (isinstance(reading := sensor.read(), MotorReading) and abs(reading.speed_radps - 3.0) < 0.01):
            assert time.monotonic() < end_s, reading
            motors.write(DriveCommand("speed", [3.0, -1.0]))
            time.sleep(0.02)
        motors.close()
        sensor.close()
        process.send_signal(how)
        assert process.wait(30.0) == 0
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_rover_with_plugs_pulled_from_ports_is_armed_again_and_its_bench_ends() -> None:
    simulation = prepare(Request("rover_unplug", engine="pymunk", io="pty"))
    plant = simulation.plant()
    assert isinstance(plant, PtyPlant)
    result = SimulationRun(simulation, plant, simulation.config(plant)).run()
    assert (result.error, result.outcome, result.success) == ("", "completed", True)
    states = [note for note in result.notes if note.startswith("Motors of 'drive'")]
    assert ["error" in states[0], "found again" in states[-2], "armed again" in states[-1]] == [True] * 3
    pid, folder = plant._bench.pid, plant.folder
    plant._end()
    assert not folder.exists()
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)
