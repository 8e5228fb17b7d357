"""The device at the other end of a port: each possible answer, and the whole message about it."""

from collections.abc import Callable

import msgspec
import pytest

from snr_sim.devices.mcu.mcu_greeting import greet
from snr_sim.devices.wire.mcu_frames import McuFrames, encode
from snr_sim.devices.wire.mcu_messages import (
    TYPE_OF,
    Answer,
    Fault,
    FromMcu,
    Hello,
    Ident,
    ResetCause,
    Result,
    State,
    Telemetry,
)
from snr_sim.prelude.errors import DeviceError

STEP_S = 0.01
SESSION = 7
IDENT = Ident(
    0, SESSION, 1, (1, 0), 8, 1100.0, 1500.0, 1900.0, 25.0, 500, 8000, 200, 1500, 400, 50, "atmega328p", "snr_sim esc"
)
TELEMETRY = Telemetry(1, 0, 0, 50, State.STARTING, Fault(0), ResetCause.EXTERNAL, 0xFFFF, 0, 1345, 330, (1500.0,) * 8)


class FarEnd:
    """A port whose other end sends the result of a function of the time; time passes while it is waited for."""

    name = "/dev/ttyUSB0"

    def __init__(self, says: Callable[[float, list[bytes]], bytes]) -> None:
        self.says, self.time_s = says, 0.0
        self.heard: list[bytes] = []

    def write(self, data: bytes) -> None:
        self.heard.append(data)

    def read(self) -> bytes:
        return self.says(self.time_s, self.heard)

    def wait(self, seconds: float) -> bool:
        self.time_s += min(seconds, STEP_S) + 1e-9
        return True

    def close(self) -> None:
        pass

    def now_s(self) -> float:
        return self.time_s


def meet(says: Callable[[float, list[bytes]], bytes], patience_s: float = 3.0) -> tuple[Ident, list[FromMcu], FarEnd]:
    port = FarEnd(says)
    ident, after = greet(port, McuFrames(), SESSION, patience_s, port.now_s)
    return ident, after, port


def told(says: Callable[[float, list[bytes]], bytes]) -> str:
    with pytest.raises(DeviceError) as caught:
        meet(says)
    return str(caught.value)


def heard_at(data: bytes, sent_baud: int, heard_baud: int) -> bytes:
    """Return the bytes that a receiver decodes at another rate: it samples the line in the middles of its own bits."""
    line = [1] * 20
    for byte in data:
        line += [0, *(byte >> bit & 1 for bit in range(8)), 1]
    line += [1] * 40
    found, at = bytearray(), 0.0
    bit = sent_baud / heard_baud
    while at < len(line) - 12 * bit:
        if line[int(at)]:
            at += 0.25
            continue
        middles = [line[int(at + (i + 1.5) * bit)] for i in range(8)]
        found.append(sum(value << i for i, value in enumerate(middles)))
        at += 9.5 * bit
    return bytes(found)


def test_it_is_greeted_until_its_boot_loader_has_ended() -> None:
    asked: list[int] = []

    def says(t: float, heard: list[bytes]) -> bytes:
        if t < 1.7 or len(heard) == len(asked):
            return b""
        asked.extend(range(len(heard) - len(asked)))
        return (
            encode(TELEMETRY)
            + encode(msgspec.structs.replace(IDENT, nth=2))
            + encode(msgspec.structs.replace(TELEMETRY, nth=3, session=SESSION))
        )

    ident, after, port = meet(says)
    assert ident.mcu == "atmega328p"
    assert [message.session for message in after] == [SESSION], "what came after the answer"
    assert 4 <= len(port.heard) <= 5, "twice a second: some boot loaders stay as long as they hear something"
    assert set(port.heard) == {b"\0" + encode(Hello(SESSION))}
    assert port.time_s < 2.2


