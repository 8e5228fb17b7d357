"""The emulated motor controller with a driver's bytes: commands, answers, its timeout, and each scripted fault."""

import math
import random
from typing import Any

import pytest

from snr_sim.devices.emulated.emulated_vesc import EmulatedVesc, ScriptedFault
from snr_sim.devices.wire import vesc_messages as vesc
from snr_sim.devices.wire.vesc_frames import VescFrames, encode
from snr_sim.prelude.errors import DeviceError
from snr_sim.prelude.ground_signals import NEUTRAL_BRAKE_A, DriveMode, MotorReading

ERPM_PER_RPM = 228.0
STEP_S = 0.01
CHIP_OF_WHEEL = 12


class BenchMotor:
    """A wheel off the ground: inertia and friction, driven by a torque for each ampere or by a speed loop."""

    NM_PER_A, KGM2, FRICTION_NMS = 1.0, 0.05, 0.02

    def __init__(self) -> None:
        self.commands: list[tuple[DriveMode, float]] = []
        self.speed_radps = self.turned_rad = self.current_a = 0.0

    def drive(self, mode: DriveMode, value: float) -> None:
        self.commands.append((mode, value))

    def read(self) -> MotorReading:
        return MotorReading(self.speed_radps, self.current_a, 0.5, 0.25, 24.0, self.turned_rad, 0.0)

    def step(self, dt_s: float) -> None:
        mode, value = self.commands[-1]
        if mode == "speed":
            self.current_a = max(-10.0, min(10.0, 5.0 * (value - self.speed_radps)))
        elif mode == "brake":  # never past standstill
            limit_a = abs(self.speed_radps) * self.KGM2 / self.NM_PER_A / dt_s
            self.current_a = -math.copysign(min(value, limit_a), self.speed_radps)
        else:
            self.current_a = value if mode == "current" else 0.0
        torque_nm = self.current_a * self.NM_PER_A - self.FRICTION_NMS * self.speed_radps
        self.speed_radps += torque_nm / self.KGM2 * dt_s
        self.turned_rad += self.speed_radps * dt_s


class Bench:
    """A driver's end of the line, and the time."""

    def __init__(self, dialect: vesc.Dialect = "stock", firmware: str = "5.3", *faults: ScriptedFault) -> None:
        self.motor = BenchMotor()
        self.far = EmulatedVesc(self.motor, "wheelLF", ERPM_PER_RPM, dialect, firmware, faults=faults)
        self.codec = vesc.VescCodec(dialect, ERPM_PER_RPM)
        self.frames = VescFrames()
        self.time_s = 0.0
        self.raw = b""

    def send(self, *messages: Any) -> list[Any]:
        """Return what the controller answers at once."""
        data = b"".join(encode(self.codec.encode(message)) for message in messages)
        return self._receive(self.far.feed(data, self.time_s))

    def wait(self, seconds: float) -> list[Any]:
        answers = []
        for _ in range(round(seconds / STEP_S)):
            self.motor.step(STEP_S)
            self.time_s = round(self.time_s + STEP_S, 9)
            answers += self._receive(self.far.tick(self.time_s))
        return answers

    def _receive(self, data: bytes) -> list[Any]:
        self.raw += data
        return [self.codec.decode(payload) for payload in self.frames.feed(data, self.time_s)]

    def introduce(self) -> "Bench":
        [firmware] = self.send(vesc.GetFirmware())
        self.codec.set_firmware(firmware, "wheelLF")
        return self


def test_emulated_vesc_drives_wheel_and_reports_its_state() -> None:
    bench = Bench().introduce()
    for _ in range(100):
        bench.send(vesc.SetSpeed(6.0))
        bench.wait(0.02)
    [values] = bench.send(vesc.GetValues())
    assert values.speed_radps == pytest.approx(bench.motor.speed_radps, abs=1.0 / 200.0)  # a whole turn of the field
    assert values.speed_radps == pytest.approx(6.0, rel=0.01)
    assert values.turned_rad == pytest.approx(bench.motor.turned_rad, abs=1e-2)
    assert (values.voltage_v, values.fault) == (24.0, "none")


@pytest.mark.parametrize(
    ("message", "command"),
    [
        (vesc.SetDuty(0.25), ("duty", 0.25)),
        (vesc.SetCurrent(-3.0), ("current", -3.0)),
        (vesc.SetBrake(2.0), ("brake", 2.0)),
        (vesc.SetHandbrake(2.5), ("brake", 2.5)),
        (vesc.SetSpeed(0.0), ("speed", 0.0)),
    ],
)
def test_emulated_vesc_follows_each_command(message: Any, command: tuple[str, float]) -> None:
    bench = Bench()
    assert bench.send(message) == []
    assert bench.motor.commands == [command]


def test_emulated_vesc_brakes_after_its_timeout_and_stops_the_wheel() -> None:
    bench = Bench().introduce()
    assert bench.motor.commands == [("brake", NEUTRAL_BRAKE_A)]
    bench.send(vesc.SetCurrent(2.0))
    bench.wait(0.25)
    assert bench.motor.commands[-1] == ("current", 2.0)
    assert bench.motor.speed_radps > 5.0
    bench.wait(0.01)
    assert bench.motor.commands[-1] == ("brake", NEUTRAL_BRAKE_A)
    bench.wait(0.5)
    assert bench.motor.speed_radps == pytest.approx(0.0, abs=1e-9)


def test_emulated_vesc_questions_do_not_extend_the_timeout_as_alive_does() -> None:
    bench = Bench().introduce()
    bench.send(vesc.SetCurrent(1.0))
    for _ in range(3):
        bench.wait(0.2)
        bench.send(vesc.Alive())
    assert bench.motor.commands[-1] == ("current", 1.0)
    for _ in range(3):
        bench.wait(0.1)
        bench.send(vesc.GetValues(), vesc.GetFirmware())
    assert bench.motor.commands[-1] == ("brake", NEUTRAL_BRAKE_A)


