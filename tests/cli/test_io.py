"""`snr io`: its display of a robot's devices; only the confirmed output moves."""

import io
import json
import os
import pty
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from snr_sim.cli.io import lines
from snr_sim.devices.motors.ports_file import read_ports
from snr_sim.devices.pwm.motor_test import WHOLE_S, motor_test_pulses_us, top_us
from snr_sim.devices.pwm.pwm_backend import LoopbackPwm, PwmBackend
from snr_sim.devices.wire.serial_port import PortInfo
from snr_sim.prelude.device import Stale
from snr_sim.prelude.errors import DeviceError, SensorLostError, UnknownNameError
from snr_sim.prelude.life_cycle import LifeCycle
from snr_sim.prelude.signals import AppliedPulses, DepthReading
from snr_sim.scenario.device_bench import ARMING_TIMEOUT_S, TICK_S, Bench, bench_of, devices_of, fields_of

Snr = Callable[..., Any]
STILL = [1500.0] * 4


class Outputs(PwmBackend):
    """Outputs of four channels that keep what they made, and take a second to arm."""

    has_independent_failsafe = True

    arms = True

    def __init__(self, now_s: Callable[[], float]) -> None:
        super().__init__(now_s, 4)
        self.made: list[AppliedPulses] = []
        self.armed_s = 0.0

    def on_activate(self) -> None:
        self.state, self.armed_s = "activating", self.now_s() + 1.0

    def on_deactivate(self, reason: str) -> None:
        self.made.append(AppliedPulses(self.still_us, self.now_s(), [reason]))

    def put(self, pulses_us: list[float], stamp_s: float, lease_s: float, reasons: list[str]) -> list[float]:
        if self.arms and self.state == "activating" and self.now_s() >= self.armed_s:
            self.state = "active"
        self.made.append(AppliedPulses(pulses_us, stamp_s, reasons))
        return pulses_us


class Depth(LifeCycle):
    """A depth sensor with configurable readings."""

    reading: Any = Stale("/dev/i2c-1: nothing has come yet")

    def read(self) -> Any:
        if isinstance(self.reading, Exception):
            raise self.reading
        return self.reading


class BenchWorld:
    """A bench with time that is moved by hand."""

    def __init__(self) -> None:
        self.time_s = 0.0
        self.out, self.depth = Outputs(lambda: self.time_s), Depth()
        self.bench = Bench({"depth": lambda: self.depth}, {"pwm": lambda: self.out}, lambda: self.time_s)

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / TICK_S)):
            self.time_s += TICK_S
            self.bench.tick()


@pytest.fixture
def world() -> Iterator[BenchWorld]:
    world = BenchWorld()
    with world.bench:
        yield world


def test_without_move_outputs_stay_unarmed(world: BenchWorld) -> None:
    world.run(5.0)
    assert world.out.state == "inactive"
    assert not world.out.made


def test_move_moves_one_channel_by_5_percent_for_2_s(world: BenchWorld) -> None:
    world.bench.arm("pwm2")
    world.run(6.0)
    moved = [one.pulses_us for one in world.out.made if one.pulses_us != STILL]
    assert max(pulses[2] for pulses in moved) == top_us() == 1500.0 + 25.0 + 0.05 * 375.0
    assert {pulse for pulses in moved for i, pulse in enumerate(pulses) if i != 2} == {1500.0}
    assert len(moved) * TICK_S <= WHOLE_S
    assert max(abs(b[2] - a[2]) for a, b in pairwise(moved)) < 5.0  # a ramp
    assert world.out.state == "inactive"
    assert world.out.made[-1].pulses_us == STILL
    assert not world.bench.is_moving
    assert world.bench.max_pulse_us == top_us()


def test_pulses_are_neutral_until_outputs_are_armed(world: BenchWorld) -> None:
    world.bench.arm("pwm0")
    world.run(0.9)
    assert {tuple(one.pulses_us) for one in world.out.made} == {tuple(STILL)}


def test_stop_is_neutral_at_once_and_stays_neutral(world: BenchWorld) -> None:
    world.bench.arm("pwm2")
    world.run(2.0)
    assert world.out.made[-1].pulses_us != STILL
    world.bench.stop("a key was pressed")
    assert world.out.made[-1] == AppliedPulses(STILL, world.time_s, ["a key was pressed"])
    count = len(world.out.made)
    world.run(3.0)
    assert len(world.out.made) == count


def test_outputs_that_never_arm_raise_with_fix(world: BenchWorld) -> None:
    world.out.arms = False
    world.bench.arm("pwm2")
    with pytest.raises(DeviceError, match=r"'pwm' did not follow: activating[\s\S]*snr doctor --io"):
        world.run(ARMING_TIMEOUT_S + 1.0)
    assert all(one.pulses_us == STILL for one in world.out.made)


