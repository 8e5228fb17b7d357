import pytest

from snr_sim.plants.urov.esc import ARMING_S, SILENCE_S, Esc

DT_S = 0.005


def hold_pulse(esc: Esc, pulse_us: float | None, time_s: float, supply_v: float = 16.0) -> float:
    """What the thruster turns by after a time of one and the same pulse."""
    acts = 0.0
    for _ in range(round(time_s / DT_S)):
        acts = esc.update(pulse_us, supply_v, DT_S)
    return acts


def armed() -> Esc:
    esc = Esc()
    hold_pulse(esc, 1500.0, ARMING_S)
    return esc


def test_stop_pulse_for_one_second_arms() -> None:
    esc = Esc()
    assert hold_pulse(esc, 1500.0, ARMING_S - DT_S) == 1500.0
    assert not esc.is_armed
    hold_pulse(esc, 1500.0, DT_S)
    assert esc.is_armed
    assert hold_pulse(esc, 1700.0, DT_S) == 1700.0


def test_pulse_before_arming_returns_stop() -> None:
    esc = Esc()
    assert hold_pulse(esc, 1700.0, ARMING_S) == 1500.0


def test_unsteady_pulses_do_not_arm() -> None:
    esc = Esc()
    for i in range(2000):
        esc.update(1400.0 + i % 200, 16.0, DT_S)
    assert not esc.is_armed


def test_wrong_first_pulse_becomes_neutral_and_stop_runs_astern() -> None:
    """As a user reported whose first steady pulse was 1700 us: faster, the farther he went back to 1500."""
    esc = Esc()
    hold_pulse(esc, 1700.0, ARMING_S)
    assert esc.has_wrong_neutral
    assert hold_pulse(esc, 1700.0, DT_S) == 1500.0
    assert hold_pulse(esc, 1500.0, DT_S) == 1300.0
    assert hold_pulse(esc, 1100.0, DT_S) == 1100.0  # not beyond full astern


def test_first_pulse_near_stop_counts_as_stop() -> None:
    esc = Esc()
    hold_pulse(esc, 1510.0, ARMING_S)
    assert esc.is_armed
    assert not esc.has_wrong_neutral
    assert hold_pulse(esc, 1600.0, DT_S) == 1600.0


def test_short_pulse_gap_stops_then_continues() -> None:
    esc = armed()
    assert hold_pulse(esc, 1800.0, 0.1) == 1800.0
    assert hold_pulse(esc, None, DT_S) == 1500.0
    hold_pulse(esc, None, SILENCE_S - 3 * DT_S)
    assert hold_pulse(esc, 1800.0, DT_S) == 1800.0
    hold_pulse(esc, None, SILENCE_S - DT_S)
    assert esc.is_armed, "silence is counted again"


def test_long_pulse_gap_requires_arming_again() -> None:
    esc = armed()
    hold_pulse(esc, None, SILENCE_S)
    assert not esc.is_armed
    assert hold_pulse(esc, 1500.0, ARMING_S - DT_S) == 1500.0
    assert hold_pulse(esc, 1500.0, DT_S) == 1500.0
    assert hold_pulse(esc, 1800.0, DT_S) == 1800.0


def test_pulse_gap_during_arming_restarts_arming() -> None:
    esc = Esc()
    hold_pulse(esc, 1500.0, 0.9)
    hold_pulse(esc, None, 0.1)
    hold_pulse(esc, 1500.0, 0.9)
    assert not esc.is_armed


@pytest.mark.parametrize("supply_v", [0.0, 6.9])
def test_undervoltage_disarms(supply_v: float) -> None:
    esc = armed()
    assert hold_pulse(esc, 1800.0, DT_S, supply_v) == 1500.0
    assert not esc.is_armed


def test_undervoltage_under_thrust_requires_stop_pulse() -> None:
    esc = armed()
    hold_pulse(esc, 1800.0, DT_S, 6.5)
    assert hold_pulse(esc, 1800.0, 10.0) == 1500.0
    assert not esc.is_armed
    hold_pulse(esc, 1510.0, ARMING_S - DT_S)
    hold_pulse(esc, 1600.0, DT_S)
    hold_pulse(esc, 1510.0, ARMING_S - DT_S)
    assert not esc.is_armed, "a second of stop, without a gap"
    hold_pulse(esc, 1510.0, DT_S)
    assert esc.is_armed
    assert not esc.has_wrong_neutral
    assert hold_pulse(esc, 1800.0, DT_S) == 1800.0


def test_thrust_pulse_after_signal_loss_does_not_arm() -> None:
    esc = armed()
    hold_pulse(esc, None, SILENCE_S)
    hold_pulse(esc, 1700.0, 2 * ARMING_S)
    assert not esc.is_armed
    hold_pulse(esc, 1500.0, ARMING_S)
    assert hold_pulse(esc, 1700.0, DT_S) == 1700.0


def test_neutral_pulse_survives_undervoltage() -> None:
    esc = Esc()
    hold_pulse(esc, 1700.0, ARMING_S)
    hold_pulse(esc, 1700.0, DT_S, 0.0)
    hold_pulse(esc, 1500.0, 2 * ARMING_S)
    assert not esc.is_armed
    hold_pulse(esc, 1700.0, ARMING_S)
    assert hold_pulse(esc, 1500.0, DT_S) == 1300.0
