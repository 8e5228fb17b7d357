"""Ports that come and go: their identities, what is left alone, and how often they are listed."""

from hypothesis import given
from hypothesis import strategies as st

from snr_sim.devices.motors.port_watch import PERIOD_S, PortChanges, PortWatch
from snr_sim.devices.wire.serial_port import PortInfo
from snr_sim.prelude.errors import DeviceError

LEFT = PortInfo("/dev/ttyUSB0", "adapter", "A1", "1-1.2")
RIGHT = PortInfo("/dev/ttyUSB1", "adapter", "B2", "1-1.4")
PLAIN = PortInfo("/dev/ttyUSB2")
NO_CHANGES = PortChanges()


class Bench:
    """A watch over ports that a test sets."""

    def __init__(self, *ports: PortInfo, others: tuple[str, ...] = ()) -> None:
        self.ports, self.lists, self.time_s = list(ports), 0, 10.0
        self.watch = PortWatch(self.list_ports, others)

    def list_ports(self) -> list[PortInfo]:
        self.lists += 1
        return list(self.ports)

    def next(self, *ports: PortInfo) -> PortChanges:
        """Return the changes after a period, when these ports are there."""
        self.ports, self.time_s = list(ports), self.time_s + PERIOD_S
        return self.watch.poll(self.time_s)


def test_ports_appear_by_serial_number_else_usb_path_else_path() -> None:
    on_hub = PortInfo("/dev/ttyACM0", "board", "", "1-1.3")
    bench = Bench(LEFT, on_hub, PLAIN)
    assert bench.watch.poll(0.0) == PortChanges({"A1": LEFT, "1-1.3": on_hub, "/dev/ttyUSB2": PLAIN})
    assert bench.watch.poll(PERIOD_S) == NO_CHANGES


def test_port_that_is_unplugged_is_gone_by_the_same_identity() -> None:
    bench = Bench()
    bench.next(LEFT, RIGHT)
    assert bench.next(RIGHT) == PortChanges(gone=("A1",))
    assert bench.next(RIGHT) == NO_CHANGES
    assert bench.next(LEFT, RIGHT) == PortChanges({"A1": LEFT})


def test_device_file_that_is_another_device_now_is_gone_and_has_appeared() -> None:
    bench = Bench()
    bench.next(LEFT, RIGHT)
    first, second = RIGHT._replace(path=LEFT.path), LEFT._replace(path=RIGHT.path)
    assert bench.next(first, second) == PortChanges({"B2": first, "A1": second}, gone=("A1", "B2"))


def test_device_in_another_socket_between_two_lists_is_gone_and_has_appeared() -> None:
    bench = Bench()
    bench.next(LEFT)
    moved = LEFT._replace(usb_path="1-1.3")
    assert bench.next(moved) == PortChanges({"A1": moved}, gone=("A1",))


def test_devices_of_one_serial_number_have_their_usb_paths_and_keep_them() -> None:
    bench = Bench()
    twin = PortInfo("/dev/ttyUSB1", "adapter", "A1", "1-1.4")
    assert bench.next(LEFT).appeared == {"A1": LEFT}
    assert bench.next(LEFT, twin) == PortChanges({"1-1.4": twin})
    assert bench.next(twin) == PortChanges(gone=("A1",))
    assert bench.next(twin) == NO_CHANGES


def test_consoles_and_ports_of_others_are_left_alone() -> None:
    consoles = [PortInfo("/dev/ttyS0"), PortInfo("/dev/ttyAMA10")]
    gps, sonar, imu = (PortInfo(f"/dev/ttyUSB{i}", "", f"S{i}", f"1-1.{i}") for i in range(3, 6))
    bench = Bench(others=("/dev/ttyUSB3", "S4", "1-1.5"))
    assert bench.next(*consoles, gps, sonar, imu, LEFT).appeared == {"A1": LEFT}


def test_ports_are_listed_once_a_period() -> None:
    bench = Bench(LEFT)
    for i in range(101):
        bench.watch.poll(0.01 * i)
    assert bench.lists == 3


def test_list_that_fails_changes_nothing() -> None:
    bench = Bench()
    bench.next(LEFT)
    working = bench.watch._list_ports

    def fail() -> list[PortInfo]:
        raise DeviceError("The serial ports cannot be listed.")

    bench.watch._list_ports = fail
    assert bench.next(LEFT) == NO_CHANGES
    bench.watch._list_ports = working
    assert bench.next(LEFT) == NO_CHANGES


SOCKETS = st.dictionaries(st.integers(0, 3), st.sampled_from(["", "A1", "B2", "C3"]), max_size=4)


@given(st.lists(SOCKETS, max_size=8))
def test_ports_that_are_there_are_always_those_that_appeared_and_are_not_gone(moments: list[dict[int, str]]) -> None:
    bench, there = Bench(), {}
    for plugged in moments:
        # Device files are given out in the order of the sockets, so that they change all the time.
        ports = [
            PortInfo(f"/dev/ttyUSB{i}", "", plugged[socket], f"1-1.{socket}")
            for i, socket in enumerate(sorted(plugged))
        ]
        changes = bench.next(*ports)
        for identity in changes.gone:
            del there[identity]
        assert there.keys().isdisjoint(changes.appeared)
        there.update(changes.appeared)
        assert sorted(there.values()) == sorted(ports)