def test_unknown_channel_suggests_nearest(world: BenchWorld) -> None:
    with pytest.raises(UnknownNameError, match=r"no channel 'pmw2'[\s\S]*pwm2"):
        world.bench.arm("pmw2")
    assert world.out.state == "inactive"


def test_channel_is_found_by_name_or_unique_number(world: BenchWorld) -> None:
    assert [world.bench.name_of(given) for given in ("pwm3", "3")] == ["pwm3", "pwm3"]
    for given in ("4", "-1", "03", ""):
        with pytest.raises(UnknownNameError, match=rf"no channel '{given}'[\s\S]*pwm0"):
            world.bench.name_of(given)
    two = {"pwm": lambda: LoopbackPwm(lambda: 0.0, 4), "jets": lambda: LoopbackPwm(lambda: 0.0, 2)}
    with Bench({}, two, lambda: 0.0) as bench:
        assert (bench.name_of("3"), bench.name_of("jets1")) == ("pwm3", "jets1")
        with pytest.raises(UnknownNameError, match=r"Channel 1 may be pwm1 or jets1\.\n  Try: --move pwm1"):
            bench.name_of("1")


def test_channel_names_equal_those_of_move(world: BenchWorld) -> None:
    world.run(0.1)
    assert "pwm0:1500 pwm1:1500 pwm2:1500 pwm3:1500" in lines(world.bench)[0]


def test_bracketed_headings_are_printed(snr: Snr) -> None:
    output = snr("io", "--io", "loopback", "--once").out
    assert "reading, or pulses [us]" in output
    assert "age [ms]" in output


def test_device_that_fails_to_open_reports_message_and_fix_only() -> None:
    def absent() -> Any:
        raise DeviceError("There is no serial port /dev/ttyUSB9.", fix="there are: /dev/ttyS0.")

    with Bench({"power": absent}, {"pwm": absent}, lambda: 0.0) as bench:
        bench.tick()
        for line, key in zip(lines(bench), ("pwm", "power"), strict=True):
            assert line.endswith(f"{key}: error; There is no serial port /dev/ttyUSB9. Try: there are: /dev/ttyS0.")


def test_bench_exit_leaves_outputs_neutral_and_closed() -> None:
    world = BenchWorld()
    world.bench.__enter__()
    world.bench.arm("pwm1")
    world.run(2.0)
    assert world.out.made[-1].pulses_us != STILL
    world.bench.__exit__(KeyboardInterrupt)
    assert world.out.made[-1].pulses_us == STILL
    assert (world.out.state, world.depth.state) == ("closed", "closed")


def test_signal_during_open_closes_open_devices() -> None:
    world = BenchWorld()

    def interrupted() -> Any:
        raise KeyboardInterrupt

    bench = Bench({}, {"pwm": lambda: world.out, "slow": interrupted}, lambda: 0.0)
    with pytest.raises(KeyboardInterrupt):
        bench.__enter__()
    assert world.out.state == "closed"


def test_sensors_report_age_or_error(world: BenchWorld) -> None:
    (depth,) = world.bench.sensors
    world.run(0.1)
    assert not depth.is_ok
    assert fields_of(depth, world.time_s)["stale"] == "/dev/i2c-1: nothing has come yet"
    world.depth.reading = DepthReading(1.5, 1.2e5, 18.0, stamp_s=0.1)
    world.run(0.1)
    assert depth.is_ok
    fields = fields_of(depth, world.time_s)
    assert (fields["reading"]["depth_m"], fields["age_s"]) == (1.5, pytest.approx(0.1))
    world.depth.reading = SensorLostError("/dev/i2c-1 is gone.")
    world.run(0.1)
    assert not depth.is_ok
    assert depth.health.state == "error"
    assert "is gone" in depth.health.reason


def test_device_that_fails_to_open_is_reported_and_others_are_shown() -> None:
    def broken() -> Any:
        raise DeviceError("There is no serial port /dev/ttyUSB7.", fix="plug it in.")

    world = BenchWorld()
    with Bench({"depth": lambda: world.depth}, {"pwm": broken}, lambda: 0.0) as bench:
        bench.tick()
        assert "plug it in" in bench.outputs[0].health.reason
        assert bench.sensors[0].device is world.depth


def test_motor_test_pulse_rises_and_falls_within_2_s() -> None:
    pulses = [motor_test_pulses_us(0, 1, 0.01 * k) for k in range(220)]
    assert pulses[0] == [1500.0]
    assert max(one[0] for one in pulses if one is not None) == top_us()
    assert pulses[round(100 * WHOLE_S) :] == [None] * (220 - round(100 * WHOLE_S))


