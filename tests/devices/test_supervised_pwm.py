"""Outputs behind the supervisor: the contract in simulated time, and the outputs after processes are killed (H9)."""

import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from snr_sim import Config, Node, SimClock, TimeoutLoopFactory
from snr_sim.devices.output_supervisor import OutputSupervisor
from snr_sim.devices.pwm.passive_pwm import PassivePwm
from snr_sim.devices.pwm.pca9685 import Pca9685
from snr_sim.devices.pwm.pwm_loop import PwmLoopFactory
from snr_sim.devices.pwm.pwm_supervisor import PwmSupervisor
from snr_sim.devices.pwm.supervised_pwm import SupervisedPwm
from snr_sim.devices.wire.lease_messages import (
    CODEC,
    ArmOutputs,
    DisarmOutputs,
    LeaseStatus,
    Message,
    OpenOutputs,
    SupervisorPort,
)
from snr_sim.prelude.errors import DeviceError
from snr_sim.prelude.signals import LOST, NOT_ACTIVE
from snr_sim.testing.fake_i2c import FakePca9685
from snr_sim.testing.fake_sysfs_pwm import FakeSysfsPwm
from snr_sim.testing.function_components import FunctionLoopFactory
from snr_sim.testing.pwm_contract import check_pwm_out
from tests.devices.benches import I2cBench

HERE = Path(__file__).parent
GENEROUS_S = 60.0


class Line:
    """A supervisor without a process: it executes orders at once."""

    def __init__(self, supervisor: OutputSupervisor[Any], hold: Callable[[float], None] = lambda seconds: None) -> None:
        self.supervisor, self._hold = supervisor, hold
        self._answers: list[LeaseStatus] = []
        self.is_silent = self.is_dead = False

    def write(self, order: Message) -> None:
        self._check()
        if not self.is_silent:
            self._answers.append(self.supervisor.execute(CODEC.decode(CODEC.encode(order))))

    def read(self) -> list[LeaseStatus]:
        self._check()
        answers, self._answers = self._answers, []
        return answers

    def wait(self, seconds: float) -> bool:
        return bool(self._answers)

    def close(self) -> None:
        if not self.is_dead:
            self.supervisor.end(self._hold)

    def _check(self) -> None:
        if self.is_dead:
            raise DeviceError("The process 7 was killed by SIGKILL.")


class Bench(I2cBench):
    """A PCA9685 behind a supervisor, in simulated time."""

    can_unplug = False  # the pipe has no wire to pull; the chip's has a test below

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.time_s = 100.0
        self.part = FakePca9685()
        super().__init__({0x40: self.part})
        self.line = Line(PwmSupervisor(self.now_s))
        opener = ModuleType("bench_of_this_test")
        opener.open = self._chip  # type: ignore[attr-defined]
        monkeypatch.setitem(sys.modules, opener.__name__, opener)

    def _chip(self, reclaim: bool = False) -> PassivePwm:
        chip = Pca9685(self.bus, 0x40, 8, sleep=lambda seconds: None)
        return PassivePwm(chip, self.now_s, esc_start_s=1.0, is_supervised=True)

    def open(self) -> SupervisedPwm:
        return SupervisedPwm(
            self._chip(), self.now_s, "bench_of_this_test:open", [], open_line=self._line, monotonic_s=self.now_s
        )

    def _line(self) -> Line:
        self.line = Line(PwmSupervisor(self.now_s))
        return self.line

    def armed(self) -> SupervisedPwm:
        out = self.open()
        out.configure()
        out.activate()
        for _ in range(100):
            self.advance(0.02)
            if not out.write_us([1500.0] * 8, self.time_s).reason:
                return out
        raise AssertionError(out.health())

    def advance(self, seconds: float) -> None:
        """Advance the time; a supervisor checks its clock by itself."""
        until_s = self.time_s + seconds
        while self.time_s < until_s - 1e-9:
            self.time_s = min(until_s, self.time_s + 0.005)
            self.line.supervisor.poll()

    def pins_us(self) -> list[float]:
        return self.part.pins_us(8)


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Bench:
    return Bench(monkeypatch)


def test_supervised_pwm_passes_pwm_contract_with_failsafe(bench: Bench) -> None:
    assert bench.open().has_independent_failsafe
    check_pwm_out(bench)


