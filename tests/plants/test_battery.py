import math

import pytest

from snr_sim.plants.battery import Battery, Pack, cell_v
from snr_sim.prelude.errors import ParameterError


def test_full_and_on_average_a_cell_has_the_voltages_that_are_printed_on_packs() -> None:
    assert cell_v(1.0) == pytest.approx(4.2)
    charges = [(i + 0.5) / 20_000 for i in range(20_000)]
    assert sum(map(cell_v, charges)) / len(charges) == pytest.approx(3.7, abs=1e-5)


def test_the_shape_over_the_charge_is_the_published_one() -> None:
    """Chen and Rincon-Mora 2006: differences of voltage have the same ratios as those of their formula."""

    def published(s: float) -> float:
        return -1.031 * math.exp(-35 * s) + 3.685 + 0.2156 * s - 0.1178 * s**2 + 0.3201 * s**3

    ratios = [
        (cell_v(a) - cell_v(b)) / (published(a) - published(b))
        for a, b in [(1.0, 0.5), (0.5, 0.1), (0.1, 0.01), (0.05, 0.0)]
    ]
    assert ratios == pytest.approx([ratios[0]] * 4)


def test_voltage_rises_with_charge() -> None:
    volts = [cell_v(i / 100) for i in range(101)]
    assert volts == sorted(volts)


def test_current_costs_voltage() -> None:
    battery = Battery(Pack(resistance_ohm=0.04))
    assert battery.voltage_v(0.0) == pytest.approx(16.8)
    assert battery.voltage_v(50.0) == pytest.approx(16.8 - 2.0)


def test_a_pack_lasts_as_long_as_its_capacity_says_and_then_gives_nothing() -> None:
    battery = Battery()
    for _ in range(3600 - 1):
        battery.draw(18.0, 15.0, 1.0)
    assert 0.0 < battery.charge < 0.001
    assert battery.voltage_v(0.0) > 0.0
    battery.draw(18.0, 15.0, 2.0)
    assert battery.charge == 0.0
    assert battery.voltage_v(0.0) == 0.0
    assert battery.energy_j == pytest.approx(18.0 * 15.0 * 3601)


def test_reset_charges_it_as_it_was() -> None:
    battery = Battery(charge=0.8)
    battery.draw(100.0, 15.0, 60.0)
    battery.reset()
    assert (battery.charge, battery.energy_j) == (0.8, 0.0)


@pytest.mark.parametrize(
    "numbers", [{"cells": 0}, {"capacity_ah": 0.0}, {"capacity_ah": math.nan}, {"resistance_ohm": -0.1}]
)
def test_packs_that_make_no_sense_are_refused(numbers: dict[str, float]) -> None:
    (name,) = numbers
    with pytest.raises(ParameterError, match=name.partition("_")[0]):
        Pack(**numbers)  # type: ignore[arg-type]


@pytest.mark.parametrize("charge", [-0.1, 1.1, math.nan])
def test_a_charge_that_is_none_is_refused(charge: float) -> None:
    with pytest.raises(ParameterError, match="charge"):
        Battery(charge=charge)