@pytest.mark.parametrize("io", ["sim", "loopback"])
def test_json_contains_all_devices_of_robot(snr: Snr, io: str) -> None:
    answer = snr("io", "--io", io, "--once", "--json")
    assert answer.status == 0
    (pwm,) = answer.json["outputs"]
    assert (pwm["state"], pwm["channels"], pwm["pulses_us"]) == ("inactive", 8, [1500.0] * 8)
    assert {one["key"] for one in answer.json["sensors"]} == {"depth", "altitude", "power", "leak", "imu"}
    assert all(one["reading"] and one["age_s"] is not None for one in answer.json["sensors"])


def test_io_pi_opens_devices_of_first_role() -> None:
    simulation = devices_of("urov_depth_hold", "pi")
    assert simulation.roles == ["urov"]
    bench = bench_of(simulation)  # not entered: nothing of this computer's is opened
    assert not bench.sensors


def test_lost_outputs_report_no_pulses(world: BenchWorld) -> None:
    world.run(0.1)
    assert fields_of(world.bench.outputs[0], world.time_s)["pulses_us"] == STILL
    world.out.fail("/dev/ttyUSB0 is gone.")
    world.run(0.1)
    fields = fields_of(world.bench.outputs[0], world.time_s)
    assert (fields["state"], fields["pulses_us"], fields["reasons"]) == ("error", None, ["lost"])


def test_invalid_requests_are_rejected(snr: Snr) -> None:
    for words, expected in (
        (("--json",), "--once --json"),
        (("--move", "pwm0"), "needs a terminal"),
        (("--io", "simm", "--once"), "no devices of the kind 'simm'"),
        (("nowhere", "--once"), "nowhere"),
    ):
        answer = snr("io", *words)
        assert answer.status == 2
        assert expected in answer.err


ROBOT = '''
"""A robot of one real thruster; what its outputs make goes into a file."""
from functools import partial
from pathlib import Path

from snr_sim.devices.pwm.pwm_backend import LoopbackPwm
from snr_sim.devices.pwm.pwm_loop import PwmLoopFactory

ROLES, IO = ("rov",), ("pi",)
LOG = Path(__file__).with_name("made.txt")


class Logged(LoopbackPwm):
    def put(self, pulses_us, stamp_s, lease_s, reasons):
        self.note(pulses_us)
        return pulses_us

    def on_deactivate(self, reason):
        self.note(self.still_us)

    def note(self, pulses_us):
        with LOG.open("a") as log:
            log.write(f"{pulses_us[0]:g}\\n")


def roles(context, controller):
    return {"rov": [PwmLoopFactory("pwm", lambda: Logged(context.now_s, 2), 50.0)]}
'''
SCENARIO = """
ROBOT = "one"
ENGINES = ("none",)
CONTROLLER = "nothing"
TIME_LIMIT_S = 1.0
parameters = plant = verdict = metrics = lambda *given: None
"""


@pytest.fixture
def made(here: Path) -> Path:
    """A robot of a student's own in the current folder; returns the file of what its outputs make."""
    (here / "robots/one/controllers").mkdir(parents=True)
    (here / "scenarios").mkdir()
    (here / "robots/one/robot.py").write_text(ROBOT)
    (here / "robots/one/controllers/nothing.py").write_text("def factories(robot): return []\n")
    (here / "scenarios/bench.py").write_text(SCENARIO)
    return here / "robots/one/made.txt"


class Terminal:
    """`snr io` at a terminal of its own."""

    def __init__(self, *words: str) -> None:
        self.master, slave = pty.openpty()
        command = [sys.executable, "-m", "snr_sim", "io", *words]
        self.process = subprocess.Popen(command, stdin=slave, stdout=slave, stderr=slave, start_new_session=True)
        os.close(slave)
        self.output = ""

    def until(self, is_so: Callable[[], bool]) -> None:
        until_s = time.monotonic() + 60.0
        while not is_so():
            assert time.monotonic() < until_s, self.output
            assert self.process.poll() is None, self.output
            self.read_output(0.02)

    def read_output(self, seconds: float) -> bool:
        """Read what is printed, so that the program never blocks on a full pipe; return whether there was any."""
        try:
            if select.select([self.master], [], [], seconds)[0]:
                self.output += (chunk := os.read(self.master, 65536).decode(errors="replace"))
                return bool(chunk)
        except OSError:  # the far end has closed
            pass
        return False

    def type(self, text: str) -> None:
        os.write(self.master, text.encode())

    def status(self) -> int:
        until_s = time.monotonic() + 60.0
        while self.process.poll() is None:
            assert time.monotonic() < until_s, self.output
            self.read_output(0.02)
        while self.read_output(0.0):
            pass
        return int(self.process.returncode)


