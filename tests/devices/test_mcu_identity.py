"""A board that would not keep thrusters safe by itself is refused, with its values and the required ones."""

from pathlib import Path
from typing import Any

import msgspec
import pytest

from snr_sim.devices.mcu.mcu import McuPwm
from snr_sim.devices.mcu.mcu_board import McuBoard
from snr_sim.devices.mcu.mcu_handshake import NAME, check_identity, incompatibilities
from snr_sim.devices.wire.mcu_messages import Arm, Ident, McuFault, McuState, ResetCause, Telemetry
from snr_sim.prelude.errors import DeviceError
from snr_sim.testing.fake_mcu import FakeMcu

FIRMWARE = Path(__file__).parents[2] / "robots/urov/firmware/esc.c"
OURS = Ident(0, 1, 1, (1, 0), 8, 1100.0, 1500.0, 1900.0, 25.0, 500, 8000, 200, 1500, 400, 50, "atmega328p", NAME)
TELEMETRY = Telemetry(1, 1, 0, 50, McuState.DISARMED, McuFault(0), ResetCause.EXTERNAL, 0xFFFF, 0, 0, 0, (1500.0,) * 8)

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


def configured(ident: Ident, channels: int = 8) -> tuple[McuPwm, FakeMcu]:
    port = FakeMcu(ident, TELEMETRY)
    out = McuPwm(McuBoard(lambda: port, lambda: 0.0, line_s=lambda: 0.0), lambda: 0.0, channels)
    out.configure()
    return out, port


def test_our_firmware_passes_and_name_equals_its_source() -> None:
    assert configured(OURS)[0].health().state == "inactive"
    assert f'"{NAME}"' in FIRMWARE.read_text()


@pytest.mark.parametrize(("fields", "message"), WRONG)
def test_mcu_pwm_incompatible_board_is_not_configured(fields: dict[str, Any], message: str) -> None:
    port = FakeMcu(msgspec.structs.replace(OURS, **fields), TELEMETRY)
    out = McuPwm(McuBoard(lambda: port, lambda: 0.0, line_s=lambda: 0.0), lambda: 0.0, 8)
    with pytest.raises(DeviceError) as caught:
        out.configure()
    assert "/dev/ttyUSB0: the board there must not drive thrusters. It reports: " in caught.value.message
    assert message in caught.value.message
    assert "robots/urov/firmware" in (caught.value.fix or "")
    assert out.health().state == "error"
    assert not any(isinstance(message, Arm) for message in port.received)
    out.close()


def test_check_identity_lists_all_differences_and_allows_spare_channels() -> None:
    strange = msgspec.structs.replace(OURS, neutral_us=1400.0, dwell_ms=0)
    with pytest.raises(DeviceError, match=r"neutral 1400 us .*; a rest of 0 ms"):
        check_identity("/dev/ttyUSB0", strange, 2)
    assert incompatibilities(OURS, 2) == []


def test_mcu_pwm_short_telemetry_raises_device_error() -> None:
    port = FakeMcu(OURS, msgspec.structs.replace(TELEMETRY, widths_us=(1500.0,) * 3))
    out = McuPwm(McuBoard(lambda: port, lambda: 0.0, line_s=lambda: 0.0), lambda: 0.0, 8)
    out.configure()
    out.activate()
    applied = out.write_us([1500.0] * 8, 0.0)
    assert len(applied.pulses_us) == 8
    assert "telemetry reports 3 outputs; 8 are used" in out.health().reason
