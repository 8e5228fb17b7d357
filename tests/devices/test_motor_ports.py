"""Controllers by name: swapped, unplugged, two of one name, small devices and mute ports, in virtual time."""

from collections.abc import Callable, Sequence

import pytest

from snr_sim.devices.emulated.vesc_plant import VescPlant
from snr_sim.devices.motors.handshake import FIRMWARE_S, TRIES, TRY_S
from snr_sim.devices.motors.motor_ports import AGAIN_S, MotorPorts
from snr_sim.devices.motors.port_watch import PERIOD_S, PortWatch
from snr_sim.devices.wire import vesc_messages as vesc
from snr_sim.devices.wire.json_frames import encode_frame
from snr_sim.devices.wire.serial_port import BytePort, PortInfo
from snr_sim.devices.wire.vesc_frames import encode
from snr_sim.prelude.errors import DeviceError
from snr_sim.prelude.ground_signals import MotorReading
from snr_sim.testing.fakes import FakePlant

NAMES = ("motor_LF", "motor_LM", "motor_LB")
STEP_S = 0.02


def named(name: str) -> bytes:
    return encode(vesc.VescCodec("seed", 1.0).encode(vesc.Subscription(name)))


class Line:
    """Port of a device that answers everything alike, or nothing, or is gone."""

    def __init__(self, bench: "Bench", path: str, answer: bytes) -> None:
        self.name, self.bench, self.answer = path, bench, answer
        self.waiting, self.is_open, self.writes = b"", True, 0

    def write(self, data: bytes) -> None:
        self.check()
        self.writes += 1
        self.waiting += self.answer

    def read(self) -> bytes:
        self.check()
        data, self.waiting = self.waiting, b""
        return data

    def wait(self, seconds: float) -> bool:
        self.bench.time_s += seconds
        return bool(self.waiting)

    def close(self) -> None:
        self.is_open = False

    def check(self) -> None:
        if not self.is_open:
            raise DeviceError(f"{self.name} is gone.")


class Bench:
    """Ports whose devices a test plugs in and out by socket: what each answers to any question."""

    def __init__(self, **answers: bytes) -> None:
        self.time_s, self.answers, self.lines = 0.0, answers, list[Line]()
        self.ports = MotorPorts(PortWatch(self.list_ports), self.open_path, lambda: self.time_s)

    def list_ports(self) -> list[PortInfo]:
        return [PortInfo(f"/dev/{socket}", usb_path=socket) for socket in self.answers]

    def open_path(self, path: str) -> BytePort:
        line = Line(self, path, self.answers[path.removeprefix("/dev/")])
        self.lines.append(line)
        return line

    def poll(self, seconds: float) -> dict[str, str]:
        lost: dict[str, str] = {}
        for _ in range(round(seconds / STEP_S)):
            self.time_s += STEP_S
            lost |= self.ports.poll()
        return lost

    def error(self, name: str) -> str:
        with pytest.raises(DeviceError) as caught:
            self.ports.open_port(name)
        return caught.value.message


def test_five_mute_ports_take_as_long_as_one() -> None:
    bench = Bench(**{f"s{i}": b"" for i in range(5)})
    assert "No controller says it is 'motor_LF'. Other ports: usb-s0 sends nothing; usb-s1" in bench.error("motor_LF")
    questions = TRIES + 1
    assert bench.time_s == pytest.approx(TRIES * TRY_S + FIRMWARE_S, abs=questions * STEP_S)
    assert {line.writes for line in bench.lines} == {questions}


def test_name_that_answers_is_opened_without_waiting_for_mute_ports() -> None:
    bench = Bench(s0=b"", s1=named("motor_LF"))
    assert bench.ports.open_port("motor_LF").name == "/dev/s1"
    assert bench.time_s == 0.0


def test_names_are_waited_for_while_ports_are_asked_and_for_two_seconds_in_all() -> None:
    bench = Bench(s0=b"")
    bench.error("motor_LF")
    for i in range(3):
        bench.answers[f"t{i}"] = b""
        bench.time_s += PERIOD_S
        assert f"usb-t{i} " in bench.error("motor_LM")
    assert bench.time_s == pytest.approx(2.0 + 3 * PERIOD_S)
    assert "usb-t2 is being asked for its name" in bench.error("motor_LM")


def test_name_that_answers_later_than_another_is_waited_for() -> None:
    bench = Bench(s0=named("motor_LF"), s1=b"")
    assert bench.ports.open_port("motor_LF").name == "/dev/s0"
    late = bench.lines[1]
    late.answer = named("motor_LM")  # from its second question on
    assert bench.ports.open_port("motor_LM") is late
    assert bench.time_s == pytest.approx(TRY_S, abs=2 * STEP_S)


def test_mute_port_is_asked_again_after_half_a_minute_or_when_it_is_replugged() -> None:
    bench = Bench(s0=b"")
    bench.poll(AGAIN_S - STEP_S)
    bench.answers["s0"] = named("motor_LF")
    assert [line.writes for line in bench.lines] == [TRIES + 1]
    bench.poll(4 * STEP_S)
    assert bench.ports.open_port("motor_LF") is bench.lines[1]
    replugged = Bench(s0=b"")
    replugged.poll(5.0)
    del replugged.answers["s0"]
    replugged.poll(PERIOD_S + STEP_S)
    replugged.answers["s0"] = named("motor_LF")
    replugged.poll(PERIOD_S + STEP_S)
    assert replugged.ports.open_port("motor_LF") is replugged.lines[1]


