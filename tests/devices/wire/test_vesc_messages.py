"""Messages of motor controllers: bytes worked by hand, both dialects, both layouts of values, and what is refused."""

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from snr_sim.devices.wire.vesc_messages import (
    FAULTS,
    Alive,
    Dialect,
    Firmware,
    ForwardCan,
    GetFirmware,
    GetRotorPosition,
    GetValues,
    MotorValues,
    RotorPosition,
    SetBrake,
    SetCurrent,
    SetDuty,
    SetHandbrake,
    SetPosition,
    SetRotorPositionMode,
    SetSpeed,
    Subscription,
    VescCodec,
)
from snr_sim.prelude.errors import CommandError, DeviceError

TURN_RAD = 2.0 * math.pi
ERPM_PER_RPM = 228.0  # 12 pole pairs, gear of 19
NUMBER = st.floats(-1000.0, 1000.0)
TEXT = st.text(st.characters(min_codepoint=33, max_codepoint=126), min_size=1, max_size=20)
OF_BOTH = [
    st.just(GetFirmware()),
    st.just(GetValues()),
    *(st.builds(kind, NUMBER) for kind in (SetDuty, SetCurrent, SetBrake, SetSpeed)),
    st.builds(SetPosition, st.floats(-30.0, 30.0)),
    st.builds(Firmware, st.integers(0, 255), st.integers(0, 255), TEXT, st.binary(min_size=12, max_size=12)),
    st.builds(
        MotorValues, NUMBER, NUMBER, st.floats(-1.0, 1.0), NUMBER, st.floats(0.0, 100.0), NUMBER,
        st.floats(-40.0, 150.0), st.sampled_from(FAULTS),
    ),
]  # fmt: skip
MESSAGES: dict[Dialect, st.SearchStrategy[Any]] = {
    "stock": st.one_of(
        *OF_BOTH,
        st.builds(SetHandbrake, NUMBER),
        st.just(Alive()),
        st.builds(ForwardCan, st.integers(0, 255), st.binary(max_size=20)),
    ),
    "seed": st.one_of(
        *OF_BOTH,
        st.builds(SetRotorPositionMode, st.integers(-128, 127)),
        st.just(GetRotorPosition()),
        st.builds(RotorPosition, st.floats(-TURN_RAD, TURN_RAD)),
        st.builds(Subscription, TEXT),
    ),
}


def codec(dialect: Dialect = "stock", major: int = 5) -> VescCodec:
    made = VescCodec(dialect, ERPM_PER_RPM)
    if dialect == "stock":
        made.set_firmware(Firmware(major, 3), "wheelLF")
    return made


@pytest.mark.parametrize(
    ("dialect", "message", "payload"),
    [
        ("stock", GetFirmware(), "00"),
        ("stock", GetValues(), "04"),
        ("stock", SetDuty(0.57), "05 00 00 de a8"),  # 57000: 0.57 * 1e5 is a bit less
        ("stock", SetDuty(-0.5), "05 ff ff 3c b0"),
        ("stock", SetCurrent(-1.5), "06 ff ff fa 24"),
        ("stock", SetBrake(4.0), "07 00 00 0f a0"),
        ("stock", SetSpeed(TURN_RAD), "08 00 00 35 70"),  # 60 turns of the wheel a minute, 13 680 of the field
        ("stock", SetSpeed(7807.76 * TURN_RAD / 60.0 / ERPM_PER_RPM), "08 00 00 1e 7f"),  # 7807
        ("stock", SetSpeed(-7807.76 * TURN_RAD / 60.0 / ERPM_PER_RPM), "08 ff ff e1 81"),  # -7807: towards zero
        ("stock", SetPosition(math.pi), "09 0a ba 95 00"),  # 180 000 000
        ("stock", SetHandbrake(2.0), "0a 00 00 07 d0"),
        ("seed", SetRotorPositionMode(3), "0a 03"),
        ("seed", GetRotorPosition(), "15"),
        ("seed", RotorPosition(math.pi / 2.0), "15 00 89 54 40"),  # 9 000 000
        ("stock", Alive(), "1e"),
        ("stock", ForwardCan(7, bytes([4])), "22 07 04"),
        ("seed", Subscription("t"), "24 74"),
    ],
)
def test_vesc_encode_equals_payload_worked_by_hand(dialect: Dialect, message: Any, payload: str) -> None:
    assert codec(dialect).encode(message) == bytes.fromhex(payload)


VALUES = MotorValues(
    current_a=12.34, battery_a=-1.5, duty=0.25, speed_radps=TURN_RAD, voltage_v=24.1, turned_rad=TURN_RAD,
    temperature_c=41.5, fault="fet_hot",
)  # fmt: skip
# Motor and battery current, [currents of the axes], duty, 13 680 turns a minute, 241; charge and energy; 1368 steps,
# that without signs; fault 5.
OLD = "04 01 18 01 19 01 9f 01 1a 01 1b 01 1c 01 2c 00 00 04 d2 ff ff ff 6a 00 fa 00 00 35 70 00 f1"
NEW = "04 01 9f 01 2c 00 00 04 d2 ff ff ff 6a 00 00 00 11 00 00 00 22 00 fa 00 00 35 70 00 f1"
TAIL = "00 00 00 01 00 00 00 02 00 00 00 03 00 00 00 04 00 00 05 58 00 00 06 00 05"


