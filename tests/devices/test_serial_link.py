"""Whole frames over a wire that loses, spoils and cuts."""

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from snr_sim.devices.mcu.serial_link import MOST_BYTES, NumberedFrames
from snr_sim.prelude.device import SerialLink
from snr_sim.prelude.errors import CommandError, DeviceError


class Wire:
    """Both ends of a port in one: what is written can be read, once the test has passed it on."""

    name = "wire"

    def __init__(self) -> None:
        self.sent = b""
        self.come = b""

    def write(self, data: bytes) -> None:
        self.sent += data

    def read(self) -> bytes:
        come, self.come = self.come, b""
        return come

    def wait(self, seconds: float) -> bool:
        return bool(self.come)

    def close(self) -> None:
        pass


def ends() -> tuple[NumberedFrames, Wire, NumberedFrames, Wire]:
    here, there = Wire(), Wire()
    return NumberedFrames(here), here, NumberedFrames(there), there


@given(st.lists(st.binary(max_size=MOST_BYTES), max_size=20), st.integers(1, 40))
def test_frames_arrive_whole_and_in_order_however_the_bytes_are_cut(frames: list[bytes], cut: int) -> None:
    link, wire, far, far_wire = ends()
    assert isinstance(link, SerialLink)
    for frame in frames:
        link.send(frame)
    got = []
    for i in range(0, len(wire.sent), cut):
        far_wire.come = wire.sent[i : i + cut]
        got += far.poll()
    assert got == frames
    assert far.counts() == {"bytes": len(wire.sent), "frames": len(frames), "crc_errors": 0, "gaps": 0}


def test_what_was_lost_and_what_was_spoilt_is_counted() -> None:
    link, wire, far, far_wire = ends()
    pieces = []
    for i in range(300):  # the number begins anew meanwhile
        link.send(bytes([i % 251] * 5))
        pieces.append(wire.sent)
        wire.sent = b""
    del pieces[270:273], pieces[10]
    pieces[100] = bytes([pieces[100][0], pieces[100][1] ^ 0x55, *pieces[100][2:]])
    far_wire.come = b"".join(pieces)
    assert len(far.poll()) == 295
    assert far.counts()["crc_errors"] == 1
    assert far.counts()["gaps"] == 5


def test_noise_is_no_frame_and_takes_no_room() -> None:
    _, _, far, far_wire = ends()
    noise = random.Random(0)
    for _ in range(100):
        far_wire.come = noise.randbytes(1000).replace(b"\0", b"\1")
        assert far.poll() == []
    assert far.counts() == {"bytes": 100_000, "frames": 0, "crc_errors": 1, "gaps": 0}


def test_a_frame_that_is_too_long_is_refused_and_a_wire_that_is_gone_is_told() -> None:
    link, wire, _, _ = ends()
    with pytest.raises(CommandError, match="A frame of 251 bytes"):
        link.send(bytes(251))
    assert wire.sent == b""

    class Gone(Wire):
        def write(self, data: bytes) -> None:
            raise DeviceError("wire is gone.")

        def read(self) -> bytes:
            raise DeviceError("wire is gone.")

    gone = NumberedFrames(Gone())
    for use in (gone.poll, lambda: gone.send(b"")):
        with pytest.raises(DeviceError, match="is gone"):
            use()