def test_half_frames_and_frames_of_a_session_before_are_passed_over() -> None:
    whole = encode(IDENT)
    pieces = [whole[20:], encode(msgspec.structs.replace(IDENT, session=6)), whole[:9], whole[9:]]

    def says(t: float, heard: list[bytes]) -> bytes:
        return pieces.pop(0) if pieces else b""

    assert meet(says)[0].session == SESSION
    assert pieces == []


def test_silence() -> None:
    assert told(lambda t, heard: b"") == (
        "/dev/ttyUSB0: no answer to the greeting in 3 s; not one byte came.\n"
        "  Try: is it the board's port, does the board's light shine? If so, flash the firmware that belongs to this "
        "kit: robots/urov/firmware/README.md."
    )


def test_garbage_is_shown() -> None:
    assert told(lambda t, heard: bytes([0xFE, 0x80, 0x91, 0x7F, 0xE3])) == (
        "/dev/ttyUSB0: no answer to the greeting in 3 s. What came "
        "(fe 80 91 7f e3 fe 80 91 7f e3 fe 80 91 7f e3 fe ...) is none of its frames.\n"
        "  Try: wrong baud rate, or another device; if it is the microcontroller, flash the firmware that belongs to "
        "this kit: robots/urov/firmware/README.md."
    )


@pytest.mark.parametrize("baud", [9600, 57_600, 230_400])
def test_a_wrong_baud_rate_is_among_what_is_suggested(baud: int) -> None:
    garbled = heard_at(encode(TELEMETRY) * 2, baud, 115_200)
    assert heard_at(encode(TELEMETRY), 115_200, 115_200) == encode(TELEMETRY)
    text = told(lambda t, heard: garbled)
    assert "is none of its frames" in text
    assert garbled[:16].hex(" ") in text
    assert "wrong baud rate" in text


def test_another_device_is_quoted() -> None:
    text = told(lambda t, heard: b"$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47\r\n")
    assert "Another device is there; it says '$GPGGA,123519,48' (24 47 50 47 47 41" in text
    assert "take the port of the microcontroller" in text


@pytest.mark.parametrize("protocol", [0, 2, 255])
def test_a_firmware_of_another_version_says_both_versions(protocol: int) -> None:
    other = encode(msgspec.structs.replace(IDENT, protocol=protocol, firmware=(3, 2), session=0))
    assert told(lambda t, heard: other).startswith(
        f"/dev/ttyUSB0: firmware 3.2 of 'snr_sim esc' speaks protocol {protocol}, this program protocol 1.\n"
        "  Try: flash the firmware"
    )


def test_a_firmware_that_refuses_the_protocol_is_told_as_such() -> None:
    refusal = encode(Answer(0, 0, TYPE_OF[Hello], Result.OTHER_PROTOCOL))
    assert "speaks another protocol than this program's, which is 1" in told(lambda t, heard: refusal)
    refusal = encode(Answer(0, 0, TYPE_OF[Hello], Result.OTHER_SESSION))  # of an earlier session
    assert "no answer" in told(lambda t, heard: refusal)


def test_a_wire_that_leads_one_way_only_is_told_apart_from_a_wrong_device() -> None:
    assert "though its telemetry comes" in told(lambda t, heard: encode(TELEMETRY))


def test_a_flood_of_garbage_takes_no_longer_than_the_patience_and_is_not_kept() -> None:
    flood = bytes(range(1, 256)) * 16
    port = FarEnd(lambda t, heard: flood)
    frames = McuFrames()
    with pytest.raises(DeviceError, match="none of its frames"):
        greet(port, frames, SESSION, 3.0, port.now_s)
    assert port.time_s == pytest.approx(3.0, abs=0.02)
    assert frames.overlong == 1


def test_a_wire_that_is_pulled_meanwhile_is_told() -> None:
    def gone(t: float, heard: list[bytes]) -> bytes:
        raise DeviceError("/dev/ttyUSB0 is gone: hung up.")

    assert told(gone) == "/dev/ttyUSB0 is gone: hung up."
