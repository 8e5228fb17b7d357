"""Thrusters, speed controllers, battery together: against the maker's table, closed forms, the battery's equation."""

import math
import random
from typing import Any

import numpy as np
import pytest

from snr_sim.plants.urov.battery import Battery, BenchSupply, Pack
from snr_sim.plants.urov.propulsion import LAG_S, Propulsion
from snr_sim.plants.urov.t200 import NEWTONS_PER_KGF, curve
from snr_sim.prelude.errors import ParameterError, PlantError, UnknownName

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
def test_settled_thrust_is_what_the_maker_prints(pulse: float, kgf_12: float, kgf_16: float) -> None:
    for volts, kgf in ((12.0, kgf_12), (16.0, kgf_16)):
        forces = run(armed(2, volts), [pulse, STOP], 0.6)
        assert forces == pytest.approx([kgf * NEWTONS_PER_KGF, 0.0], abs=1e-6)


def test_between_the_places_where_it_looks_the_table_up_it_stays_with_the_curve() -> None:
    rng = random.Random(1)
    for _ in range(40):
        pulse, volts = rng.uniform(1100, 1900), rng.uniform(7.0, 20.0)
        thrusters = armed(1, volts)
        run(thrusters, [pulse], 0.6)
        force, current, _ = curve(volts).at(pulse)
        assert thrusters.forces_n[0] == pytest.approx(force, abs=0.01)
        assert thrusters.currents_a[0] == pytest.approx(current, abs=0.02)


@pytest.mark.parametrize("dt_s", [0.002, 0.005, 0.01])
def test_force_follows_with_the_closed_form_of_a_first_order_lag_at_any_step(dt_s: float) -> None:
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


def test_the_lag_is_late_by_as_much_as_the_measured_third_order_response() -> None:
    """The mean delay of a step response is the integral of what it lacks; the published filter, integrated finely."""
    dt = 1e-5
    x = np.zeros(3)  # of 1 / (s^3 + 89 s^2 + 9258 s + 108700)
    lacks = 0.0
    for _ in range(60_000):
        lacks += (1.0 - (108700.0 * x[0] + 6136.0 * x[1])) * dt
        x = x + dt * np.array([x[1], x[2], 1.0 - 108700.0 * x[0] - 9258.0 * x[1] - 89.0 * x[2]])
    assert pytest.approx(lacks, rel=2e-3) == LAG_S


def test_nothing_pushes_before_the_controllers_are_armed() -> None:
    thrusters = Propulsion(3)
    assert run(thrusters, [1700.0] * 3, 0.99) == pytest.approx([0.0] * 3)
    thrusters.reset()
    run(thrusters, [STOP] * 3, 0.995)
    assert not thrusters.is_armed
    thrusters.step(DT_S, [STOP] * 3)
    assert thrusters.is_armed


def test_without_pulses_thrust_dies_and_after_seconds_stop_must_be_shown_again() -> None:
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


def test_a_false_stop_pushes_astern_when_it_is_told_to_stop() -> None:
    thrusters = Propulsion(1, BenchSupply(16.0))
    run(thrusters, [1700.0], 1.0)
    assert run(thrusters, [STOP], 0.6) == pytest.approx([-1.44 * NEWTONS_PER_KGF], abs=1e-6)


def test_settled_current_and_voltage_satisfy_table_and_battery_at_once() -> None:
    pack = Pack(capacity_ah=500.0)
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


def test_full_thrust_on_a_battery_is_less_than_on_a_bench() -> None:
    alone = run(armed(8), [1900.0] + [STOP] * 7, 0.5)[0]
    among_eight = run(armed(8), [1900.0] * 8, 0.5)[0]
    assert among_eight < 0.8 * alone
    assert alone < run(armed(1, 16.8), [1900.0], 0.5)[0]


def test_charge_and_energy_are_what_was_drawn() -> None:
    thrusters = armed(8)
    charge, energy, drawn_as, drawn_j = thrusters.charge, thrusters.energy_j, 0.0, 0.0
    for _ in range(2000):
        volts = thrusters.voltage_v
        thrusters.step(DT_S, [1750.0] * 8)
        drawn_as += thrusters.current_a * DT_S
        drawn_j += thrusters.current_a * volts * DT_S
    assert charge - thrusters.charge == pytest.approx(drawn_as / 3600.0 / 18.0)
    assert thrusters.energy_j - energy == pytest.approx(drawn_j)


def test_an_empty_battery_drives_nothing_and_is_no_error() -> None:
    thrusters = armed(8)
    run(thrusters, [1800.0] * 8, 0.5)
    thrusters.supply.draw(18.0, 15.0, 2 * 3600.0)
    assert run(thrusters, [1800.0] * 8, 1.0) == pytest.approx([0.0] * 8, abs=1e-6)
    assert (thrusters.charge, thrusters.voltage_v) == (0.0, 0.0)
    assert not thrusters.is_armed


def test_a_battery_that_is_nearly_empty_is_cut_off_under_load_and_nothing_turns_any_more() -> None:
    thrusters = Propulsion(8, Battery(charge=0.03))
    run(thrusters, [STOP] * 8, 1.0)
    assert thrusters.is_armed
    run(thrusters, [1900.0] * 8, 0.6)
    assert thrusters.charge > 0.0
    assert (thrusters.voltage_v, thrusters.current_a) == (0.0, 0.0)
    assert not thrusters.is_armed
    assert run(thrusters, [STOP] * 8, 1.5) == pytest.approx([0.0] * 8, abs=1e-6)
    assert not thrusters.is_armed, "no battery, no controllers"


