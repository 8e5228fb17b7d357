"""The one string that says where devices are."""

import pytest

from snr_sim.prelude.errors import UnknownName
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
def test_a_string_says_what_kind_and_where_and_comes_back_as_it_was(text: str, kind: str, where: str) -> None:
    assert parse_io(text) == Io(kind, where)
    assert str(parse_io(text)) == text


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("mirorr", "did you mean 'mirror'"),
        ("", "kind ''"),
        ("MCU:/dev/ttyUSB0", "kind 'MCU'"),
        ("mcu", "--io mcu:PORT, such as mcu:/dev/ttyUSB0"),
        ("mcu:", "does not say where"),
        ("pca9685", "pca9685:BUS:ADDR"),
        ("replay", "replay:RUN"),
        ("sim:/dev/ttyUSB0", "'sim' takes nothing after it, but found ':/dev/ttyUSB0'"),
    ],
)
def test_one_that_says_too_little_or_too_much_is_refused_with_what_to_type(text: str, said: str) -> None:
    with pytest.raises(UnknownName) as caught:
        parse_io(text)
    assert said in str(caught.value)