def test_supervised_pwm_expired_lease_rearms_only_by_activate_and_neutral(bench: Bench) -> None:
    out = bench.armed()
    out.write_us([1700.0] * 8, bench.time_s)
    bench.advance(0.21)
    assert bench.pins_us() == [pytest.approx(1498.2, abs=0.1)] * 8
    assert NOT_ACTIVE in out.write_us([1700.0] * 8, bench.time_s).reason
    assert NOT_ACTIVE in out.write_us([1700.0] * 8, bench.time_s).reason
    assert "the lease ran out" in out.health().reason
    out.activate()
    for _ in range(100):
        bench.advance(0.02)
        out.write_us([1700.0] * 8, bench.time_s)
    assert out.health().state == "activating"
    assert bench.pins_us() == [pytest.approx(1498.2, abs=0.1)] * 8


def test_supervised_pwm_command_age_equals_age_in_program(bench: Bench) -> None:
    """It was computed 0.15 s ago, so 0.05 s are left of it."""
    out = bench.armed()
    out.write_us([1700.0] * 8, bench.time_s - 0.15)
    bench.advance(0.04)
    assert bench.pins_us()[0] > 1690.0
    bench.advance(0.02)
    assert bench.pins_us() == [pytest.approx(1498.2, abs=0.1)] * 8


def test_supervised_pwm_pulled_wire_reports_supervisors_error(bench: Bench) -> None:
    out = bench.armed()
    bench.raw.is_there = False
    applied = out.write_us([1700.0] * 8, bench.time_s)
    assert LOST in applied.reason
    assert "No device answers at 0x40 on /dev/i2c-1" in out.health().reason
    with pytest.raises(DeviceError, match="No device answers at 0x40"):
        out.configure()
    bench.raw.is_there = True
    out.configure()
    assert out.health().state == "inactive"


def test_supervised_pwm_hanging_supervisor_is_reported(bench: Bench) -> None:
    out = bench.armed()
    bench.line.is_silent = True
    for _ in range(60):
        bench.advance(0.02)
        out.write_us([1500.0] * 8, bench.time_s)
    assert "has not answered for 1 s" in out.health().reason


def test_supervised_pwm_dead_supervisor_is_neutral_until_rearmed(bench: Bench) -> None:
    """In lock step: 1700 us from 1.5 s on, the supervisor dies at 2 s, neutral from 3 to 5.5 s, then 1700 us again."""
    seen: list[tuple[float, bool]] = []
    bench.time_s = 0.0

    def store_command(loop: Any) -> None:
        bench.time_s = now_s = loop.get_time_s()
        bench.line.supervisor.poll()
        if 2.0 <= now_s < 2.02:
            bench.line.is_dead = True
        seen.append((now_s, bench.pins_us()[0] > 1600.0))
        pushes = 1.5 <= now_s < 3.0 or now_s >= 5.5
        loop.store_data("pwm", {"pulses_us": [1700.0 if pushes else 1500.0] * 8})

    factories = [
        FunctionLoopFactory(store_command, "pilot", 50.0),
        PwmLoopFactory("pwm", bench.open, 50.0),
        TimeoutLoopFactory(seconds=6.0),
    ]
    node = Node("r", Config(factories={"r": factories}), clock=SimClock())
    node.loop()

    def moved(from_s: float, to_s: float) -> set[bool]:
        return {moves for at_s, moves in seen if from_s <= at_s < to_s}

    assert moved(0.0, 1.5) == {False}
    assert moved(1.6, 2.0) == {True}
    assert moved(2.1, 5.5) == {False}  # the next supervisor holds neutral, and it is not armed
    assert moved(5.6, 6.0) == {True}
    (note,) = [note for note in node.notes if "error" in note]
    assert "The process 7 was killed by SIGKILL." in note


@pytest.mark.parametrize("data", [b"abc", b'{"type":"Arx"}'])
def test_decode_invalid_bytes_raises_device_error(data: bytes) -> None:
    with pytest.raises(DeviceError, match="is not a supervisor message"):
        CODEC.decode(data)


def write_indefinitely(port: SupervisorPort) -> None:
    while True:
        port.write(DisarmOutputs("x" * 8000))


