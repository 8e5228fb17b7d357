import pytest

from snr_sim.plants.urov.esc import ARMING_S, SILENCE_S, Esc

DT_S = 0.005


def hear(esc: Esc, pulse_us: float | None, time_s: float, supply_v: float = 16.0) -> float:
    """What the thruster turns by after a time of one and the same pulse."""
    acts = 0.0
    for _ in range(round(time_s / DT_S)):
        acts = esc.hear(pulse_us, supply_v, DT_S)
    return acts


def armed() -> Esc:
    esc = Esc()
    hear(esc, 1500.0, ARMING_S)
    return esc


def test_a_second_of_stop_arms_it_and_nothing_turns_before() -> None:
    esc = Esc()
    assert hear(esc, 1500.0, ARMING_S - DT_S) == 1500.0
    assert not esc.is_armed
    hear(esc, 1500.0, DT_S)
    assert esc.is_armed
    assert hear(esc, 1700.0, DT_S) == 1700.0


def test_a_pulse_without_arming_turns_nothing() -> None:
    esc = Esc()
    assert hear(esc, 1700.0, ARMING_S) == 1500.0


def test_pulses_that_wander_do_not_arm_it() -> None:
    esc = Esc()
    for i in range(2000):
        esc.hear(1400.0 + i % 200, 16.0, DT_S)
    assert not esc.is_armed


def test_a_first_pulse_that_is_not_stop_becomes_stop_and_stop_becomes_astern() -> None:
    """As a user reported whose first steady pulse was 1700 us: faster, the farther he went back to 1500."""
    esc = Esc()
    hear(esc, 1700.0, ARMING_S)
    assert esc.has_false_stop
    assert hear(esc, 1700.0, DT_S) == 1500.0
    assert hear(esc, 1500.0, DT_S) == 1300.0
    assert hear(esc, 1100.0, DT_S) == 1100.0  # not beyond full astern


def test_a_first_pulse_close_to_stop_is_stop() -> None:
    esc = Esc()
    hear(esc, 1510.0, ARMING_S)
    assert esc.is_armed
    assert not esc.has_false_stop
    assert hear(esc, 1600.0, DT_S) == 1600.0


def test_without_pulses_it_stops_at_once_and_goes_on_when_they_come_back_soon() -> None:
    esc = armed()
    assert hear(esc, 1800.0, 0.1) == 1800.0
    assert hear(esc, None, DT_S) == 1500.0
    hear(esc, None, SILENCE_S - 3 * DT_S)
    assert hear(esc, 1800.0, DT_S) == 1800.0
    hear(esc, None, SILENCE_S - DT_S)
    assert esc.is_armed, "silence is counted anew"


def test_after_seconds_without_pulses_it_must_be_shown_stop_again() -> None:
    esc = armed()
    hear(esc, None, SILENCE_S)
    assert not esc.is_armed
    assert hear(esc, 1500.0, ARMING_S - DT_S) == 1500.0
    assert hear(esc, 1500.0, DT_S) == 1500.0
    assert hear(esc, 1800.0, DT_S) == 1800.0


def test_a_gap_while_it_is_being_armed_starts_the_second_again() -> None:
    esc = Esc()
    hear(esc, 1500.0, 0.9)
    hear(esc, None, 0.1)
    hear(esc, 1500.0, 0.9)
    assert not esc.is_armed


@pytest.mark.parametrize("supply_v", [0.0, 6.9])
def test_without_voltage_it_forgets_that_it_was_armed(supply_v: float) -> None:
    esc = armed()
    assert hear(esc, 1800.0, DT_S, supply_v) == 1500.0
    assert not esc.is_armed


def test_after_its_voltage_broke_down_it_waits_for_stop_and_never_takes_thrust_for_it() -> None:
    esc = armed()
    hear(esc, 1800.0, DT_S, 6.5)
    assert hear(esc, 1800.0, 10.0) == 1500.0
    assert not esc.is_armed
    hear(esc, 1510.0, ARMING_S - DT_S)
    hear(esc, 1600.0, DT_S)
    hear(esc, 1510.0, ARMING_S - DT_S)
    assert not esc.is_armed, "a second of stop, without a gap"
    hear(esc, 1510.0, DT_S)
    assert esc.is_armed
    assert not esc.has_false_stop
    assert hear(esc, 1800.0, DT_S) == 1800.0


def test_after_silence_too_only_stop_arms_it() -> None:
    esc = armed()
    hear(esc, None, SILENCE_S)
    hear(esc, 1700.0, 2 * ARMING_S)
    assert not esc.is_armed
    hear(esc, 1500.0, ARMING_S)
    assert hear(esc, 1700.0, DT_S) == 1700.0


def test_what_it_was_first_shown_stays_its_stop_whatever_happens_to_its_supply() -> None:
    esc = Esc()
    hear(esc, 1700.0, ARMING_S)
    hear(esc, 1700.0, DT_S, 0.0)
    hear(esc, 1500.0, 2 * ARMING_S)
    assert not esc.is_armed
    hear(esc, 1700.0, ARMING_S)
    assert hear(esc, 1500.0, DT_S) == 1300.0