def test_two_controllers_of_one_name_are_stated_and_neither_is_opened() -> None:
    bench = Bench(s0=named("motor_LM"), s1=named("motor_LM"))
    both = "Controllers on usb-s0 and usb-s1 both say they are 'motor_LM'. Neither is driven."
    assert bench.error("motor_LM") == both
    del bench.answers["s0"]
    assert bench.poll(PERIOD_S + STEP_S) == {}, "it was not in use"
    assert bench.ports.open_port("motor_LM").name == "/dev/s1"


def test_namesake_that_is_plugged_in_takes_the_first_one_out_of_use() -> None:
    bench = Bench(s0=named("motor_LM"))
    first = bench.ports.open_port("motor_LM")
    bench.answers["s1"] = named("motor_LM")
    both = "Controllers on usb-s0 and usb-s1 both say they are 'motor_LM'. Neither is driven."
    assert bench.poll(2.0) == {"motor_LM": both}
    first.close()
    assert bench.poll(2.0) == {}, "it was reported once"
    assert bench.error("motor_LM") == both
    del bench.answers["s1"]
    bench.poll(PERIOD_S + STEP_S)
    assert bench.ports.open_port("motor_LM").name == "/dev/s0"


def test_port_in_use_that_is_unplugged_is_reported_by_the_name() -> None:
    bench = Bench(s0=named("motor_LF"), s1=named("motor_LM"))
    bench.ports.open_port("motor_LF")
    bench.answers.clear()
    assert bench.poll(2.0) == {"motor_LF": "The controller of motor_LF was unplugged from usb-s0."}
    assert bench.error("motor_LF") == "No controller says it is 'motor_LF'."


def test_small_device_is_left_to_its_driver() -> None:
    bench = Bench(s0=encode_frame({"name": "motor_LF"}))
    assert "usb-s0 is 'motor_LF', which is not a motor controller" in bench.error("motor_LF")
    bench.poll(3 * AGAIN_S)
    assert [(line.writes, line.is_open) for line in bench.lines] == [(1, False)]


def test_port_that_cannot_be_opened_or_used_is_stated_with_the_reason() -> None:
    bench = Bench(s0=b"", s1=b"")
    opened = bench.open_path

    def open_path(path: str) -> BytePort:
        if path == "/dev/s0":
            raise DeviceError("/dev/s0 is busy.")
        line = opened(path)
        line.close()
        return line

    bench.ports._open_path = open_path
    assert bench.error("motor_LF").endswith(
        "usb-s0 cannot be opened: /dev/s0 is busy.; usb-s1 cannot be used: /dev/s1 is gone.."
    )


class PlantBench:
    """The bus of emulated controllers, whose handshakes take no time."""

    def __init__(self) -> None:
        state = MotorReading(3.0, 1.5, 0.5, 0.25, 24.0, 7.0, 0.0)
        self.plant = VescPlant(FakePlant(dict.fromkeys(NAMES, state), NAMES), NAMES, 228.0, dialect="seed")
        self.ports = MotorPorts(PortWatch(self.plant.list_ports), self.plant.open_port, lambda: self.plant.time_s)

    def opened(self, names: Sequence[str] = NAMES) -> dict[str, str]:
        """Return the device files of the names."""
        return {name: self.ports.open_port(name).name for name in names}

    def swap(self, *at: Callable[[], object]) -> None:
        """Swap the plugs of two controllers, and do something after each step."""
        first, second = NAMES[:2]
        steps = (
            lambda: (self.plant.unplug(first), self.plant.unplug(second)),
            lambda: (self.plant.plug_in(second, first), self.plant.plug_in(first, second)),
        )
        for step, do in zip(steps, at, strict=True):
            step()
            self.plant.step(PERIOD_S)
            do()


def test_swapped_controllers_keep_their_names() -> None:
    bench, lost = PlantBench(), list[dict[str, str]]()
    assert bench.opened() == {name: f"/dev/ttyACM{i}" for i, name in enumerate(NAMES)}
    bench.swap(lambda: lost.append(bench.ports.poll()), lambda: lost.append(bench.ports.poll()))
    assert [sorted(names) for names in lost] == [sorted(NAMES[:2]), []]
    assert bench.opened(NAMES[:2]) == {"motor_LF": "/dev/ttyACM1", "motor_LM": "/dev/ttyACM0"}


def test_controllers_that_were_swapped_between_two_lists_keep_their_names() -> None:
    bench = PlantBench()
    bench.opened()
    bench.plant.unplug("motor_LF")
    bench.plant.unplug("motor_LM")
    bench.plant.plug_in("motor_LM", "motor_LF")
    bench.plant.plug_in("motor_LF", "motor_LM")
    found: dict[str, str] = {}
    for _ in range(2):  # as the lines do that have lost their ports
        for name in NAMES[:2]:
            try:
                found[name] = bench.ports.open_port(name).name
            except DeviceError:
                continue
    assert found == {"motor_LF": "/dev/ttyACM1", "motor_LM": "/dev/ttyACM0"}
    assert bench.ports.poll() == {}
