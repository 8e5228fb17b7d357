"""Frames of VESC controllers on a CAN bus: bytes worked by hand, what is impossible, and random frames."""

import math
import random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from snr_sim.devices.emulated.emulated_can import EmulatedCanNode
from snr_sim.devices.emulated.emulated_vesc import EmulatedVesc
from snr_sim.devices.wire import vesc_messages as vesc
from snr_sim.devices.wire.can_messages import CanFrame, CanStatus, CanVescCodec, status_controller
from snr_sim.prelude.errors import CommandError, ParameterError
from tests.devices.emulated.test_emulated_vesc import BenchMotor
from tests.lanes import nightly

VALUES = vesc.MotorValues(-1.5, 0.5, 0.25, 3.0, 24.0, 7.0, 25.0, "none")
ERPM_PER_RPM = 228.0


@pytest.mark.parametrize(
    ("message", "number", "data"),
    [
        (vesc.SetDuty(-0.57), 0x007, "ff ff 21 58"),  # -57000
        (vesc.SetCurrent(2.5), 0x107, "00 00 09 c4"),
        (vesc.SetBrake(4.0), 0x207, "00 00 0f a0"),
        (vesc.SetSpeed(-1.0), 0x307, "ff ff f7 7f"),  # 228 * 60 / 2 pi, cut
    ],
)
def test_can_command_equals_bytes_worked_by_hand(message: vesc.VescMessage, number: int, data: str) -> None:
    codec = CanVescCodec(7, ERPM_PER_RPM)
    frame = CanFrame(number, bytes.fromhex(data))
    assert codec.encode(message) == frame
    found: Any = codec.decode(frame)
    assert (type(found), codec.unknown) == (type(message), 0)
    assert codec.encode(found) == frame


def test_can_status_equals_bytes_worked_by_hand_and_is_decoded_to_its_units() -> None:
    codec = CanVescCodec(7, ERPM_PER_RPM)
    frames = codec.encode_status(VALUES)
    assert [(frame.id, frame.data.hex(" ")) for frame in frames] == [
        (0x907, "00 00 19 83 ff f1 00 fa"),  # 6531 turns of the field a minute, -1.5 A, 0.25
        (0x1007, "00 fa 00 00 00 05 00 00"),  # 25 degrees, and 0.5 A
        (0x1B07, "00 00 05 f4 00 f0 00 00"),  # 1524 steps of 1368 in a turn, and 24 V
    ]
    assert [status_controller(frame) for frame in frames] == [7, 7, 7]
    found: dict[str, float] = {}
    for frame in frames:
        status = codec.decode(CanFrame(frame.id, frame.data[:6] if frame.id >> 8 == 27 else frame.data))
        assert isinstance(status, CanStatus)
        found |= status.values
    assert vesc.MotorValues(fault="none", **found) == vesc.MotorValues(
        -1.5, 0.5, 0.25, pytest.approx(3.0, abs=5e-4), 24.0, pytest.approx(7.0, abs=5e-3), 25.0, "none"
    )


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e300])
@pytest.mark.parametrize("kind", [vesc.SetDuty, vesc.SetCurrent, vesc.SetBrake, vesc.SetSpeed])
def test_can_command_that_is_not_finite_or_too_large_is_refused(kind: Any, value: float) -> None:
    with pytest.raises(CommandError):
        CanVescCodec(7, ERPM_PER_RPM).encode(kind(value))


@pytest.mark.parametrize("message", [vesc.SetDuty(1.01), vesc.SetDuty(-1.01), vesc.SetPosition(1.0), vesc.Alive()])
def test_can_command_out_of_range_or_of_another_kind_is_refused(message: vesc.VescMessage) -> None:
    with pytest.raises(CommandError, match=r"cannot be sent .*(SetDuty|SetPosition|Alive)"):
        CanVescCodec(7, ERPM_PER_RPM).encode(message)