def test_emulated_vesc_of_seed_dialect_answers_handshake() -> None:
    bench = Bench("seed", "2.18")
    assert bench.send(vesc.Subscription("t")) == [vesc.Subscription("wheelLF")]
    bench.motor.turned_rad = 2.5 * math.pi
    [position] = bench.send(vesc.GetRotorPosition())
    assert position.position_rad == pytest.approx(0.5 * math.pi, abs=1e-6)
    [values] = bench.send(vesc.GetValues())
    assert values.temperature_c == 25.0


def test_emulated_vesc_with_unknown_firmware_reports_version_and_no_values() -> None:
    bench = Bench("stock", "7.1")
    with pytest.raises(DeviceError, match=r"firmware 7\.1"):
        bench.introduce()
    assert bench.send(vesc.GetValues()) == []
    assert bench.far.ignored == 1


def test_emulated_vesc_chips_of_two_names_differ_and_stay() -> None:
    [one], [same] = Bench().send(vesc.GetFirmware()), Bench().send(vesc.GetFirmware())
    [other] = Bench("stock", "5.3", ScriptedFault("wrong_name", 0.0, 1.0, text="wheelRF")).send(vesc.GetFirmware())
    assert one == same
    assert (len(one.chip), one.chip != other.chip) == (CHIP_OF_WHEEL, True)


def test_emulated_vesc_of_wrong_name_answers_with_it_while_it_lasts() -> None:
    bench = Bench("seed", "2.18", ScriptedFault("wrong_name", 0.0, 0.1, text="wheelRF"))
    assert bench.send(vesc.Subscription("t")) == [vesc.Subscription("wheelRF")]
    bench.wait(0.1)
    assert bench.send(vesc.Subscription("t")) == [vesc.Subscription("wheelLF")]


def test_emulated_vesc_mute_follows_commands_and_sends_nothing() -> None:
    bench = Bench("stock", "5.3", ScriptedFault("mute", 0.1, 0.3)).introduce()
    bench.wait(0.1)
    assert bench.send(vesc.SetCurrent(1.0), vesc.GetValues()) == []
    assert bench.motor.commands[-1] == ("current", 1.0)
    bench.wait(0.2)
    assert len(bench.send(vesc.GetValues())) == 1


def test_emulated_vesc_garbage_is_sent_and_is_not_a_frame() -> None:
    bench = Bench("stock", "5.3", ScriptedFault("garbage", 0.1, 0.3)).introduce()
    bench.wait(0.1)
    before = len(bench.raw)
    assert bench.send(vesc.GetValues()) == []
    assert len(bench.raw) > before
    bench.wait(0.2)
    assert len(bench.send(vesc.GetValues())) == 1


def test_emulated_vesc_slow_answers_later_in_order() -> None:
    bench = Bench("stock", "5.3", ScriptedFault("slow", 0.1, 0.2, delay_s=0.05)).introduce()
    bench.wait(0.1)
    assert bench.send(vesc.GetValues(), vesc.GetFirmware()) == []
    assert bench.wait(0.04) == []
    assert [type(answer) for answer in bench.wait(0.02)] == [vesc.MotorValues, vesc.Firmware]


def test_emulated_vesc_brown_out_frees_the_motor_and_forgets_the_command() -> None:
    bench = Bench("stock", "5.3", ScriptedFault("brown_out", 0.1, 0.15)).introduce()
    bench.wait(0.09)
    bench.send(vesc.SetCurrent(1.0))
    bench.wait(0.02)
    assert bench.motor.commands[-1] == ("off", 0.0)
    assert bench.send(vesc.SetCurrent(1.0), vesc.GetFirmware()) == []
    bench.wait(0.05)
    assert bench.motor.commands[-1] == ("brake", NEUTRAL_BRAKE_A)
    bench.send(vesc.SetCurrent(1.0))
    assert bench.motor.commands[-1] == ("current", 1.0)


def test_emulated_vesc_motor_fault_frees_the_motor_and_is_reported() -> None:
    bench = Bench("stock", "5.3", ScriptedFault("motor", 0.1, 0.2, text="over_current")).introduce()
    bench.wait(0.1)
    bench.send(vesc.SetCurrent(1.0))
    [values] = bench.send(vesc.GetValues())
    assert (values.fault, bench.motor.commands[-1]) == ("over_current", ("off", 0.0))
    bench.wait(0.1)
    assert bench.motor.commands[-1] == ("current", 1.0)  # it is still fresh


def test_emulated_vesc_random_bytes_move_nothing_and_next_command_does() -> None:
    bench, chance = Bench(), random.Random(3)
    for _ in range(200):
        bench.far.feed(chance.randbytes(200), bench.time_s)
        bench.time_s += STEP_S
    assert bench.motor.commands == [("brake", NEUTRAL_BRAKE_A)]
    bench.time_s += 0.1  # a pause, as after any damaged stream
    bench.send(vesc.SetCurrent(1.0))
    assert bench.motor.commands[-1] == ("current", 1.0)


def test_emulated_vesc_same_bytes_and_times_give_same_answers() -> None:
    def answers() -> bytes:
        bench = Bench("stock", "5.3", ScriptedFault("slow", 0.2, 0.4, delay_s=0.03)).introduce()
        for i in range(50):
            bench.send(vesc.SetSpeed(0.1 * i), vesc.GetValues())
            bench.wait(0.02)
        return bench.raw

    assert answers() == answers() != b""
