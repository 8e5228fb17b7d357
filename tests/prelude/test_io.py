"""The string that gives the location of devices."""

import pytest

from snr_sim.prelude.errors import UnknownNameError
from snr_sim.prelude.io import Io, parse_io


@pytest.mark.parametrize(
    ("text", "kind", "where"),
    [
        ("sim", "sim", ""),
        ("emulated", "emulated", ""),
        ("mcu:/dev/ttyUSB0", "mcu", "/dev/ttyUSB0"),
        ("mcu:COM3", "mcu", "COM3"),
        ("pca9685:1:0x40", "pca9685", "1:0x40"),
        ("replay:runs/urov_depth_hold-0-x", "replay", "runs/urov_depth_hold-0-x"),
        ("mcu:/dev/serial/by-path/pci-0:1:2", "mcu", "/dev/serial/by-path/pci-0:1:2"),
    ],
)
def test_parse_io_returns_kind_and_address_and_round_trips(text: str, kind: str, where: str) -> None:
    assert parse_io(text) == Io(kind, where)
    assert str(parse_io(text)) == text


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("lopback", "did you mean 'loopback'"),
        ("", "kind ''"),
        ("MCU:/dev/ttyUSB0", "kind 'MCU'"),
        ("mcu", "--io mcu:PORT, such as mcu:/dev/ttyUSB0"),
        ("mcu:", "does not say where"),
        ("pca9685", "pca9685:BUS:ADDR"),
        ("replay", "replay:RUN"),
        ("pca9685:1:forty", "'1:forty' is not an I2C bus and address"),
        ("pca9685:1:0x80", "addresses go from 0x08 to 0x77"),
        ("pca9685:/dev/ttyUSB0", "BUS:ADDR, such as 1:0x40"),
        ("sim:/dev/ttyUSB0", "'sim' takes nothing after it, but found ':/dev/ttyUSB0'"),
    ],
)
def test_invalid_io_text_raises_with_fix(text: str, expected: str) -> None:
    with pytest.raises(UnknownNameError) as caught:
        parse_io(text)
    assert expected in str(caught.value)


def test_gpiozero_raises_with_measured_reason() -> None:
    """`pins/lgpio.py` makes a duty cycle of int(value * 100) per cent: at 50 Hz, steps of 200 us."""
    with pytest.raises(UnknownNameError) as caught:
        parse_io("gpiozero:17")
    assert "neutral, 1500, becomes 1400, which is reverse thrust" in caught.value.message
    assert "mcu:PORT" in caught.value.fix
    made_us = sorted({int(pulse_us / 20_000 * 100) * 200 for pulse_us in range(1100, 1901)})
    assert ", ".join(map(str, made_us[:-1])) + f" and {made_us[-1]}" in caught.value.message
