"""The device at the other end of a port: each possible answer, and the whole message about it.

A board that would not keep thrusters safe by itself is refused, with its values and the required ones.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import pytest

from snr_sim.devices.mcu.mcu import McuPwm
from snr_sim.devices.mcu.mcu_board import McuBoard
from snr_sim.devices.mcu.mcu_handshake import NAME, check_identity, handshake, incompatibilities
from snr_sim.devices.wire.mcu_frames import McuFrames, encode
from snr_sim.devices.wire.mcu_messages import (
    TYPE_OF,
    AckResult,
    Arm,
    CommandAck,
    FromMcu,
    Hello,
    Ident,
    McuFault,
    McuState,
    ResetCause,
    Telemetry,
)
from snr_sim.prelude.errors import DeviceError
from snr_sim.testing.fake_mcu import FakeMcu

FIRMWARE = Path(__file__).parents[2] / "robots/urov/firmware/esc.c"
STEP_S = 0.01
SESSION = 7
IDENT = Ident(0, SESSION, 1, (1, 0), 8, 1100.0, 1500.0, 1900.0, 25.0, 500, 8000, 200, 1500, 400, 50, "atmega328p", NAME)
TELEMETRY = Telemetry(
    1, 0, 0, 50, McuState.STARTING, McuFault(0), ResetCause.EXTERNAL, 0xFFFF, 0, 1345, 330, (1500.0,) * 8
)


class FarEnd:
    """A port whose other end sends the result of a function of the time; time passes while it is waited for."""

    name = "/dev/ttyUSB0"

    def __init__(self, reply: Callable[[float, list[bytes]], bytes]) -> None:
        self.reply, self.time_s = reply, 0.0
        self.received: list[bytes] = []

    def write(self, data: bytes) -> None:
        self.received.append(data)

    def read(self) -> bytes:
        return self.reply(self.time_s, self.received)

    def wait(self, seconds: float) -> bool:
        self.time_s += min(seconds, STEP_S) + 1e-9
        return True

    def close(self) -> None:
        pass

    def now_s(self) -> float:
        return self.time_s


def run_handshake(
    reply: Callable[[float, list[bytes]], bytes], timeout_s: float = 3.0
) -> tuple[Ident, list[FromMcu], FarEnd]:
    port = FarEnd(reply)
    ident, after = handshake(port, McuFrames(), SESSION, timeout_s, port.now_s)
    return ident, after, port


def error_text(reply: Callable[[float, list[bytes]], bytes]) -> str:
    with pytest.raises(DeviceError) as caught:
        run_handshake(reply)
    return str(caught.value)


def sampled_at(data: bytes, sent_baud: int, sampled_baud: int) -> bytes:
    """Return the bytes that a receiver decodes at another rate: it samples the line in the middles of its own bits."""
    line = [1] * 20
    for byte in data:
        line += [0, *(byte >> bit & 1 for bit in range(8)), 1]
    line += [1] * 40
    found, at = bytearray(), 0.0
    bit = sent_baud / sampled_baud
    while at < len(line) - 12 * bit:
        if line[int(at)]:
            at += 0.25
            continue
        middles = [line[int(at + (i + 1.5) * bit)] for i in range(8)]
        found.append(sum(value << i for i, value in enumerate(middles)))
        at += 9.5 * bit
    return bytes(found)


def test_handshake_repeats_hello_until_boot_loader_ends() -> None:
    asked: list[int] = []

    def reply(t: float, received: list[bytes]) -> bytes:
        if t < 1.7 or len(received) == len(asked):
            return b""
        asked.extend(range(len(received) - len(asked)))
        return (
            encode(TELEMETRY)
            + encode(msgspec.structs.replace(IDENT, frame_count=2))
            + encode(msgspec.structs.replace(TELEMETRY, frame_count=3, session=SESSION))
        )

    ident, after, port = run_handshake(reply)
    assert ident.mcu == "atmega328p"
    assert [message.session for message in after] == [SESSION], "what came after the answer"
    assert 4 <= len(port.received) <= 5, "twice a second: some boot loaders stay as long as they receive bytes"
    assert set(port.received) == {b"\0" + encode(Hello(SESSION))}
    assert port.time_s < 2.2


def test_handshake_ignores_partial_frames_and_old_sessions() -> None:
    whole = encode(IDENT)
    pieces = [whole[20:], encode(msgspec.structs.replace(IDENT, session=6)), whole[:9], whole[9:]]

    def reply(t: float, received: list[bytes]) -> bytes:
        return pieces.pop(0) if pieces else b""

    assert run_handshake(reply)[0].session == SESSION
    assert pieces == []


def test_handshake_silence_raises_device_error() -> None:
    assert error_text(lambda t, received: b"") == (
        "/dev/ttyUSB0: no answer to the greeting in 3 s; no byte was received.\n"
        "  Try: check the port and the power of the board; then flash the firmware that belongs to this "
        "kit: robots/urov/firmware/README.md."
    )


def test_handshake_garbage_is_shown() -> None:
    assert error_text(lambda t, received: bytes([0xFE, 0x80, 0x91, 0x7F, 0xE3])) == (
        "/dev/ttyUSB0: no answer to the greeting in 3 s. The received bytes "
        "(fe 80 91 7f e3 fe 80 91 7f e3 fe 80 91 7f e3 fe ...) are not one of its frames.\n"
        "  Try: wrong baud rate, or another device; if it is the microcontroller, flash the firmware that belongs to "
        "this kit: robots/urov/firmware/README.md."
    )


@pytest.mark.parametrize("baud", [9600, 57_600, 230_400])
def test_handshake_wrong_baud_rate_is_suggested(baud: int) -> None:
    garbled = sampled_at(encode(TELEMETRY) * 2, baud, 115_200)
    assert sampled_at(encode(TELEMETRY), 115_200, 115_200) == encode(TELEMETRY)
    text = error_text(lambda t, received: garbled)
    assert "are not one of its frames" in text
    assert garbled[:16].hex(" ") in text
    assert "wrong baud rate" in text


def test_handshake_quotes_text_of_other_device() -> None:
    text = error_text(lambda t, received: b"$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47\r\n")
    assert "Another device sends '$GPGGA,123519,48' (24 47 50 47 47 41" in text
    assert "use the port of the microcontroller" in text


@pytest.mark.parametrize("protocol", [0, 2, 255])
def test_handshake_other_version_names_both_versions(protocol: int) -> None:
    other = encode(msgspec.structs.replace(IDENT, protocol=protocol, firmware=(3, 2), session=0))
    assert error_text(lambda t, received: other).startswith(
        f"/dev/ttyUSB0: firmware 3.2 of 'snr_sim esc' speaks protocol {protocol}, this program protocol 1.\n"
        "  Try: flash the firmware"
    )


def test_handshake_protocol_refusal_raises_device_error() -> None:
    refusal = encode(CommandAck(0, 0, TYPE_OF[Hello], AckResult.OTHER_PROTOCOL))
    assert "its firmware does not speak protocol 1" in error_text(lambda t, received: refusal)
    refusal = encode(CommandAck(0, 0, TYPE_OF[Hello], AckResult.OTHER_SESSION))  # of an earlier session
    assert "no answer" in error_text(lambda t, received: refusal)


def test_handshake_one_way_wire_is_distinguished_from_wrong_device() -> None:
    assert "but its telemetry arrives" in error_text(lambda t, received: encode(TELEMETRY))


def test_handshake_flood_of_garbage_ends_at_timeout_and_is_not_kept() -> None:
    flood = bytes(range(1, 256)) * 16
    port = FarEnd(lambda t, received: flood)
    frames = McuFrames()
    with pytest.raises(DeviceError, match="not one of its frames"):
        handshake(port, frames, SESSION, 3.0, port.now_s)
    assert port.time_s == pytest.approx(3.0, abs=0.02)
    assert frames.oversized == 1


def test_handshake_pulled_wire_raises_device_error() -> None:
    def gone(t: float, received: list[bytes]) -> bytes:
        raise DeviceError("/dev/ttyUSB0 is gone: hung up.")

    assert error_text(gone) == "/dev/ttyUSB0 is gone: hung up."


WRONG = [
    ({"neutral_us": 1520.0}, "neutral 1520 us (required: 1500)"),
    ({"lowest_us": 1000.0}, "limits 1000 to 1900 us (required: around 1500 and within 1100 to 1900)"),
    ({"highest_us": 2000.0}, "limits 1100 to 2000 us"),
    ({"lowest_us": 1500.0}, "limits 1500 to 1900 us"),
    ({"highest_us": 1400.0}, "limits 1100 to 1400 us"),
    ({"max_lease_ms": 251}, "a lease of 251 ms at most (required: 1 to 250)"),
    ({"max_lease_ms": 0}, "a lease of 0 ms at most"),
    ({"slew_us_per_100ms": 0}, "slew 0 us in 100 ms (required: 1 to 400)"),
    ({"slew_us_per_100ms": 65535}, "slew 65535 us in 100 ms"),
    ({"dwell_ms": 0}, "a rest of 0 ms between ahead and astern (required: more than 0)"),
    ({"esc_start_ms": 0}, "neutral shown for 0 ms before arming (required: 1000 at least)"),
    ({"name": "blinky"}, "its name is 'blinky' (required: 'snr_sim esc', our firmware's)"),
    ({"channels": 7}, "7 channels (required: 8 at least)"),
]


def outputs_of(port: FakeMcu) -> McuPwm:
    return McuPwm(McuBoard(lambda: port, lambda: 0.0, line_s=lambda: 0.0), lambda: 0.0, 8)


def test_our_firmware_passes_and_name_equals_its_source() -> None:
    out = outputs_of(FakeMcu(IDENT, TELEMETRY))
    out.configure()
    assert out.health().state == "inactive"
    assert f'"{NAME}"' in FIRMWARE.read_text()


@pytest.mark.parametrize(("fields", "message"), WRONG)
def test_mcu_pwm_incompatible_board_is_not_configured(fields: dict[str, Any], message: str) -> None:
    port = FakeMcu(msgspec.structs.replace(IDENT, **fields), TELEMETRY)
    out = outputs_of(port)
    with pytest.raises(DeviceError) as caught:
        out.configure()
    assert "/dev/ttyUSB0: the board there must not drive thrusters. It reports: " in caught.value.message
    assert message in caught.value.message
    assert "robots/urov/firmware" in (caught.value.fix or "")
    assert out.health().state == "error"
    assert not any(isinstance(message, Arm) for message in port.received)
    out.close()


def test_check_identity_lists_all_differences_and_allows_spare_channels() -> None:
    strange = msgspec.structs.replace(IDENT, neutral_us=1400.0, dwell_ms=0)
    with pytest.raises(DeviceError, match=r"neutral 1400 us .*; a rest of 0 ms"):
        check_identity("/dev/ttyUSB0", strange, 2)
    assert incompatibilities(IDENT, 2) == []


def test_mcu_pwm_short_telemetry_raises_device_error() -> None:
    port = FakeMcu(IDENT, msgspec.structs.replace(TELEMETRY, widths_us=(1500.0,) * 3))
    out = outputs_of(port)
    out.configure()
    out.activate()
    applied = out.write_us([1500.0] * 8, 0.0)
    assert len(applied.pulses_us) == 8
    assert "telemetry reports 3 outputs; 8 are used" in out.health().reason
