"""The firmware is small enough to be read."""

import re

import pytest

from .conftest import FIRMWARE

MAX_LINES = 500


@pytest.mark.parametrize("pulses", ["pulses_328p.c", "pulses_2560.c"])
def test_firmware_has_less_than_500_lines_of_code(pulses: str) -> None:
    lines = 0
    for name in ("esc.c", "frames.c", "frames.h", "pulses.h", pulses):
        code = re.sub(r"/\*.*?\*/", "", (FIRMWARE / name).read_text(), flags=re.DOTALL)
        lines += sum(1 for line in code.splitlines() if line.strip())
    assert lines < MAX_LINES
