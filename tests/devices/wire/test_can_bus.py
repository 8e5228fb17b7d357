"""CAN buses by python-can: texts, the queue, error frames, and what is missing."""

import errno
import os
import select
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import can
import pytest

from snr_sim.devices.emulated.pty_end import PtyEnd
from snr_sim.devices.wire.can_bus import MAX_WAITING, CanBus, SendQueue
from snr_sim.devices.wire.can_messages import CanFrame
from snr_sim.prelude.errors import DeviceError, MissingExtraError, UnknownNameError

LOW, HIGH = CanFrame(0x101, b"low"), CanFrame(0x1FF, b"high")


class Pair:
    """Two ends of a virtual bus, and python-can's own at it."""

    def __init__(self, name: str) -> None:
        self.ends = [CanBus(f"can:virtual:{name}") for _ in range(2)]
        self.raw = can.Bus(interface="virtual", channel=name, ignore_config=True)

    def close(self) -> None:
        for end in self.ends:
            end.close()
            end.close()
        self.raw.shutdown()


@pytest.fixture
def pair(request: pytest.FixtureRequest) -> Iterator[Pair]:
    found = Pair(request.node.name)
    yield found
    found.close()


def test_can_bus_carries_frames_in_order_and_drops_those_of_other_kinds(pair: Pair) -> None:
    near, far = pair.ends
    frames = [CanFrame(0x1FFFFFFF, bytes(8)), CanFrame(0x12C, b"\x01", is_extended=False), CanFrame(0)]
    for frame in frames:
        near.send(frame)
    pair.raw.send(can.Message(arbitration_id=5, is_remote_frame=True))
    pair.raw.send(can.Message(arbitration_id=5, is_fd=True, data=bytes(64)))
    assert far.wait(0.0)
    assert far.receive() == frames
    assert (far.receive(), far.wait(0.0)) == ([], False)
    assert near.receive() == []


def test_can_error_frames_are_counted_and_bus_off_is_an_error(pair: Pair) -> None:
    near = pair.ends[0]
    pair.raw.send(can.Message(arbitration_id=0x20, is_error_frame=True))
    assert near.receive() == []
    assert near.counts()["errors"] == 1
    pair.raw.send(can.Message(arbitration_id=0x44, is_error_frame=True))
    with pytest.raises(DeviceError, match=r"is off: its adapter has counted too many errors(.|\n)*120 ohm"):
        near.receive()
    assert near.counts() == {"errors": 2, "bus_off": 1, "replaced": 0, "dropped": 0}


def test_commands_wait_for_a_full_bus_and_newer_ones_replace_them(pair: Pair, monkeypatch: pytest.MonkeyPatch) -> None:
    near, far = pair.ends
    full: list[Exception] = [can.CanOperationError("Transmit buffer full"), can.CanOperationError("", errno.ENOBUFS)]
    with monkeypatch.context() as patched:
        patched.setattr(near._bus, "send", lambda message, timeout: (_ for _ in ()).throw(full[0]))
        near.send(CanFrame(0x301, b"old"))
        full.reverse()
        near.send(CanFrame(0x302, b"other"))
        near.send(CanFrame(0x301, b"new"))
        near.send(CanFrame(0x201, b"stop"))  # a brake of controller 1, and so in the place of its speed
        assert far.receive() == []
    near.receive()
    assert far.receive() == [CanFrame(0x201, b"stop"), CanFrame(0x302, b"other")]
    assert near.counts() == {"errors": 0, "bus_off": 0, "replaced": 2, "dropped": 0}


def test_can_bus_that_is_gone_is_an_error(pair: Pair, monkeypatch: pytest.MonkeyPatch) -> None:
    near = pair.ends[0]

    def fail(*_arguments: Any, **_options: Any) -> None:
        raise can.CanOperationError("Failed to transmit: Network is down", errno.ENETDOWN)

    monkeypatch.setattr(near._bus, "send", fail)
    monkeypatch.setattr(near._bus, "recv", fail)
    for call in (lambda: near.send(LOW), near.receive, lambda: near.wait(0.0)):
        with pytest.raises(DeviceError, match="is gone: Failed to transmit: Network is down"):
            call()


