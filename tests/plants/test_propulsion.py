"""Thrusters, speed controllers, battery together: against the maker's table, closed forms, the battery's equation."""

import math
import random
from typing import Any

import numpy as np
import pytest

from snr_sim.plants.battery import Battery, BatteryPack, BenchSupply
from snr_sim.plants.urov.propulsion import LAG_S, Propulsion
from snr_sim.plants.urov.t200 import NEWTONS_PER_KGF, curve
from snr_sim.prelude.errors import ParameterError, PlantError, UnknownNameError

DT_S = 0.005
STOP = 1500.0


def armed(count: int = 8, volts: float | None = None, **kwargs: float) -> Propulsion:
    """Thrusters whose controllers have received a second of stop, on a bench supply if a voltage is given."""
    thrusters = Propulsion(count, None if volts is None else BenchSupply(volts), **kwargs)
    run(thrusters, [STOP] * count, 1.0)
    return thrusters


def run(thrusters: Propulsion, pulses: list[float | None] | list[float], time_s: float) -> np.ndarray:
    for _ in range(round(time_s / DT_S)):
        thrusters.step(DT_S, pulses)
    return np.array(thrusters.forces_n)


@pytest.mark.parametrize(
    ("pulse", "kgf_12", "kgf_16"),
    [(1100, -2.90, -4.07), (1300, -1.02, -1.44), (1528, 0.0, 0.0), (1600, 0.39, 0.60), (1900, 3.71, 5.25)],
)
def test_settled_thrust_equals_data_sheet(pulse: float, kgf_12: float, kgf_16: float) -> None:
    for volts, kgf in ((12.0, kgf_12), (16.0, kgf_16)):
        forces = run(armed(2, volts), [pulse, STOP], 0.6)
        assert forces == pytest.approx([kgf * NEWTONS_PER_KGF, 0.0], abs=1e-6)


def test_interpolated_thrust_stays_near_curve() -> None:
    rng = random.Random(1)
    for _ in range(40):
        pulse, volts = rng.uniform(1100, 1900), rng.uniform(7.0, 20.0)
        thrusters = armed(1, volts)
        run(thrusters, [pulse], 0.6)
        force, current = curve(volts).at(pulse)
        assert thrusters.forces_n[0] == pytest.approx(force, abs=0.01)
        assert thrusters.currents_a[0] == pytest.approx(current, abs=0.02)


@pytest.mark.parametrize("dt_s", [0.002, 0.005, 0.01])
def test_force_follows_first_order_lag_for_any_step(dt_s: float) -> None:
    thrusters = Propulsion(1, BenchSupply(16.0))
    for _ in range(round(1.0 / dt_s)):
        thrusters.step(dt_s, [STOP])
    full = 5.25 * NEWTONS_PER_KGF
    for k in range(1, 20):
        thrusters.step(dt_s, [1900.0])
        force = thrusters.forces_n[0]
        assert force == pytest.approx(full * (1.0 - math.exp(-k * dt_s / LAG_S)), rel=1e-9)
        # What moves the vehicle is the mean of the step: with that of its end it would be ahead by half a step.
        lacks = LAG_S / dt_s * (math.exp(-(k - 1) * dt_s / LAG_S) - math.exp(-k * dt_s / LAG_S))
        assert thrusters.mean_forces_n[0] == pytest.approx(full * (1.0 - lacks), rel=1e-9)


def test_lag_equals_delay_of_measured_third_order_response() -> None:
    """The mean delay of a step response is the integral of what it lacks; the published filter, integrated finely."""
    dt = 1e-5
    x = np.zeros(3)  # of 1 / (s^3 + 89 s^2 + 9258 s + 108700)
    lacks = 0.0
    for _ in range(60_000):
        lacks += (1.0 - (108700.0 * x[0] + 6136.0 * x[1])) * dt
        x = x + dt * np.array([x[1], x[2], 1.0 - 108700.0 * x[0] - 9258.0 * x[1] - 89.0 * x[2]])
    assert pytest.approx(lacks, rel=2e-3) == LAG_S


def test_thrust_before_arming_is_zero() -> None:
    thrusters = Propulsion(3)
    assert run(thrusters, [1700.0] * 3, 0.99) == pytest.approx([0.0] * 3)
    thrusters.reset()
    run(thrusters, [STOP] * 3, 0.995)
    assert not thrusters.is_armed
    thrusters.step(DT_S, [STOP] * 3)
    assert thrusters.is_armed


