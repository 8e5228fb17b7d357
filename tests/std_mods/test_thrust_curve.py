"""The way back through the T200's table: the published pairs themselves, and there and back between them."""

import math

import pytest

from snr_sim.plants.urov.t200 import NEWTONS_PER_KGF, curve
from snr_sim.prelude.errors import ParameterError
from snr_sim.std_mods.thrust_curve import ThrustCurve


def t200(volts: float = 16.0) -> ThrustCurve:
    return ThrustCurve(*curve(volts)[:2])


@pytest.mark.parametrize(
    ("kgf", "pulse"), [(-4.07, 1100), (-2.71, 1200), (-0.48, 1400), (0.60, 1600), (3.42, 1800), (5.25, 1900)]
)
def test_printed_forces_have_the_printed_pulses(kgf: float, pulse: float) -> None:
    assert t200().pulse_us(kgf * NEWTONS_PER_KGF) == pytest.approx(pulse)


@pytest.mark.parametrize("volts", [12.0, 14.8, 16.0])
def test_force_round_trips_through_pulse(volts: float) -> None:
    thruster = t200(volts)
    min_n, max_n = thruster.limits_n
    for i in range(501):
        force = min_n + (max_n - min_n) * i / 500
        pulse = thruster.pulse_us(force)
        assert thruster.force_n(pulse) == pytest.approx(force, abs=1e-9)
        assert curve(volts).at(pulse)[0] == pytest.approx(force, abs=1e-9)


def test_zero_force_is_neutral_and_small_force_skips_dead_band() -> None:
    thruster = t200()
    assert thruster.pulse_us(0.0) == 1500.0
    assert thruster.pulse_us(1e-6) == pytest.approx(1528.0, abs=0.001)
    assert thruster.pulse_us(-1e-6) == pytest.approx(1472.0, abs=0.001)


def test_force_beyond_curve_gives_full_thrust() -> None:
    thruster = t200()
    assert (thruster.pulse_us(1e9), thruster.pulse_us(-1e9)) == (1900.0, 1100.0)
    assert (thruster.pulse_us(math.inf), thruster.pulse_us(-math.inf)) == (1900.0, 1100.0)
    assert (thruster.force_n(5000.0), thruster.force_n(0.0)) == (thruster.limits_n[1], thruster.limits_n[0])


def test_nan_is_rejected() -> None:
    with pytest.raises(ParameterError, match="NaN"):
        t200().pulse_us(math.nan)


@pytest.mark.parametrize(
    ("pulses", "forces"),
    [
        ([1100, 1900], [-1, 1]),
        ([1100, 1500, 1900], [0, 0, 1]),
        ([1100, 1500, 1500], [-1, 0, 1]),
        ([1100, 1400, 1500, 1900], [-1, -2, 0, 1]),
        ([1100, 1500, 1900], [-1, 0, math.nan]),
        ([1100, 1500], [-1, 0, 1]),
        ([], []),
    ],
)
def test_invalid_curve_is_rejected(pulses: list[float], forces: list[float]) -> None:
    with pytest.raises(ParameterError, match="must rise"):
        ThrustCurve(pulses, forces)


def test_stop_pulse_outside_dead_band_is_rejected() -> None:
    with pytest.raises(ParameterError, match="1472 to 1528"):
        ThrustCurve(*curve(16.0)[:2], stop_us=1530.0)
