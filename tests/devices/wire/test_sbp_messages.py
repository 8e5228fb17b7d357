"""Messages of a Piksi: bytes that the maker's package made, flags of both generations, and what is impossible."""

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from snr_sim.devices.wire.sbp_frames import SbpFrame, SbpFrames, encode
from snr_sim.devices.wire.sbp_messages import Dops, Heartbeat, PosLlh, VelNed, decode

# Made by the package `sbp` 6.5.2.
PLACE = "bc cc 5b 07 1b 2f dd 24 06 11 4a 40 aa f1 d2 4d 62 a8 5a c0 00 00 00 00 00 24 7e 40"
POSITION = f"55 0a 02 bf 88 22 {PLACE} 3a 07 5c 12 09 01 97 52"
OLDER_POSITION = f"55 01 02 bf 88 22 {PLACE} 00 00 00 00 09 08 61 54"
VELOCITY = "55 0e 02 bf 88 16 bc cc 5b 07 dc 05 00 00 30 f8 ff ff 03 00 00 00 01 00 02 00 09 01 78 4e"
OLDER_VELOCITY = "55 05 02 bf 88 16 bc cc 5b 07 dc 05 00 00 30 f8 ff ff 03 00 00 00 01 00 02 00 09 00 c3 ca"
PRECISION = "55 08 02 bf 88 0f 58 cc 5b 07 01 00 02 00 03 00 7d 00 05 00 01 b9 56"
HEARTBEAT = "55 ff ff bf 88 04 00 00 00 00 8b 30"
TOW_S = 123456.7


def position(
    kind: int = 0x020A, latitude: float = 52.0, longitude: float = -106.0, flags: int = 1, *, height: float = 0.0
) -> SbpFrame:
    return SbpFrame(kind, struct.pack("<IdddHHBB", 1000, latitude, longitude, height, 0, 0, 9, flags))


@pytest.mark.parametrize(
    ("raw", "message"),
    [
        (POSITION, PosLlh(TOW_S, 52.133, -106.631, 482.25, False, 9, True)),
        (OLDER_POSITION, PosLlh(TOW_S, 52.133, -106.631, 482.25, True, 9, True)),
        (VELOCITY, VelNed(TOW_S, 1.5, -2.0, True)),
        (OLDER_VELOCITY, VelNed(TOW_S, 1.5, -2.0, True)),
        (PRECISION, Dops(123456.6, 1.25)),
        (HEARTBEAT, Heartbeat()),
    ],
)
def test_sbp_decode_reads_bytes_of_the_maker(raw: str, message: object) -> None:
    [frame] = SbpFrames().feed(bytes.fromhex(raw), 0.0)
    assert decode(frame) == message


@pytest.mark.parametrize(
    ("kind", "fixes"),
    [
        (0x020A, [False, True, True, True, True, False, True, False]),
        (0x0201, [True] * 8),  # 0: single point, 1: fixed, 2: float; without a fix it is not sent
    ],
)
def test_sbp_position_has_fix_by_the_flags_of_its_generation(kind: int, fixes: list[bool]) -> None:
    messages = [decode(position(kind, flags=mode)) for mode in range(8)]
    assert [isinstance(message, PosLlh) and message.has_fix for message in messages] == fixes


def test_sbp_velocity_of_mode_0_is_invalid_in_the_newer_message_only() -> None:
    payload = bytes.fromhex(VELOCITY)[6:-3] + b"\0"
    newer, older = decode(SbpFrame(0x020E, payload)), decode(SbpFrame(0x0205, payload))
    assert isinstance(newer, VelNed)
    assert isinstance(older, VelNed)
    assert (newer.is_valid, older.is_valid) == (False, True)


@pytest.mark.parametrize(
    "frame",
    [
        position(latitude=90.1),
        position(latitude=math.nan),
        position(longitude=-180.1),
        position(longitude=math.inf),
        position(0x0201, height=math.nan),
        SbpFrame(0x020A, bytes(33)),
        SbpFrame(0x0208, b""),
        SbpFrame(0x0102, bytes(11)),
    ],
)
def test_sbp_decode_impossible_position_or_length_or_unknown_type_returns_none(frame: SbpFrame) -> None:
    assert decode(frame) is None


@given(st.sampled_from([0x020A, 0x0201, 0x020E, 0x0205, 0x0208, 0xFFFF]), st.binary(max_size=40))
def test_sbp_decode_any_payload_raises_nothing(kind: int, payload: bytes) -> None:
    message = decode(SbpFrame(kind, payload))
    assert not isinstance(message, PosLlh) or abs(message.latitude_deg) <= 90.0


@pytest.mark.nightly
@given(
    st.integers(0, 604_800_000), st.floats(-90, 90), st.floats(-180, 180), st.floats(-1e4, 1e4), st.integers(0, 40),
    st.integers(-100_000, 100_000), st.integers(-100_000, 100_000), st.integers(0, 65535),
)  # fmt: skip
def test_sbp_messages_equal_those_of_the_maker(
    tow: int, lat: float, lon: float, height: float, satellites: int, north: int, east: int, hdop: int
) -> None:
    theirs = pytest.importorskip(
        "sbp.navigation", reason="the maker's package is missing: pip install 'snr_sim[peers]'"
    )
    position = theirs.MsgPosLLH(
        tow=tow, lat=lat, lon=lon, height=height, h_accuracy=1, v_accuracy=2, n_sats=satellites, flags=4
    )
    velocity = theirs.MsgVelNED(tow=tow, n=north, e=east, d=1, h_accuracy=1, v_accuracy=2, n_sats=satellites, flags=1)
    precision = theirs.MsgDops(tow=tow, gdop=1, pdop=2, tdop=3, hdop=hdop, vdop=4, flags=0)
    raw = b"".join(message.to_binary() for message in (position, velocity, precision))
    frames = SbpFrames().feed(raw, 0.0)
    assert b"".join(map(encode, frames)) == raw
    assert list(map(decode, frames)) == [
        PosLlh(tow * 1e-3, lat, lon, height, False, satellites, True),
        VelNed(tow * 1e-3, north * 1e-3, east * 1e-3, True),
        Dops(tow * 1e-3, hdop * 0.01),
    ]