def test_send_queue_keeps_the_lowest_ids_and_counts_what_it_drops() -> None:
    queue = SendQueue()
    frames = [CanFrame(0x10000 + i) for i in range(MAX_WAITING)]
    for frame in [HIGH, *frames[::-1], CanFrame(0x40, is_extended=False)]:
        queue.put(frame)
    assert queue.dropped == 2
    sent = []
    while (frame := queue.first()) is not None:
        sent.append(frame)
        queue.take(frame)
    assert sent == [HIGH, *frames[:-1]]  # the short id 0x40 is 0x1000000 among the long ones


@pytest.mark.parametrize("text", ["can:", "can:virtual:", "can:socketcn:can0", "serial:virtual:x", "can0"])
def test_invalid_text_of_a_can_bus_is_refused(text: str) -> None:
    with pytest.raises(UnknownNameError, match=f"'{text}' is not a CAN bus"):
        CanBus(text)


def test_error_of_a_kernel_without_can_names_the_virtual_bus(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(**_options: Any) -> None:
        raise OSError(errno.EAFNOSUPPORT, os.strerror(errno.EAFNOSUPPORT))

    monkeypatch.setattr(can, "Bus", fail)
    message = r"There is no CAN in this kernel \(AF_CAN: errno 97\)\.\n.*can:virtual:NAME here"
    with pytest.raises(DeviceError, match=message):
        CanBus("can:socketcan:can0")


@pytest.mark.parametrize("text", ["can:socketcan:no_such_bus", "can:slcan:/dev/no_such_port"])
def test_missing_can_bus_is_an_error(text: str) -> None:
    with pytest.raises(DeviceError, match=f"no CAN in this kernel|{text} cannot be opened: .*No such"):
        CanBus(text)


def test_can_bus_without_python_can_names_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "can", None)
    with pytest.raises(MissingExtraError, match=r"python-can(.|\n)*snr_sim\[can\]"):
        CanBus("can:virtual:x")


@pytest.mark.slow
def test_frames_cross_a_bus_of_the_kernel() -> None:
    if not Path("/sys/class/net/vcan0").exists():
        if os.environ.get("SNR_REQUIRE_VCAN"):
            raise RuntimeError("vcan0 is not here: modprobe vcan; ip link add vcan0 type vcan; ip link set vcan0 up")
        pytest.skip("vcan0 is not here")
    near, far = (CanBus("can:socketcan:vcan0") for _ in range(2))
    for frame in (LOW, HIGH):
        near.send(frame)
    assert far.wait(5.0)
    assert far.receive() == [LOW, HIGH]
    near.close()
    far.close()


@pytest.mark.slow
def test_frames_cross_an_adapter_at_a_serial_port(tmp_path: Path) -> None:
    adapter = PtyEnd(tmp_path / "adapter")
    bus = CanBus(f"can:slcan:{adapter.path}")
    bus.send(CanFrame(0x307, bytes.fromhex("00000881")))
    received = b""
    while not received.endswith(b"\rT00000307400000881\r") and select.select([adapter], [], [], 5.0)[0]:
        received += adapter.read()
    assert received.endswith(b"\rT00000307400000881\r")
    assert {b"S6", b"O"} <= set(received.split(b"\r"))  # 500 kbit/s, and open
    for line, frame in (
        (b"T0000090780000198300FF00FA\r", CanFrame(0x907, bytes.fromhex("0000198300FF00FA"))),
        (b"t12c101\r", CanFrame(0x12C, b"\x01", is_extended=False)),
    ):
        adapter.write(line)
        assert bus.wait(5.0)
        assert bus.receive() == [frame]
    for i, damaged in enumerate((b"T00000907800001983xx\r", b"T\r", b"\xff\r")):
        adapter.write(damaged)
        assert not bus.wait(5.0)
        assert bus.counts()["errors"] == i + 1
    adapter.write(b"t12c101\r")
    assert bus.wait(5.0)
    adapter.close()
    with pytest.raises(DeviceError, match="is gone"):
        bus.receive()
    bus.close()