def test_pulse_loss_stops_thrust_and_later_requires_arming() -> None:
    thrusters = armed(2)
    run(thrusters, [1800.0, 1800.0], 0.5)
    assert run(thrusters, [None, 1800.0], 0.5) == pytest.approx([0.0, thrusters.forces_n[1]], abs=1e-5)
    run(thrusters, [None, 1800.0], 5.0)
    forces = run(thrusters, [1800.0, 1800.0], 0.5)
    assert forces[0] == pytest.approx(0.0, abs=1e-6)
    assert forces[1] > 10.0
    run(thrusters, [None, None], 6.0)
    run(thrusters, [STOP] * 2, 1.0)
    assert np.all(run(thrusters, [1800.0, 1800.0], 0.5) > 10.0)


def test_wrong_neutral_pushes_astern_at_stop_pulse() -> None:
    thrusters = Propulsion(1, BenchSupply(16.0))
    run(thrusters, [1700.0], 1.0)
    assert run(thrusters, [STOP], 0.6) == pytest.approx([-1.44 * NEWTONS_PER_KGF], abs=1e-6)


def test_settled_current_and_voltage_satisfy_table_and_battery() -> None:
    pack = BatteryPack(capacity_ah=500.0)
    thrusters = Propulsion(8, Battery(pack), electronics_a=1.5)
    run(thrusters, [STOP] * 8, 1.0)
    run(thrusters, [1100.0] * 4 + [1900.0] * 4, 1.0)
    low, high = 7.0, 16.8  # the voltage at which the battery gives what the thrusters draw there, by bisection
    for _ in range(60):
        volts = 0.5 * (low + high)
        drawn = 1.5 + 4 * curve.__wrapped__(volts).at(1100.0)[1] + 4 * curve.__wrapped__(volts).at(1900.0)[1]
        low, high = (volts, high) if volts < 16.8 - pack.resistance_ohm * drawn else (low, volts)
    assert thrusters.voltage_v == pytest.approx(low, abs=0.01)
    assert thrusters.current_a == pytest.approx(drawn, rel=0.002)
    assert 125.0 < drawn < 150.0, "above what a real pack's protection lets pass"


def test_full_thrust_on_battery_is_less_than_on_bench_supply() -> None:
    alone = run(armed(8), [1900.0] + [STOP] * 7, 0.5)[0]
    among_eight = run(armed(8), [1900.0] * 8, 0.5)[0]
    assert among_eight < 0.8 * alone
    assert alone < run(armed(1, 16.8), [1900.0], 0.5)[0]


def test_charge_and_energy_equal_integrated_current() -> None:
    thrusters = armed(8)
    charge, energy, drawn_as, drawn_j = thrusters.charge, thrusters.energy_j, 0.0, 0.0
    for _ in range(2000):
        volts = thrusters.voltage_v
        thrusters.step(DT_S, [1750.0] * 8)
        drawn_as += thrusters.current_a * DT_S
        drawn_j += thrusters.current_a * volts * DT_S
    assert charge - thrusters.charge == pytest.approx(drawn_as / 3600.0 / 18.0)
    assert thrusters.energy_j - energy == pytest.approx(drawn_j)


def test_empty_battery_gives_no_thrust_and_no_error() -> None:
    thrusters = armed(8)
    run(thrusters, [1800.0] * 8, 0.5)
    thrusters.supply.draw(18.0, 15.0, 2 * 3600.0)
    assert run(thrusters, [1800.0] * 8, 1.0) == pytest.approx([0.0] * 8, abs=1e-6)
    assert (thrusters.charge, thrusters.voltage_v) == (0.0, 0.0)
    assert not thrusters.is_armed


def test_nearly_empty_battery_is_cut_off_under_load() -> None:
    thrusters = Propulsion(8, Battery(charge=0.03))
    run(thrusters, [STOP] * 8, 1.0)
    assert thrusters.is_armed
    run(thrusters, [1900.0] * 8, 0.6)
    assert thrusters.charge > 0.0
    assert (thrusters.voltage_v, thrusters.current_a) == (0.0, 0.0)
    assert not thrusters.is_armed
    assert run(thrusters, [STOP] * 8, 1.5) == pytest.approx([0.0] * 8, abs=1e-6)
    assert not thrusters.is_armed, "no battery, no controllers"