@pytest.mark.slow
def test_supervisor_port_hung_or_ended_process_raises_at_once() -> None:
    port = SupervisorPort()
    os.kill(port.pid, signal.SIGSTOP)
    with pytest.raises(DeviceError, match=f"process {port.pid} does not read its input: it hangs"):
        write_indefinitely(port)
    os.kill(port.pid, signal.SIGKILL)
    assert port.wait(GENEROUS_S)
    for call in (port.read, lambda: port.write(ArmOutputs())):
        with pytest.raises(DeviceError, match="was ended by SIGKILL"):
            call()
    port.close()


def test_supervisor_order_before_open_returns_error_with_fix() -> None:
    answer = PwmSupervisor(lambda: 0.0).execute(ArmOutputs())
    assert (answer.state, answer.reason) == ("error", "These outputs are not open.")
    with pytest.raises(DeviceError, match="at most 8192"):
        CODEC.encode(OpenOutputs("x:y", ["z" * 9000]))


# From here on with real processes.


def chip_file(folder: Path) -> str:
    file = folder / "registers"
    file.write_bytes(bytes(256))
    from_tests(lambda held: held.chip_in(str(file)).power_on())
    return str(file)


def from_tests(use: Callable[[Any], Any]) -> Any:
    sys.path.insert(0, str(HERE))
    try:
        import held_outputs  # type: ignore[import-not-found]
    finally:
        sys.path.remove(str(HERE))
    return use(held_outputs)


def place_and_pins(kind: str, folder: Path) -> tuple[str, Callable[[], list[float]]]:
    if kind == "open_chip":
        file = chip_file(folder)
        part = from_tests(lambda held: held.chip_in(file))
        return file, lambda: part.pins_us(2)
    tree = FakeSysfsPwm(folder / "pwm")
    return str(tree.root), lambda: [tree.pulse_us(0), tree.pulse_us(1)]


def wait_until(is_so: Callable[[], bool], what: str) -> float:
    """Wait until a condition is true; return how long it took."""
    began_s = time.monotonic()
    while not is_so():
        assert time.monotonic() < began_s + GENEROUS_S, what
        time.sleep(0.001)
    return time.monotonic() - began_s


def is_neutral(pins_us: list[float]) -> bool:
    return all(abs(pin - 1500.0) <= 2.5 for pin in pins_us)


@contextmanager
def pushing(kind: str, place: str) -> Iterator[subprocess.Popen[str]]:
    """Yield a robot's program in a separate process, at full thrust."""
    program = [sys.executable, str(HERE / "held_outputs.py"), kind, place]
    with subprocess.Popen(program, stdout=subprocess.PIPE, text=True) as node:
        assert node.stdout is not None
        try:
            assert select.select([node.stdout], [], [], GENEROUS_S)[0], "it does not begin to push"
            assert node.stdout.readline() == "pushing\n"
            yield node
        finally:
            node.kill()


@pytest.mark.wall_clock
@pytest.mark.parametrize("kind", ["open_tree", "open_chip"])
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP])
def test_h9_killed_or_hanging_program_leaves_neutral_within_250_ms(
    tmp_path: Path, kind: str, how: signal.Signals
) -> None:
    """Tried up to four times: a busy computer may keep any process waiting for longer than that."""
    took_s = []
    for nth in range(4):
        folder = tmp_path / str(nth)
        folder.mkdir()
        place, pins_us = place_and_pins(kind, folder)
        with pushing(kind, place) as node:
            wait_until(lambda pins=pins_us: pins()[0] > 1890.0, "full thrust")
            os.kill(node.pid, how)
            took_s.append(wait_until(lambda pins=pins_us: is_neutral(pins()), "neutral"))
        if took_s[-1] <= 0.25:
            return
    raise AssertionError(f"neutral after {took_s} s")


