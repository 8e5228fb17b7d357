import math
from typing import Any

import pytest

from snr_sim.plants.battery import Battery, BatteryPack, BenchSupply, cell_v
from snr_sim.prelude.errors import ParameterError


def test_cell_voltage_full_empty_and_mean_equals_data_sheet() -> None:
    assert (cell_v(1.0), cell_v(0.0)) == pytest.approx((4.2, 2.5))
    charges = [(i + 0.5) / 20_000 for i in range(20_000)]
    # "3.7 V" is printed on cells whose mean lies somewhere between 3.6 V and 3.75 V.
    assert sum(map(cell_v, charges)) / len(charges) == pytest.approx(3.7, abs=0.05)


def test_open_circuit_curve_equals_published_table() -> None:
    """Samsung INR21700-40T at C/20, as published; a straight line lies between."""
    published = {0.0352: 3.1179, 0.1357: 3.4193, 0.4523: 3.6941, 0.8392: 4.0664}
    assert {charge: cell_v(charge) for charge in published} == pytest.approx(published)
    assert cell_v(0.5 * (0.4523 + 0.8392)) == pytest.approx(0.5 * (3.6941 + 4.0664))


def test_voltage_rises_with_charge() -> None:
    volts = [cell_v(i / 100) for i in range(101)]
    assert volts == sorted(volts)


def test_voltage_under_load_drops_by_current_times_resistance() -> None:
    battery = Battery(BatteryPack(resistance_ohm=0.04))
    assert battery.voltage_v(0.0) == pytest.approx(16.8)
    assert battery.voltage_v(50.0) == pytest.approx(16.8 - 2.0)


def test_battery_delivers_its_capacity_then_nothing() -> None:
    battery = Battery()
    for _ in range(3600 - 1):
        battery.draw(18.0, 15.0, 1.0)
    assert 0.0 < battery.charge < 0.001
    assert battery.voltage_v(0.0) > 0.0
    battery.draw(18.0, 15.0, 2.0)
    assert battery.charge == 0.0
    assert battery.voltage_v(0.0) == 0.0
    assert battery.energy_j == pytest.approx(18.0 * 15.0 * 3601)


def drawn(battery: Battery, current_a: float, time_s: float, dt_s: float = 0.005) -> float:
    """The voltage after a current has flowed for a time."""
    for _ in range(round(time_s / dt_s)):
        battery.draw(current_a, battery.voltage_v(current_a), dt_s)
    return battery.voltage_v(current_a)


def test_voltage_during_discharge_follows_curve() -> None:
    battery = Battery()
    while battery.charge > 0.02:
        assert battery.voltage_v(5.0) == pytest.approx(4 * cell_v(battery.charge) - 5.0 * 0.03)
        battery.draw(18.0, 14.0, 7.0)


def test_undervoltage_cuts_off_battery_until_reset() -> None:
    battery = Battery(charge=0.05)  # 12.8 V at rest
    assert drawn(battery, 80.0, 2.0) > 10.0
    assert drawn(battery, 110.0, 0.095) < 10.0
    assert not battery.is_cut_off, "so short it may be a motor that starts"
    drawn(battery, 10.0, 0.005)
    assert drawn(battery, 110.0, 0.095) > 0.0, "each time is counted by itself"
    assert drawn(battery, 110.0, 0.010) == 0.0
    assert battery.is_cut_off
    charge, energy_j = battery.charge, battery.energy_j
    assert drawn(battery, 0.0, 5.0) == 0.0, "at rest, too"
    assert (battery.charge, battery.energy_j) == (charge, energy_j)
    battery.reset()
    assert battery.voltage_v(0.0) == pytest.approx(4 * cell_v(0.05))


def test_unprotected_battery_delivers_until_empty() -> None:
    battery = Battery(BatteryPack(cutoff_cell_v=None), charge=0.01)
    assert 0.0 < drawn(battery, 110.0, 1.0) < 10.0
    assert drawn(battery, 110.0, 10.0) == 0.0
    assert battery.charge == 0.0


def test_snapshot_keeps_undervoltage_time() -> None:
    battery = Battery(charge=0.05)
    drawn(battery, 110.0, 0.09)
    snapshot = battery.snapshot()
    drawn(battery, 110.0, 0.5)
    assert battery.is_cut_off
    battery.restore(snapshot)
    assert not battery.is_cut_off
    drawn(battery, 110.0, 0.010)
    assert battery.is_cut_off


def test_reset_restores_initial_charge() -> None:
    battery = Battery(charge=0.8)
    battery.draw(100.0, 15.0, 60.0)
    battery.reset()
    assert (battery.charge, battery.energy_j) == (0.8, 0.0)


@pytest.mark.parametrize(
    ("numbers", "message"),
    [
        ({"cells": 0}, "cells is 0"),
        ({"cells": 4.5}, "cells is 4.5, which is not an integer"),
        ({"cells": "4"}, "cells is '4', which is not a number"),
        ({"cells": True}, "cells is True"),
        ({"capacity_ah": 0.0}, "capacity_ah is 0.0"),
        ({"capacity_ah": math.nan}, "capacity_ah is nan"),
        ({"capacity_ah": 18000}, r"capacity_ah is 18000: milliampere hours\?"),
        ({"resistance_ohm": -0.1}, "resistance_ohm is -0.1"),
        ({"resistance_ohm": 30}, r"resistance_ohm is 30: milliohms\?"),
        ({"cutoff_cell_v": 4.3}, "cutoff_cell_v is 4.3"),
        ({"cutoff_cell_v": 10.0}, r"cutoff_cell_v is 10.0: of four cells\?"),
        ({"cutoff_cell_v": math.nan}, "cutoff_cell_v is nan"),
        ({"cutoff_s": -1.0}, "cutoff_s is -1.0"),
        ({"cutoff_s": 100}, r"cutoff_s is 100: milliseconds\?"),
        ({"cutoff_s": None}, "cutoff_s is None"),
    ],
)
def test_invalid_pack_raises_with_usual_range(numbers: dict[str, Any], message: str) -> None:
    with pytest.raises(ParameterError, match=f"The battery's {message}") as caught:
        BatteryPack(**numbers)
    assert caught.value.fix


@pytest.mark.parametrize("charge", [-0.1, 1.1, math.nan, True, "full", 80])
def test_invalid_charge_raises(charge: Any) -> None:
    with pytest.raises(ParameterError, match="charge"):
        Battery(charge=charge)


def test_non_pack_and_non_number_voltage_raise() -> None:
    with pytest.raises(ParameterError, match="pack is 4"):
        Battery(4)  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="'16'"):
        BenchSupply("16")  # type: ignore[arg-type]