def test_supply_failure_under_thrust_stops_without_wrong_neutral() -> None:
    """Without a protection circuit it recovers as soon as nothing turns; the pulses command thrust all the time."""
    thrusters = Propulsion(8, Battery(BatteryPack(resistance_ohm=0.2, cutoff_cell_v=None), charge=0.1))
    run(thrusters, [STOP] * 8, 1.0)
    run(thrusters, [1900.0] * 8, 5.0)
    assert thrusters.voltage_v > 12.0
    assert not any(esc.is_armed or esc.has_wrong_neutral for esc in thrusters.escs)
    run(thrusters, [STOP] * 8, 1.0)
    assert np.all(run(thrusters, [1600.0] * 8, 0.5) > 0.0)


def test_fault_changes_one_thruster_only() -> None:
    thrusters = armed(4, 16.0)
    full = 5.25 * NEWTONS_PER_KGF
    run(thrusters, [1900.0] * 4, 0.6)
    thrusters.fail(0, "off")
    thrusters.fail(1, "weak", 0.3)
    thrusters.fail(2, "stuck")
    assert run(thrusters, [1900.0] * 4, 0.6) == pytest.approx([0.0, 0.3 * full, full, full], abs=1e-6)
    assert thrusters.currents_a == pytest.approx([0.0, 23.83, 23.83, 23.83], abs=1e-6)
    assert run(thrusters, [STOP] * 4, 0.6) == pytest.approx([0.0, 0.0, full, 0.0], abs=1e-6)
    for i in range(3):
        thrusters.fail(i, "none")
    assert run(thrusters, [1900.0] * 4, 0.6) == pytest.approx([full] * 4, abs=1e-6)


def test_reset_clears_faults_disarms_and_charges() -> None:
    thrusters = armed(2)
    thrusters.fail(0, "off")
    run(thrusters, [1900.0] * 2, 2.0)
    thrusters.reset()
    fresh = Propulsion(2)
    for pulses in ([STOP] * 2, [1600.0, 1700.0]):
        assert run(thrusters, pulses, 1.2) == pytest.approx(run(fresh, pulses, 1.2), abs=0.0)
        assert thrusters.snapshot() == fresh.snapshot()


def test_restored_propulsion_repeats_bitwise() -> None:
    thrusters = armed(3)
    rng = random.Random(2)
    commands = [[rng.choice([None, rng.uniform(1100, 1900)]) for _ in range(3)] for _ in range(60)]
    for pulses in commands[:30]:
        run(thrusters, pulses, 0.05)
    snapshot = thrusters.snapshot()
    once = [run(thrusters, pulses, 0.05).tolist() for pulses in commands[30:]]
    after = thrusters.snapshot()
    thrusters.fail(1, "off")
    thrusters.restore(snapshot)
    assert [run(thrusters, pulses, 0.05).tolist() for pulses in commands[30:]] == once
    assert thrusters.snapshot() == after


def test_pulse_beyond_range_is_full_thrust() -> None:
    assert run(armed(2, 16.0), [2000.0, 1000.0], 0.6) == pytest.approx(
        [5.25 * NEWTONS_PER_KGF, -4.07 * NEWTONS_PER_KGF], abs=1e-6
    )


@pytest.mark.parametrize("pulse", [math.nan, math.inf, -math.inf, 0.0, 0.5, 15.0, 1e6])
def test_invalid_pulse_raises_with_thruster_and_changes_nothing(pulse: float) -> None:
    thrusters = armed(3)
    before = thrusters.snapshot()
    with pytest.raises(PlantError, match=r"Thruster 1 .*pulse of"):
        thrusters.step(DT_S, [STOP, pulse, STOP])
    assert thrusters.snapshot() == before


@pytest.mark.parametrize("count", [0, 2, 9])
def test_wrong_number_of_pulses_raises(count: int) -> None:
    with pytest.raises(PlantError, match=f"{count} pulses for 3 thrusters"):
        Propulsion(3).step(DT_S, [STOP] * count)