@pytest.mark.parametrize("values", [{"current_a": math.nan}, {"voltage_v": math.inf}, {"duty": 33.0}])
def test_can_status_that_does_not_fit_is_refused(values: dict[str, float]) -> None:
    with pytest.raises(CommandError, match="does not fit into the bytes of a status"):
        CanVescCodec(7, ERPM_PER_RPM).encode_status(vesc.msgspec.structs.replace(VALUES, **values))


@pytest.mark.parametrize("number", [-1, 255, 256])
def test_can_controller_of_impossible_number_is_refused(number: int) -> None:
    with pytest.raises(ParameterError, match=f"No controller has the number {number} "):
        CanVescCodec(number, ERPM_PER_RPM)


@pytest.mark.parametrize(
    ("number", "length", "is_extended"), [(-1, 0, True), (1 << 29, 0, True), (0x800, 0, False), (5, 9, True)]
)
def test_impossible_can_frame_is_refused(number: int, length: int, is_extended: bool) -> None:
    with pytest.raises(CommandError, match="A CAN frame has no id"):
        CanFrame(number, bytes(length), is_extended)


@pytest.mark.parametrize(
    "frame",
    [
        CanFrame(0x308, bytes(4)),  # of controller 8
        CanFrame(0x307, bytes(4), is_extended=False),
        CanFrame(0x407, bytes(4)),  # a position
        CanFrame(0x307),
        CanFrame(0x307, bytes(3)),
        CanFrame(0x307, bytes(5)),
        CanFrame(0x007, (100_001).to_bytes(4, "big")),  # a duty of more than 1
        CanFrame(0x907, bytes(7)),
        CanFrame(0x1B07, bytes(5)),
    ],
)
def test_other_can_frame_is_counted_and_nothing_else(frame: CanFrame) -> None:
    codec = CanVescCodec(7, ERPM_PER_RPM)
    assert (codec.decode(frame), codec.unknown) == (None, 1)


@given(st.sampled_from([vesc.SetCurrent, vesc.SetBrake, vesc.SetSpeed]), st.floats(-1e5, 1e5))
def test_can_command_round_trip_keeps_value_to_a_step(kind: Any, value: float) -> None:
    codec = CanVescCodec(254, ERPM_PER_RPM)
    found: Any = codec.decode(codec.encode(kind(value)))
    assert vesc.msgspec.structs.astuple(found)[0] == pytest.approx(value, abs=1e-3)


@pytest.mark.parametrize("count", [10_000, nightly(1_000_000)])
def test_random_can_frames_raise_nothing_and_never_command_more_than_there_is(count: int) -> None:
    chance, motor, codec = random.Random(5), BenchMotor(), CanVescCodec(7, ERPM_PER_RPM)
    node = EmulatedCanNode(EmulatedVesc(motor, "motor_LF", ERPM_PER_RPM), 7, ERPM_PER_RPM)
    commands = statuses = 0
    for i in range(count):
        is_extended = chance.random() < 0.9
        number = chance.getrandbits(13) << 8 | 7 if chance.random() < 0.5 else chance.getrandbits(29)
        number = chance.choice([0, 1, 2, 3, 9, 16, 27]) << 8 | 7 if chance.random() < 0.5 else number
        length = chance.choice([4, 8, chance.randint(0, 8)])
        frame = CanFrame(number if is_extended else number & 0x7FF, chance.randbytes(length), is_extended)
        node.feed([frame], i * 1e-3)
        message = codec.decode(frame)
        if isinstance(message, CanStatus):
            statuses += 1
            assert all(map(math.isfinite, message.values.values()))
        elif message is not None:
            commands += 1
    assert min(commands, statuses) > count / 20
    assert commands + codec.unknown + statuses == count
    assert all(abs(value) <= 1.0 for mode, value in motor.commands if mode == "duty")
    assert {mode for mode, _ in motor.commands} >= {"current", "brake", "speed"}