def children_of(pid: int) -> list[int]:
    """Return the child processes of a process."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            if int(stat.read_text().rpartition(")")[2].split()[1]) == pid:
                found.append(int(stat.parent.name))
    return found


def is_alive(pid: int) -> bool:
    with suppress(OSError):
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    return False


@pytest.mark.wall_clock
@pytest.mark.parametrize("kind", ["open_tree", "open_chip"])
def test_h9_killed_supervisor_is_neutral_by_watchdog_and_next_reclaims(
    tmp_path: Path, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(HERE))
    place, pins_us = place_and_pins(kind, tmp_path)
    out: SupervisedPwm = from_tests(lambda held: held.supervised(kind, place))
    out.configure()
    follow(out, [1900.0] * 2, lambda: pins_us()[0] > 1890.0)
    os.kill(pid_of(out), signal.SIGKILL)
    wait_until(lambda: is_neutral(pins_us()), "the guard does nothing")
    wait_until(lambda: LOST in out.write_us([1900.0] * 2, time.monotonic()).reason, "the loss is not reported")
    assert out.health().state == "error"
    assert "was ended by SIGKILL" in out.health().reason
    out.configure()
    assert is_neutral(pins_us())
    assert LOST not in out.write_us([1900.0] * 2, time.monotonic()).reason
    assert is_neutral(pins_us())
    follow(out, [1900.0] * 2, lambda: pins_us()[0] > 1890.0)
    (guard,) = children_of(pid_of(out))
    out.close()
    assert pins_us() == [0.0, 0.0] if kind == "open_tree" else is_neutral(pins_us())
    wait_until(lambda: not is_alive(guard), "the guard stays")


def pid_of(out: SupervisedPwm) -> int:
    line: Any = out._client.line
    return int(line.pid)


def follow(out: SupervisedPwm, pulses_us: list[float], is_so: Callable[[], bool]) -> None:
    """Arm outputs and command pulses until a condition is true."""

    def write() -> bool:
        if out.health().state == "inactive":
            out.activate()  # a busy computer: a lease has expired
        is_armed = out.health().state == "active"  # arming completes only while neutral is commanded
        out.write_us(pulses_us if is_armed else [1500.0] * 2, time.monotonic())
        return is_so()

    wait_until(write, f"{out.health()} does not follow {pulses_us}")


@pytest.mark.slow
def test_h9_hanging_supervisor_is_neutral_by_watchdog_after_resuming(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(HERE))
    place, pins_us = place_and_pins("open_chip", tmp_path)
    out: SupervisedPwm = from_tests(lambda held: held.supervised("open_chip", place))
    out.configure()
    follow(out, [1900.0] * 2, lambda: pins_us()[0] > 1890.0)
    os.kill(pid_of(out), signal.SIGSTOP)
    try:
        wait_until(lambda: is_neutral(pins_us()), "the guard does nothing")
        out.write_us([1900.0] * 2, time.monotonic())  # which it will read when it continues
    finally:
        os.kill(pid_of(out), signal.SIGCONT)
    wait_until(lambda: NOT_ACTIVE in out.write_us([1900.0] * 2, time.monotonic()).reason, "it is not reported")
    assert is_neutral(pins_us())
    out.close()


@pytest.mark.slow
def test_killed_watchdog_keeps_outputs_following(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is needed when its supervisor is killed; no protection is provided against the end of both."""
    monkeypatch.syspath_prepend(str(HERE))
    place, pins_us = place_and_pins("open_chip", tmp_path)
    out: SupervisedPwm = from_tests(lambda held: held.supervised("open_chip", place))
    out.configure()
    (guard,) = children_of(pid_of(out))
    os.kill(guard, signal.SIGKILL)
    wait_until(lambda: not is_alive(guard), "it lives")
    follow(out, [1900.0] * 2, lambda: pins_us()[0] > 1890.0)
    out.close()
    assert is_neutral(pins_us())


@pytest.mark.slow
def test_supervisor_open_failure_reports_its_error_and_ends(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.syspath_prepend(str(HERE))
    tree = FakeSysfsPwm(tmp_path)
    tree.write(tmp_path / "pwmchip0/export", "0")
    out: SupervisedPwm = from_tests(lambda held: held.supervised("open_tree", str(tmp_path)))
    with pytest.raises(DeviceError, match="pwm0 is in use: another program has exported it") as e:
        out.configure()
    assert "unexport" in e.value.fix
    assert out._client.line is None
    assert capfd.readouterr().err == ""  # a message about neutral needs outputs that were held
    out.close()