def test_invalid_numbers_raise_at_construction() -> None:
    for volts in (0.0, -16.0, 25.2, math.nan):
        with pytest.raises(ParameterError, match="7 to 20 V"):
            Propulsion(8, BenchSupply(volts))
    with pytest.raises(ParameterError, match="7 to 20 V"):
        Propulsion(8, Battery(charge=0.0))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"count": 0}, "number of thrusters is 0"),
        ({"count": 7.5}, "number of thrusters is 7.5, which is not an integer"),
        ({"count": True}, "number of thrusters is True"),
        ({"lag_s": 0.0}, "lag_s is 0.0"),
        ({"lag_s": math.nan}, "lag_s is nan"),
        ({"lag_s": None}, "lag_s is None"),
        ({"lag_s": 29.0}, r"lag_s is 29.0: milliseconds\?"),
        ({"electronics_a": math.nan}, "electronics_a is nan"),
        ({"electronics_a": -5.0}, "electronics_a is -5.0"),
        ({"electronics_a": "1"}, "electronics_a is '1'"),
        ({"electronics_a": 1500}, r"electronics_a is 1500: milliamperes\?"),
        ({"supply": 16.0}, "supply of the thrusters is 16.0"),
    ],
)
def test_invalid_number_raises_with_usual_range(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(ParameterError, match=message) as caught:
        Propulsion(**{"count": 8, **arguments})
    assert caught.value.fix


def test_invalid_fault_raises() -> None:
    thrusters = Propulsion(2)
    with pytest.raises(UnknownNameError, match="did you mean 'weak'"):
        thrusters.fail(0, "week")
    with pytest.raises(ParameterError, match="no thruster 2"):
        thrusters.fail(2, "off")
    with pytest.raises(ParameterError, match="effectiveness"):
        thrusters.fail(0, "weak", 1.5)


def test_mix_forces_equals_matrix_times_forces() -> None:
    rng = random.Random(2)
    matrix, other = (np.array([[rng.uniform(-1.0, 1.0) for _ in range(8)] for _ in range(6)]) for _ in range(2))
    thrusters = armed(8)
    pulses = [STOP] * 8
    for i in range(400):
        if i % 3 == 0:
            pulses = [rng.uniform(1100.0, 1900.0) for _ in range(8)]
        if i == 200:
            thrusters.fail(3, "weak", 0.4)
        thrusters.step(DT_S, pulses)
        assert thrusters.mix_forces(matrix) == pytest.approx(matrix @ thrusters.mean_forces_n, abs=1e-9)
        assert thrusters.current_a == pytest.approx(sum(thrusters.currents_a) + 1.0, abs=1e-9)
    assert thrusters.mix_forces(other) == pytest.approx(other @ thrusters.mean_forces_n, abs=1e-9)


def test_forces_equal_separate_integration() -> None:
    """The same pulses and voltages, step by step, by the lag's own equation."""
    thrusters = armed(2)
    share, forces, rng = 1.0 - math.exp(-DT_S / LAG_S), np.zeros(2), random.Random(3)
    pulses = [STOP, STOP]
    for i in range(600):
        if i % 7 == 0 and i < 300:
            pulses = [float(rng.randint(1100, 1900)) for _ in range(2)]
        volts = thrusters.voltage_v
        thrusters.step(DT_S, pulses)
        expected = np.array([curve.__wrapped__(volts).at(pulse)[0] for pulse in pulses])
        forces += share * (expected - forces)
        assert thrusters.forces_n == pytest.approx(forces, abs=0.02), "what the straight lines leave of the table"


def test_restored_thruster_continues_bitwise() -> None:
    matrix = np.array([[1.0, -2.0, 0.5]])
    thrusters = armed(3)
    course = [[1500.0 + 30.0 * (i // 4 % 9), 1700.0, 1400.0 - i] for i in range(40)]
    for pulses in course:
        thrusters.step(DT_S, pulses)
    snapshot = thrusters.snapshot()

    def goes_on() -> list[list[float]]:
        went = []
        for pulses in course:
            thrusters.step(DT_S, pulses)
            went.append([*thrusters.forces_n, *thrusters.mix_forces(matrix), thrusters.voltage_v])
        return went

    first = goes_on()
    thrusters.restore(snapshot)
    assert goes_on() == first
