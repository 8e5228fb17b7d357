"""One motor turned on the bench: which it is, and whether it stops without commands; and the file of the results."""

from pathlib import Path

import pytest

from snr_sim.devices.emulated.emulated_vesc import EmulatedVesc, ScriptedFault
from snr_sim.devices.emulated.vesc_plant import VescPort
from snr_sim.devices.motors.bench_check import DUTY, measure_timeout
from snr_sim.devices.motors.ports_file import PortsFile, read_ports
from snr_sim.devices.motors.vesc_line import VescLine
from snr_sim.prelude.errors import DeviceError, ParameterError
from tests.devices.emulated.test_emulated_vesc import BenchMotor


class TurningMotor(BenchMotor):
    """Turns by its duty, too."""

    def step(self, dt_s: float) -> None:
        mode, value = self.commands[-1]
        if mode == "duty":
            self.speed_radps += min(1.0, dt_s / 0.1) * (20.0 * value - self.speed_radps)
        else:
            super().step(dt_s)


class Bench:
    """A motor and its controller, in simulated time."""

    def __init__(self, timeout_s: float = 0.25, faults: tuple[ScriptedFault, ...] = ()) -> None:
        self.time_s, self.motor = 0.0, TurningMotor()
        self.far = EmulatedVesc(self.motor, "motor_LF", 228.0, timeout_s=timeout_s, faults=faults)
        self.port = VescPort(self.far, self.now_s, "/dev/ttyACM0", lambda: False)
        self.line = VescLine("/dev/ttyACM0", lambda: self.port, self.now_s, 228.0)
        self.line.open(self)

    def now_s(self) -> float:
        return self.time_s

    def sleep(self, seconds: float) -> None:
        self.time_s += seconds
        self.port.tick()
        self.motor.step(seconds)


def test_timeout_of_a_controller_that_stops_is_measured() -> None:
    bench = Bench()
    assert measure_timeout(bench.line, bench.sleep) == pytest.approx(0.26, abs=0.03)
    assert max(abs(value) for mode, value in bench.motor.commands if mode == "duty") == pytest.approx(DUTY)
    assert bench.motor.commands[-1] == ("current", 0.0)


def test_controller_that_drives_for_longer_is_reported_and_stopped() -> None:
    bench = Bench(timeout_s=1.0)
    with pytest.raises(DeviceError, match=r"/dev/ttyACM0 drives its motor for (0\.9|1\.0)\d s without a command"):
        measure_timeout(bench.line, bench.sleep)
    assert bench.motor.commands[-1] == ("current", 0.0)


def test_motor_that_does_not_turn_is_reported() -> None:
    bench = Bench(faults=(ScriptedFault("motor", 0.0, 99.0, text="drv"),))
    with pytest.raises(DeviceError, match="does not turn its motor"):
        measure_timeout(bench.line, bench.sleep)


def test_ports_file_is_read_as_it_was_written(tmp_path: Path) -> None:
    ports, path = PortsFile('/dev/"x"', {"3a00": "motor_LF", "3a01": "motor_RF"}, {"3a00": 0.251}), tmp_path / "p.toml"
    assert read_ports(path) == PortsFile()
    ports.write(path)
    assert read_ports(path) == ports


@pytest.mark.parametrize("text", ["links = ", "links = 3", '[vesc]\n"3a" = 1', "[wheels]"])
def test_invalid_ports_file_is_reported(tmp_path: Path, text: str) -> None:
    path = tmp_path / "p.toml"
    path.write_text(text)
    with pytest.raises(ParameterError, match=r"p\.toml is not a file of ports"):
        read_ports(path)
