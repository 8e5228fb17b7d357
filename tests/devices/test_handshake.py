"""The handshake of a port: names, silence, bad answers, and good ones among junk, cut off, and twice."""

from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from snr_sim.devices.emulated.emulated_vesc import EmulatedVesc
from snr_sim.devices.motors.handshake import FIRMWARE_S, TRIES, TRY_S, Handshake
from snr_sim.devices.wire import vesc_messages as vesc
from snr_sim.devices.wire.json_frames import encode_frame
from snr_sim.devices.wire.vesc_frames import encode
from tests.devices.emulated.test_emulated_vesc import BenchMotor

STEP_S = 0.01
ASK = encode(vesc.VescCodec("seed", 1.0).encode(vesc.Subscription("t")))
ASK_FIRMWARE = encode(vesc.VescCodec("stock", 1.0).encode(vesc.GetFirmware()))
NAMED = encode(vesc.VescCodec("seed", 1.0).encode(vesc.Subscription("motor_LF")))
NAMED_JSON = encode_frame({"name": "lamp", "version": 2})
CHIP = bytes(range(12))
VERSION = encode(vesc.VescCodec("stock", 1.0).encode(vesc.Firmware(5, 3, "60", CHIP)))
JUNK = st.lists(st.binary(max_size=6) | st.sampled_from([b"\x03\xff\xff", b"\x02\x40", b"\x02", b'\x30{"'])).map(
    b"".join
)


def asked(
    answers: Sequence[bytes], chips: dict[str, str] | None = None, before: bytes = b""
) -> tuple[Handshake, float]:
    """Return a handshake that has ended, and how long it took.

    Args:
        answers: to its questions, in their order; none to those after.
        before: what has arrived before the first.
    """
    handshake, now_s, left, data = Handshake(chips or {}), 0.0, list(answers), before
    while not handshake.is_done:
        sent = handshake.step(data, now_s)
        data = left.pop(0) if sent and left else b""
        now_s += STEP_S
        assert now_s < 5.0
    return handshake, now_s - STEP_S


def test_controller_that_answers_is_known_at_once() -> None:
    handshake, took_s = asked([NAMED])
    assert (handshake.name, handshake.is_controller, handshake.failure) == ("motor_LF", True, "")
    assert took_s == pytest.approx(STEP_S)
    assert handshake.step(NAMED, 9.0) == b"", "it asks no more"


def test_emulated_controllers_of_both_dialects_are_known_by_name_and_by_chip() -> None:
    seed = EmulatedVesc(BenchMotor(), "motor_LM", 228.0, "seed", "2.18")
    stock = EmulatedVesc(BenchMotor(), "motor_LB", 228.0, "stock", "5.3")
    chip = vesc.VescCodec("stock", 1.0).decode(stock.feed(ASK_FIRMWARE, 0.0)[2:-3])
    assert isinstance(chip, vesc.Firmware)
    found = []
    for far in (seed, stock):
        handshake, now_s, data = Handshake({chip.chip.hex(): "motor_LB"}), 0.0, b""
        while not handshake.is_done:
            data = far.feed(handshake.step(data, now_s), now_s)
            now_s += STEP_S
        found.append((handshake.name, handshake.is_controller, round(now_s - STEP_S, 2)))
    assert found == [("motor_LM", True, STEP_S), ("motor_LB", True, TRIES * TRY_S + STEP_S)]


def test_silent_port_is_asked_four_times_and_for_its_firmware() -> None:
    handshake, sent, now_s = Handshake({}), [], 0.0
    while not handshake.is_done:
        question = handshake.step(b"", now_s)
        if question:
            sent.append((round(now_s, 2), question))
        now_s += STEP_S
    times_s = [0.0, 0.25, 0.5, 0.75]
    assert sent == [*((time_s, ASK) for time_s in times_s), (1.0, ASK_FIRMWARE)]
    assert (handshake.name, handshake.failure) == ("", "sends nothing")
    assert now_s - STEP_S == pytest.approx(TRIES * TRY_S + FIRMWARE_S)


def test_chip_that_is_in_no_table_is_stated() -> None:
    handshake, _ = asked([b""] * TRIES + [VERSION])
    assert (
        handshake.failure
        == f"is a VESC controller with the chip number {CHIP.hex()}, which the robot's table does not name"
    )
    assert asked([b""] * TRIES + [VERSION], {CHIP.hex(): "motor_RF"})[0].name == "motor_RF"


def test_port_that_talks_is_not_asked_for_its_firmware() -> None:
    handshake, took_s = asked([b"$GPGGA,120000.00,5530", b"", b"$GPVTG", b"", VERSION], {CHIP.hex(): "motor_RF"})
    assert handshake.failure == "sends 24 47 50 56 54 47, which is not a name"
    assert handshake.bad_answers == ["24 47 50 47 47 41 2c 31 32 30 30 30 30 2e 30 30", "24 47 50 56 54 47"]
    assert took_s == pytest.approx(TRIES * TRY_S)


def test_small_device_is_known_by_its_object_and_drives_no_motor() -> None:
    handshake, _ = asked([NAMED_JSON])
    assert (handshake.name, handshake.is_controller) == ("lamp", False)


@pytest.mark.parametrize("value", [{"nam": "lamp"}, {"name": 7}, {"name": ""}, {"name": "a" * 65}, {"name": "a\nb"}])
def test_object_without_a_valid_name_is_a_bad_answer(value: dict[str, object]) -> None:
    handshake, _ = asked([encode_frame(value)] * TRIES)
    assert (handshake.name, len(handshake.bad_answers)) == ("", TRIES)


def test_answer_before_the_first_question_does_not_count() -> None:
    handshake, _ = asked([b"", NAMED_JSON], before=NAMED)
    assert (handshake.name, handshake.bad_answers) == ("lamp", [])


@pytest.mark.parametrize(("answer", "name"), [(NAMED, "motor_LF"), (NAMED_JSON, "lamp")])
@given(data=st.data())
def test_name_is_found_among_junk_and_twice(answer: bytes, name: str, data: st.DataObject) -> None:
    between = data.draw(JUNK)
    # Only 1024 bytes, which no junk here has, could claim a frame for longer than a try.
    stream = data.draw(JUNK) + answer + between + answer + data.draw(JUNK)
    assert asked([stream])[0].name == name


@pytest.mark.parametrize(("answer", "name"), [(NAMED, "motor_LF"), (NAMED_JSON, "lamp")])
@given(data=st.data())
def test_name_is_found_after_an_answer_that_was_cut_off(answer: bytes, name: str, data: st.DataObject) -> None:
    cut = answer[: data.draw(st.integers(0, len(answer) - 1))]
    handshake, took_s = asked([cut, answer])
    assert handshake.name == name
    assert took_s == pytest.approx(TRY_S + STEP_S)


@given(st.lists(JUNK, max_size=6))
def test_junk_alone_gives_no_name_and_ends_in_time(answers: list[bytes]) -> None:
    handshake, took_s = asked(answers)
    assert (handshake.name, bool(handshake.failure)) == ("", True)
    assert took_s <= TRIES * TRY_S + FIRMWARE_S + STEP_S
