"""Byte formats of an MS5837-30BA: calibration with a check sum, and pressure and temperature from raw counts.

Source: TE Connectivity, MS5837-30BA data sheet C2 of 12/2019 (commands; first and second order compensation);
Measurement Specialties, application note AN520 (the four-bit check sum). docs/ms5837.csv lists counts and each integer
that must result from them.
"""

from __future__ import annotations

from collections.abc import Sequence

from snr_sim.prelude.errors import DeviceError

RESET, READ_ADC, READ_PROM = 0x1E, 0x00, 0xA0
CONVERT_PRESSURE, CONVERT_TEMPERATURE = 0x40, 0x50  # at 256 samples; add 2 for each doubling of samples
ADC_BYTES = 3
PROM_WORDS = 7
_POLYNOMIAL = 0x3000


def crc4(words: Sequence[int]) -> int:
    """Return the check sum of a PROM of eight words, whose own check sum bits are 0.

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
    """Return C0 to C6 of a PROM's seven words, C0 without the check sum; raise a DeviceError if that is wrong."""
    stored, first = words[0] >> 12, words[0] & 0x0FFF
    computed = crc4([first, *words[1:], 0])
    if stored != computed or not any(words[1:]):
        shown = " ".join(f"{word:04x}" for word in words)
        raise DeviceError(
            f"its calibration has the checksum {stored:x}, but {computed:x} is computed: {shown}.",
            fix="use shorter wires or a slower bus; equal words mean another device, or none.",
        )
    return (first, *words[1:])


def compensation(c: Sequence[int], d1: int, d2: int) -> dict[str, int]:
    """Return each step of the data sheet's integer arithmetic, to compare a port in another language with it.

    A division is an arithmetic shift, so it rounds down: only then is TEMP of the data sheet's example 1981. In C, all
    products need 64 bits. Names are those of the data sheet: dT in counts, TEMP [0.01 C], OFF, SENS and P [0.1 mbar]
    of the first order; Ti, OFFi and SENSi are what the second order subtracts, TEMP2 to P2 its results.

    Args:
        c: C0 to C6.
        d1: raw pressure.
        d2: raw temperature.

    >>> c = (0, 34982, 36352, 20328, 22354, 26646, 26146)  # the example of the data sheet, which prints OFF with a slip
    >>> list(compensation(c, 4958179, 6815414).items())[:3]
    [('dT', -5962), ('TEMP', 1981), ('OFF', 2381323464)]
    """
    d_t = d2 - (c[5] << 8)
    temp = 2000 + (d_t * c[6] >> 23)
    off = (c[2] << 16) + (c[4] * d_t >> 7)
    sens = (c[1] << 15) + (c[3] * d_t >> 8)
    below, far_below = temp - 2000, temp + 1500
    if below < 0:
        t_i, off_i, sens_i = 3 * d_t**2 >> 33, 3 * below**2 >> 1, 5 * below**2 >> 3
        if far_below < 0:
            off_i += 7 * far_below**2
            sens_i += 4 * far_below**2
    else:
        t_i, off_i, sens_i = 2 * d_t**2 >> 37, below**2 >> 4, 0
    off_2, sens_2 = off - off_i, sens - sens_i
    p, p_2 = _pressure(d1, sens, off) >> 13, _pressure(d1, sens_2, off_2) >> 13
    first = {"dT": d_t, "TEMP": temp, "OFF": off, "SENS": sens, "P": p, "Ti": t_i, "OFFi": off_i, "SENSi": sens_i}
    return first | {"OFF2": off_2, "SENS2": sens_2, "TEMP2": temp - t_i, "P2": p_2}


def compensated(c: Sequence[int], d1: int, d2: int) -> tuple[float, float]:
    """Return pressure [Pa] and temperature [C] of raw counts, with the second order.

    The pressure keeps the bits that the data sheet's last shift would drop, so its step is one count.

    Args:
        c: C0 to C6.
        d1: raw pressure.
        d2: raw temperature.

    >>> c = (0, 34982, 36352, 20328, 22354, 26646, 26146)  # the example of the data sheet: 3999.8 mbar, 19.81 C
    >>> [round(value, 2) for value in compensated(c, 4958179, 6815414)]
    [399984.03, 19.81]
    """
    steps = compensation(c, d1, d2)
    return _pressure(d1, steps["SENS2"], steps["OFF2"]) * 10.0 / 2**13, steps["TEMP2"] / 100.0


def _pressure(d1: int, sens: int, off: int) -> int:
    """Return P before the last shift, [0.1 mbar / 2^13]."""
    return (d1 * sens >> 21) - off