@pytest.mark.parametrize(
    ("controller", "payload"),
    [
        (codec("seed"), OLD + TAIL),
        (codec("stock", 2), OLD + TAIL),
        (codec("stock", 3), NEW + TAIL),
        (codec("stock", 6), NEW + TAIL + "00 00 00 00 07 01 02 03 04 05 06"),  # position, controller, and more
    ],
)
def test_vesc_decode_values_in_the_layout_of_the_firmware(controller: VescCodec, payload: str) -> None:
    values = controller.decode(bytes.fromhex(payload))
    assert isinstance(values, MotorValues)
    assert values.fault == VALUES.fault
    for name in ("current_a", "battery_a", "duty", "speed_radps", "voltage_v", "turned_rad", "temperature_c"):
        assert getattr(values, name) == pytest.approx(getattr(VALUES, name), rel=1e-12), name


@pytest.mark.parametrize("dialect", MESSAGES)
@given(st.data())
def test_vesc_decoded_message_encodes_to_the_same_payload(dialect: Dialect, data: st.DataObject) -> None:
    controller = codec(dialect)
    message = data.draw(MESSAGES[dialect])
    payload = controller.encode(message)
    decoded = controller.decode(payload)
    assert type(decoded) is type(message)
    assert controller.encode(decoded) == payload
    assert controller.unknown == 0


@given(st.integers(-(2**31), 2**31 - 1))
def test_vesc_any_number_on_the_wire_is_kept(number: int) -> None:
    for kind in (5, 6, 7, 8, 9, 10):
        payload = bytes([kind]) + number.to_bytes(4, "big", signed=True)
        message = codec().decode(payload)
        assert message is not None
        assert codec().encode(message) == payload


@given(st.binary(max_size=90))
def test_vesc_decode_any_payload_raises_nothing(payload: bytes) -> None:
    for dialect in MESSAGES:
        controller = codec(dialect)
        assert (controller.decode(payload) is None) == controller.unknown


@pytest.mark.parametrize("payload", ["", "05", "05 00 00 00", "04 01 9f", "00 05", "15 00", "24", "ff 00", "1e 00"])
def test_vesc_payload_of_unknown_id_or_length_is_counted(payload: str) -> None:
    controller = codec()
    assert controller.decode(bytes.fromhex(payload)) is None
    assert controller.unknown == 1


def test_vesc_firmware_is_read_with_and_without_a_name() -> None:
    chip = bytes(range(12))
    long = b"\x00\x05\x03" + b"60_MK5\0" + chip + b"\x00\x01"
    assert codec().decode(long) == Firmware(5, 3, "60_MK5", chip)
    assert codec().decode(b"\x00\x02\x12") == Firmware(2, 18)


def test_vesc_faults_have_the_firmware_numbers() -> None:
    payload = codec().encode(VALUES)
    faults = {number: codec().decode(payload[:-1] + bytes([number])) for number in (0, 1, 2, 3, 4, 5, 6, 10, 11, 28)}
    assert {number: getattr(values, "fault", None) for number, values in faults.items()} == {
        0: "none", 1: "over_voltage", 2: "under_voltage", 3: "drv", 4: "over_current", 5: "fet_hot", 6: "motor_hot",
        10: "watchdog_reset", 11: "encoder", 28: "fault_28",
    }  # fmt: skip


@pytest.mark.parametrize("major", [0, 1, 7, 23])
def test_vesc_unknown_firmware_raises_device_error_with_its_version(major: int) -> None:
    with pytest.raises(
        DeviceError, match=rf"wheelRF has VESC firmware {major}\.1, whose values .* 2\.x to 6\.x"
    ) as error:
        codec().set_firmware(Firmware(major, 1), "wheelRF")
    assert "vesc_messages.py" in error.value.fix


def test_vesc_values_before_the_firmware_is_known_are_not_guessed() -> None:
    controller = VescCodec("stock", ERPM_PER_RPM)
    assert controller.decode(bytes.fromhex(NEW + TAIL)) is None
    assert controller.unknown == 1


@pytest.mark.parametrize(
    ("dialect", "message"),
    [
        ("seed", SetHandbrake(1.0)),  # 10 sets the mode of the rotor's position there
        ("seed", Alive()),
        ("seed", ForwardCan(1, b"\4")),
        ("stock", Subscription("t")),
        ("stock", SetRotorPositionMode(1)),
    ],
)
def test_vesc_encode_message_of_other_dialect_raises_command_error(dialect: Dialect, message: Any) -> None:
    with pytest.raises(CommandError, match=f"{type(message).__name__} is not a message .* dialect '{dialect}'"):
        codec(dialect).encode(message)


@pytest.mark.parametrize(
    "message",
    [
        *(kind(value) for kind in (SetDuty, SetCurrent, SetBrake, SetSpeed, SetPosition)
          for value in (math.nan, math.inf, -math.inf, 1e9, None, "1")),
        ForwardCan(256, b""),
        Firmware(5, 3, "ü"),
        Firmware(5, 3, b"60"),
        MotorValues(0.0, 0.0, math.nan, 0.0, 0.0, 0.0, 0.0, "none"),
        MotorValues(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, "tired"),
    ],
)  # fmt: skip
def test_vesc_encode_value_that_does_not_fit_raises_command_error(message: Any) -> None:
    with pytest.raises(CommandError, match="does not fit into its bytes"):
        codec().encode(message)


def test_vesc_encode_values_without_firmware_raises_command_error() -> None:
    with pytest.raises(CommandError, match="depends on the firmware"):
        VescCodec("stock", ERPM_PER_RPM).encode(VALUES)