@pytest.fixture
def terminal(made: Path) -> Iterator[Callable[..., Terminal]]:
    opened = []

    def open_one(*words: str) -> Terminal:
        opened.append(Terminal("bench", "--io", "pi", *words))
        return opened[-1]

    yield open_one
    for one in opened:
        if one.process.poll() is None:
            one.process.kill()
        one.process.wait()
        os.close(one.master)


def pulses(made: Path) -> list[float]:
    return [float(line) for line in made.read_text().split()] if made.exists() else []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("ends", "status"),
    [(signal.SIGINT, 130), (signal.SIGTERM, 143), ("x", 0), ("", 0)],
    ids=["INT", "TERM", "key", "-"],
)
def test_last_pulse_is_neutral_however_move_ends(
    terminal: Callable[..., Terminal], made: Path, ends: Any, status: int
) -> None:
    snr = terminal("--move", "pwm0")
    snr.until(lambda: "to continue:" in snr.output)
    assert not pulses(made)
    snr.type("pwm0 props off\n")
    snr.until(lambda: max(pulses(made), default=0.0) > 1520.0)
    if isinstance(ends, str):
        snr.type(ends)
    else:
        snr.process.send_signal(ends)
    assert snr.status() == status, snr.output
    assert pulses(made)[-1] == 1500.0
    assert max(pulses(made)) <= top_us()


@pytest.mark.slow
def test_wrong_confirmation_arms_nothing(terminal: Callable[..., Terminal], made: Path) -> None:
    snr = terminal("--move", "pwm0")
    snr.until(lambda: "to continue:" in snr.output)
    snr.type("yes\n")
    assert snr.status() == 2
    assert "Nothing was moved: 'yes' is not 'pwm0 props off'" in snr.output
    assert set(pulses(made)) <= {1500.0}


@pytest.mark.slow
def test_pipe_output_is_lines(made: Path, here: Path) -> None:
    command = [sys.executable, "-m", "snr_sim", "io", "bench", "--io", "pi", "--seconds", "0.1"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert "pwm: inactive; pwm0:1500 pwm1:1500; not active" in done.stdout
    once = subprocess.run([*command[:-2], "--once", "--json"], capture_output=True, text=True, timeout=120)
    assert json.loads(once.stdout)["outputs"][0]["channels"] == 2


def test_identify_without_ports_or_a_writable_file_is_status_2(
    snr: Snr, here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (here / "none.toml").write_text('links = "none"\n')
    answer = snr("io", "rover_teleop", "--identify", "--io", "ports:none.toml")
    assert (answer.status, "There is no serial port in none" in answer.err) == (2, True), answer.err
    monkeypatch.setattr("snr_sim.cli.io_motors.list_links", lambda folder: [PortInfo("/dev/never_opened")])
    monkeypatch.setattr(sys, "stdin", io.StringIO("wheels off the ground\n"))
    answer = snr("io", "rover_teleop", "--identify", "--io", "ports:gone/ports.toml")
    assert (answer.status, "gone/ports.toml cannot be written" in answer.err) == (2, True), answer.err
    assert "/dev/never_opened" not in answer.out


@pytest.mark.slow
def test_io_identifies_motors_at_ports_and_measures_their_timeouts(tmp_path: Path) -> None:
    links, file = tmp_path / "links", tmp_path / "ports.toml"
    file.write_text(f'links = "{links}"\n')
    words = ["-m", "snr_sim.devices.emulated.rover_bench", "--links", str(links), "--motors", "LF RF"]
    asked = ["-m", "snr_sim", "io", "rover_teleop", "--io", f"ports:{file}", "--identify", "--check-timeout"]
    with subprocess.Popen([sys.executable, *words], stdout=subprocess.PIPE) as bench:
        assert bench.stdout is not None
        assert [bench.stdout.readline() for _ in range(2)]
        refused = subprocess.run([sys.executable, *asked], input="yes\n", capture_output=True, text=True, check=False)
        typed = "wheels off the ground\nmotor_RF\nmotor_LF\n"
        done = subprocess.run([sys.executable, *asked], input=typed, capture_output=True, text=True, check=False)
        bench.terminate()
    assert (refused.returncode, "Nothing was moved" in refused.stderr) == (2, True)
    assert (done.returncode, done.stderr) == (0, "")
    ports = read_ports(file)
    assert list(ports.vesc.values()) == ["motor_RF", "motor_LF"]  # as they were named, whatever they say themselves
    assert list(ports.timeout_s) == list(ports.vesc)
    assert all(0.2 < seconds < 0.3 for seconds in ports.timeout_s.values())