def test_a_supply_that_breaks_down_under_thrust_stops_the_thrusters_and_makes_no_false_stop() -> None:
    """Without a protection circuit it recovers as soon as nothing turns; the pulses command thrust all the time."""
    thrusters = Propulsion(8, Battery(Pack(resistance_ohm=0.2, cutoff_cell_v=None), charge=0.1))
    run(thrusters, [STOP] * 8, 1.0)
    run(thrusters, [1900.0] * 8, 5.0)
    assert thrusters.voltage_v > 12.0
    assert not any(esc.is_armed or esc.has_false_stop for esc in thrusters.escs)
    run(thrusters, [STOP] * 8, 1.0)
    assert np.all(run(thrusters, [1600.0] * 8, 0.5) > 0.0)


def test_failures_do_to_one_thruster_what_they_say_and_nothing_to_the_others() -> None:
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


def test_reset_mends_disarms_and_charges() -> None:
    thrusters = armed(2)
    thrusters.fail(0, "off")
    run(thrusters, [1900.0] * 2, 2.0)
    thrusters.reset()
    fresh = Propulsion(2)
    for pulses in ([STOP] * 2, [1600.0, 1700.0]):
        assert run(thrusters, pulses, 1.2) == pytest.approx(run(fresh, pulses, 1.2), abs=0.0)
        assert thrusters.snapshot() == fresh.snapshot()


def test_restored_it_gives_the_same_bits_again() -> None:
    thrusters = armed(3)
    rng = random.Random(2)
    told = [[rng.choice([None, rng.uniform(1100, 1900)]) for _ in range(3)] for _ in range(60)]
    for pulses in told[:30]:
        run(thrusters, pulses, 0.05)
    snapshot = thrusters.snapshot()
    once = [run(thrusters, pulses, 0.05).tolist() for pulses in told[30:]]
    after = thrusters.snapshot()
    thrusters.fail(1, "off")
    thrusters.restore(snapshot)
    assert [run(thrusters, pulses, 0.05).tolist() for pulses in told[30:]] == once
    assert thrusters.snapshot() == after


def test_a_pulse_beyond_what_the_controller_takes_is_full_thrust() -> None:
    assert run(armed(2, 16.0), [2000.0, 1000.0], 0.6) == pytest.approx(
        [5.25 * NEWTONS_PER_KGF, -4.07 * NEWTONS_PER_KGF], abs=1e-6
    )


@pytest.mark.parametrize("pulse", [math.nan, math.inf, -math.inf, 0.0, 0.5, 15.0, 1e6])
def test_what_is_no_pulse_is_refused_with_the_thruster_and_nothing_changes(pulse: float) -> None:
    thrusters = armed(3)
    before = thrusters.snapshot()
    with pytest.raises(PlantError, match=r"Thruster 1 .*pulse of"):
        thrusters.step(DT_S, [STOP, pulse, STOP])
    assert thrusters.snapshot() == before


@pytest.mark.parametrize("count", [0, 2, 9])
def test_too_many_or_too_few_pulses_are_refused(count: int) -> None:
    with pytest.raises(PlantError, match=f"{count} pulses for 3 thrusters"):
        Propulsion(3).step(DT_S, [STOP] * count)


def test_numbers_that_make_no_sense_are_refused_when_it_is_made() -> None:
    for volts in (0.0, -16.0, 25.2, math.nan):
        with pytest.raises(ParameterError, match="7 to 20 V"):
            Propulsion(8, BenchSupply(volts))
    with pytest.raises(ParameterError, match="7 to 20 V"):
        Propulsion(8, Battery(charge=0.0))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"count": 0}, "number of thrusters is 0"),
        ({"count": 7.5}, "number of thrusters is 7.5, which is no whole number"),
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
def test_a_number_that_cannot_be_is_named_with_what_is_usual(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(ParameterError, match=message) as caught:
        Propulsion(**{"count": 8, **arguments})
    assert caught.value.fix


def test_failures_that_are_none_are_refused() -> None:
    thrusters = Propulsion(2)
    with pytest.raises(UnknownName, match="did you mean 'weak'"):
        thrusters.fail(0, "week")
    with pytest.raises(ParameterError, match="no thruster 2"):
        thrusters.fail(2, "off")
    with pytest.raises(ParameterError, match="share"):
        thrusters.fail(0, "weak", 1.5)


def test_the_mix_of_forces_is_the_matrix_times_the_forces_whatever_happens() -> None:
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
        assert thrusters.mixed(matrix) == pytest.approx(matrix @ thrusters.mean_forces_n, abs=1e-9)
        assert thrusters.current_a == pytest.approx(sum(thrusters.currents_a) + 1.0, abs=1e-9)
    assert thrusters.mixed(other) == pytest.approx(other @ thrusters.mean_forces_n, abs=1e-9)


def test_forces_follow_the_table_as_if_each_was_moved_on_by_itself() -> None:
    """The same pulses and voltages, step by step, by the lag's own equation."""
    thrusters = armed(2)
    share, forces, rng = 1.0 - math.exp(-DT_S / LAG_S), np.zeros(2), random.Random(3)
    pulses = [STOP, STOP]
    for i in range(600):
        if i % 7 == 0 and i < 300:
            pulses = [float(rng.randint(1100, 1900)) for _ in range(2)]
        volts = thrusters.voltage_v
        thrusters.step(DT_S, pulses)
        wanted = np.array([curve.__wrapped__(volts).at(pulse)[0] for pulse in pulses])
        forces += share * (wanted - forces)
        assert thrusters.forces_n == pytest.approx(forces, abs=0.02), "what the straight lines leave of the table"


def test_a_thruster_goes_on_to_the_last_bit_from_where_a_snapshot_was_taken() -> None:
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
            went.append([*thrusters.forces_n, *thrusters.mixed(matrix), thrusters.voltage_v])
        return went

    first = goes_on()
    thrusters.restore(snapshot)
    assert goes_on() == first
