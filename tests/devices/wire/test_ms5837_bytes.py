"""The data sheet's integers, against its own example, against a port in C, and against its maker's library."""

import csv
import subprocess
from pathlib import Path

import pytest

from snr_sim.devices.wire.ms5837_bytes import compensated, compensation

VECTORS = Path(__file__).parents[3] / "docs" / "ms5837.csv"
PORT = Path(__file__).with_name("ms5837_port.c")
NAMES = ["dT", "TEMP", "OFF", "SENS", "P", "Ti", "OFFi", "SENSi", "OFF2", "SENS2", "TEMP2", "P2"]
EXAMPLE = (0, 34982, 36352, 20328, 22354, 26646, 26146)


def vectors() -> list[dict[str, str]]:
    with VECTORS.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def prom_of(row: dict[str, str]) -> list[int]:
    return [0, *(int(row[f"C{i}"]) for i in range(1, 7))]


def expected(row: dict[str, str]) -> list[int]:
    return [int(row[name]) for name in NAMES]


def test_compensation_equals_data_sheet_example() -> None:
    steps = compensation(EXAMPLE, 4958179, 6815414)
    assert [steps[name] for name in ("dT", "TEMP", "SENS", "P")] == [-5962, 1981, 1145816755, 39998]
    assert steps["OFF"] == 36352 * 2**16 - 1041208 == 2381323464, (
        "it prints 2381326464, which its own equation rules out"
    )
    pressure_pa, temperature_c = compensated(EXAMPLE, 4958179, 6815414)
    assert pressure_pa == pytest.approx(399_984.0, abs=0.5)  # as in its maker's own library: 3999.84 mbar
    assert temperature_c == 19.81


@pytest.mark.parametrize("row", vectors(), ids=lambda row: row["what"])
def test_compensation_equals_documented_vectors(row: dict[str, str]) -> None:
    assert compensation(prom_of(row), int(row["D1"]), int(row["D2"])) == dict(zip(NAMES, expected(row), strict=True))


def test_vectors_cover_each_branch_and_edge() -> None:
    temps = {int(row["TEMP"]) for row in vectors()}
    assert {1999, 2000, -1500, -1501} <= temps
    assert max(int(row["D1"]) * int(row["SENS"]) for row in vectors()).bit_length() == 57
    assert any(int(row["P"]) < 0 for row in vectors())


@pytest.mark.parametrize("d1", [3_000_000, 4_958_179, 8_000_000])
@pytest.mark.parametrize("d2", range(5_000_000, 8_800_000, 190_001))
def test_compensated_equals_makers_library(d1: int, d2: int) -> None:
    """Blue Robotics, ms5837-python, in floating point: the integers drop less than a count of each number."""
    c = EXAMPLE
    d_t = d2 - c[5] * 256
    sens, off = c[1] * 32768 + c[3] * d_t / 256, c[2] * 65536 + c[4] * d_t / 128
    temp = 2000 + d_t * c[6] / 8388608
    off_i, sens_i = (temp - 2000) ** 2 / 16, 0.0
    t_i = 2 * d_t * d_t / 137438953472
    if temp < 2000:
        t_i, off_i, sens_i = 3 * d_t * d_t / 8589934592, 3 * (temp - 2000) ** 2 / 2, 5 * (temp - 2000) ** 2 / 8
        if temp < -1500:
            off_i, sens_i = off_i + 7 * (temp + 1500) ** 2, sens_i + 4 * (temp + 1500) ** 2
    theirs = (d1 * (sens - sens_i) / 2097152 - (off - off_i)) / 8192, temp - t_i
    steps = compensation(c, d1, d2)
    # TEMP is rounded to a hundredth of a degree first, and far from 20 degrees the second order is steep in it.
    cold, very_cold = max(0.0, 2000 - temp), max(0.0, -1500 - temp)
    slope = (cold * (5 / 4 * d1 / 2**21 + 3) + very_cold * (8 * d1 / 2**21 + 14)) / 8192
    assert steps["P2"] == pytest.approx(theirs[0], abs=1.0 + slope)
    assert steps["TEMP2"] == pytest.approx(theirs[1], abs=2.0)
    pressure_pa, temperature_c = compensated(c, d1, d2)
    assert pressure_pa / 10.0 - steps["P2"] == pytest.approx(0.5, abs=0.5)
    assert temperature_c == steps["TEMP2"] / 100.0


def port(folder: Path, *flags: str) -> list[list[int]]:
    """Compile the port in C and run it on the vectors."""
    program = folder / "port"
    subprocess.run(["gcc", "-O1", "-fwrapv", *flags, "-o", program, PORT], check=True)
    output = subprocess.run([program], input=VECTORS.read_bytes(), capture_output=True, check=True).stdout.decode()
    return [[int(number) for number in line.split(",")] for line in output.splitlines()]


@pytest.mark.slow
def test_port_in_c_equals_vectors_and_wrong_port_differs(tmp_path: Path) -> None:
    rows = vectors()
    assert port(tmp_path, "-Wall", "-Werror") == [expected(row) for row in rows]
    for mistake in ("-DWIDE=int32_t", "-DSHIFT(x,n)=((x)/(1LL<<(n)))"):
        found = port(tmp_path, mistake)
        assert found[0] != expected(rows[0]), "the data sheet's own example shows it"
