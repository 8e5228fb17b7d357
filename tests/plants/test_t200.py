"""The T200's curves: against the numbers its maker prints, at voltages that were measured and between them."""

import numpy as np
import pytest

from snr_sim.plants.urov.t200 import NEWTONS_PER_KGF, curve, load_table
from snr_sim.prelude.errors import ParameterError

# From the maker's public performance data: [pulse us, kgf at 12 V, kgf at 16 V, A at 16 V].
PRINTED = (
    (1100, -2.90, -4.07, 24.3),
    (1200, -1.95, -2.71, 11.9),
    (1300, -1.02, -1.44, 4.4),
    (1400, -0.32, -0.48, 0.7),
    (1600, 0.39, 0.60, 0.8),
    (1700, 1.28, 1.82, 4.58),
    (1800, 2.46, 3.42, 11.9),
    (1900, 3.71, 5.25, 23.8),
)
DEAD_BANDS = {
    10: (1460, 1540),
    12: (1464, 1536),
    14: (1468, 1532),
    16: (1472, 1528),
    18: (1472, 1528),
    20: (1476, 1528),
}
VOLTAGES = [7.0, 8.3, 9.99, 10.0, 11.0, 12.7, 14.8, 16.0, 16.79, 18.5, 19.99, 20.0]


@pytest.mark.parametrize("row", PRINTED, ids=lambda row: str(row[0]))
def test_curve_equals_data_sheet(row: tuple[float, ...]) -> None:
    pulse, kgf_12, kgf_16, amperes = row
    assert curve(12.0).at(pulse)[0] / NEWTONS_PER_KGF == pytest.approx(kgf_12, abs=1e-9)
    force, current = curve(16.0).at(pulse)
    assert force / NEWTONS_PER_KGF == pytest.approx(kgf_16, abs=1e-9)
    assert current == pytest.approx(amperes, rel=0.005)


@pytest.mark.parametrize("voltage", sorted(load_table()))
def test_curve_at_measured_voltage_keeps_table(voltage: float) -> None:
    table = load_table()[voltage]
    for i, pulse in enumerate(table.pulses_us):
        assert curve(voltage).at(pulse) == pytest.approx([column[i] for column in table[1:]], abs=1e-9)


@pytest.mark.parametrize(("voltage", "band"), DEAD_BANDS.items())
def test_dead_band_equals_measurement(voltage: float, band: tuple[float, float]) -> None:
    assert curve(voltage).dead_band_us == pytest.approx(band)


def test_dead_band_between_voltages_is_interpolated() -> None:
    assert curve(13.0).dead_band_us == pytest.approx((1466.0, 1534.0))
    assert curve(15.0).dead_band_us == pytest.approx((1470.0, 1530.0))
    assert curve(13.0).at(1533.5)[0] == 0.0  # though at 14 V it would push already
    assert curve(13.0).at(1534.5)[0] > 0.0  # though at 12 V it would not yet


def test_full_thrust_between_voltages_is_mean() -> None:
    assert curve(15.0).at(1900.0)[0] / NEWTONS_PER_KGF == pytest.approx((4.52 + 5.25) / 2)
    assert curve(15.0).at(1100.0)[0] / NEWTONS_PER_KGF == pytest.approx(-(3.52 + 4.07) / 2)


@pytest.mark.parametrize("voltage", VOLTAGES)
def test_force_is_monotonic_and_zero_in_dead_band(voltage: float) -> None:
    pulses = np.arange(1100.0, 1900.5, 0.5)
    forces, currents = np.array([curve(voltage).at(pulse) for pulse in pulses]).T
    assert np.all(np.diff(forces) >= 0.0)
    still = forces == 0.0
    assert pulses[still][0] == pytest.approx(curve(voltage).dead_band_us[0], abs=0.5)
    assert np.all(currents[still] == 0.0)
    assert np.all(currents[~still] > 0.0)


def test_thrust_is_continuous_in_voltage() -> None:
    volts = np.linspace(7.0, 20.0, 261)
    for pulse in (1100.0, 1380.0, 1537.0, 1610.0, 1900.0):
        forces = np.array([curve.__wrapped__(float(volt)).at(pulse)[0] for volt in volts])
        assert np.abs(np.diff(forces)).max() < 0.25  # N per 0.05 V; full thrust changes by 3.9 N per V


def test_full_thrust_below_table_extrapolates() -> None:
    falls = [curve(volts).at(1900.0)[0] / curve(volts * 12.0 / 10.0).at(1900.0)[0] for volts in (8.0, 10.0)]
    assert falls[0] == pytest.approx(falls[1], rel=0.01)


@pytest.mark.parametrize("voltage", [0.0, 6.9, 20.1, -12.0, float("nan"), float("inf")])
def test_voltage_out_of_range_raises(voltage: float) -> None:
    with pytest.raises(ParameterError, match="7 to 20 V"):
        curve(voltage)
