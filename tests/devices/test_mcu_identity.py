"""A board that would not keep thrusters safe by itself is refused, with its values and the required ones."""

from pathlib import Path
from typing import Any

import msgspec
import pytest

from snr_sim.devices.mcu.mcu import McuPwm
from snr_sim.devices.mcu.mcu_board import McuBoard
from snr_sim.devices.mcu.mcu_identity import NAME, check_identity, misfits
from snr_sim.devices.wire.mcu_messages import Arm, Fault, Ident, ResetCause, State, Telemetry
from snr_sim.prelude.errors import DeviceError
from snr_sim.testing.mcu_greeter import McuGreeter

FIRMWARE = Path(__file__).parents[2] / "robots/urov/firmware/esc.c"
OURS = Ident(0, 1, 1, (1, 0), 8, 1100.0, 1500.0, 1900.0, 25.0, 500, 8000, 200, 1500, 400, 50, "atmega328p", NAME)
TELEMETRY = Telemetry(1, 1, 0, 50, State.DISARMED, Fault(0), ResetCause.EXTERNAL, 0xFFFF, 0, 0, 0, (1500.0,) * 8)

WRONG = [
    ({"neutral_us": 1520.0}, "neutral 1520 us (wanted: 1500)"),
    ({"lowest_us": 1000.0}, "limits 1000 to 1900 us (wanted: around 1500 and within 1100 to 1900)"),
    ({"highest_us": 2000.0}, "limits 1100 to 2000 us"),
    ({"lowest_us": 1500.0}, "limits 1500 to 1900 us"),
    ({"highest_us": 1400.0}, "limits 1100 to 1400 us"),
    ({"most_lease_ms": 251}, "a lease of 251 ms at most (wanted: 1 to 250)"),
    ({"most_lease_ms": 0}, "a lease of 0 ms at most"),
    ({"slew_us_per_100ms": 0}, "slew 0 us in 100 ms (wanted: 1 to 400)"),
    ({"slew_us_per_100ms": 65535}, "slew 65535 us in 100 ms"),
    ({"dwell_ms": 0}, "a rest of 0 ms between ahead and astern (wanted: more than 0)"),
    ({"esc_start_ms": 0}, "neutral shown for 0 ms before arming (wanted: 1000 at least)"),
    ({"name": "blinky"}, "its name is 'blinky' (wanted: 'snr_sim esc', our firmware's)"),
    ({"channels": 7}, "7 channels (wanted: 8 at least)"),
]


def configured(ident: Ident, channels: int = 8) -> tuple[McuPwm, McuGreeter]:
    port = McuGreeter(ident, TELEMETRY)
    out = McuPwm(McuBoard(lambda: port, lambda: 0.0, line_s=lambda: 0.0), lambda: 0.0, channels)
    out.configure()
    return out, port


def test_our_firmware_fits_and_its_name_is_the_one_in_its_source() -> None:
    assert configured(OURS)[0].health().state == "inactive"
    assert f'"{NAME}"' in FIRMWARE.read_text()


@pytest.mark.parametrize(("said", "told"), WRONG)
def test_outputs_on_a_board_that_does_not_fit_are_not_configured(said: dict[str, Any], told: str) -> None:
    port = McuGreeter(msgspec.structs.replace(OURS, **said), TELEMETRY)
    out = McuPwm(McuBoard(lambda: port, lambda: 0.0, line_s=lambda: 0.0), lambda: 0.0, 8)
    with pytest.raises(DeviceError) as caught:
        out.configure()
    assert "/dev/ttyUSB0: the board there must not drive thrusters. It says of itself: " in caught.value.message
    assert told in caught.value.message
    assert "robots/urov/firmware" in (caught.value.fix or "")
    assert out.health().state == "error"
    assert not any(isinstance(message, Arm) for message in port.heard)
    out.close()


def test_all_that_is_wrong_is_told_at_once_and_spare_channels_are_not_wrong() -> None:
    strange = msgspec.structs.replace(OURS, neutral_us=1400.0, dwell_ms=0)
    with pytest.raises(DeviceError, match=r"neutral 1400 us .*; a rest of 0 ms"):
        check_identity("/dev/ttyUSB0", strange, 2)
    assert misfits(OURS, 2) == []


def test_telemetry_of_fewer_outputs_than_it_said_is_an_error_and_no_index_is_beyond() -> None:
    port = McuGreeter(OURS, msgspec.structs.replace(TELEMETRY, widths_us=(1500.0,) * 3))
    out = McuPwm(McuBoard(lambda: port, lambda: 0.0, line_s=lambda: 0.0), lambda: 0.0, 8)
    out.configure()
    out.activate()
    applied = out.write_us([1500.0] * 8, 0.0)
    assert len(applied.pulses_us) == 8
    assert "telemetry tells of 3 outputs; 8 are used" in out.health().why
