"""What an MS5837-30BA says in bytes: its calibration with a check sum, and pressure and temperature from raw counts.

Source: TE Connectivity, MS5837-30BA data sheet (commands, first and second order compensation); Measurement
Specialties, application note AN520 (the four-bit check sum).
"""

from __future__ import annotations

from collections.abc import Sequence

from snr_sim.prelude.errors import DeviceError

RESET, READ_ADC, READ_PROM = 0x1E, 0x00, 0xA0
CONVERT_PRESSURE, CONVERT_TEMPERATURE = 0x40, 0x50  # at 256 samples; each next oversampling is 2 further on
ADC_BYTES = 3
PROM_WORDS = 7
_POLYNOMIAL = 0x3000


def crc4(words: Sequence[int]) -> int:
    """Returns the check sum of a PROM of eight words, in which its own four bits are 0.

    >>> hex(crc4([0x3132, 0x3334, 0x3536, 0x3738, 0x3940, 0x4142, 0x4344, 0x4500]))  # the example of AN520
    '0xb'
    """
    rest = 0
    for byte in b"".join(word.to_bytes(2, "big") for word in words):
        rest ^= byte
        for _ in range(8):
            rest = (rest << 1 ^ _POLYNOMIAL if rest & 0x8000 else rest << 1) & 0xFFFF
    return rest >> 12


def calibration(words: Sequence[int]) -> tuple[int, ...]:
    """Returns C0 to C6 of a PROM's seven words, C0 without the check sum.

    Raises:
        DeviceError: the check sum is of other words.
    """
    told, first = words[0] >> 12, words[0] & 0x0FFF
    counted = crc4([first, *words[1:], 0])
    if told != counted or not any(words[1:]):
        shown = " ".join(f"{word:04x}" for word in words)
        raise DeviceError(
            f"its calibration has the check sum {told:x}, but counts up to {counted:x}: {shown}.",
            fix="shorter wires or a slower bus; all the same words are of another part, or of none.",
        )
    return (first, *words[1:])


def compensated(c: Sequence[int], d1: int, d2: int) -> tuple[float, float]:
    """Returns pressure [Pa] and temperature [C] of raw counts, with the second order.

    Args:
        c: C0 to C6.
        d1: raw pressure.
        d2: raw temperature.

    >>> c = (0, 34982, 36352, 20328, 22354, 26646, 26146)  # the example of the data sheet: 3999.8 mbar, 19.81 C
    >>> [round(value, 2) for value in compensated(c, 4958179, 6815414)]
    [399984.03, 19.81]
    """
    d_t = d2 - c[5] * 256
    temperature = 2000 + d_t * c[6] / 2**23  # hundredths of a degree
    below, far_below = temperature - 2000, temperature + 1500
    if below < 0:
        t_i, off_i, sens_i = 3 * d_t**2 / 2**33, 3 * below**2 / 2, 5 * below**2 / 8
        if far_below < 0:
            off_i += 7 * far_below**2
            sens_i += 4 * far_below**2
    else:
        t_i, off_i, sens_i = 2 * d_t**2 / 2**37, below**2 / 16, 0.0
    offset = c[2] * 2**16 + c[4] * d_t / 2**7 - off_i
    sensitivity = c[1] * 2**15 + c[3] * d_t / 2**8 - sens_i
    pressure = (d1 * sensitivity / 2**21 - offset) / 2**13  # tenths of a millibar
    return pressure * 10.0, (temperature - t_i) / 100.0
