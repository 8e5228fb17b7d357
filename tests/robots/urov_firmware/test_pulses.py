"""Pulses at the pins: how wide, how often, how fast they may change."""

import pytest

from snr_sim.devices.wire.mcu_messages import Fault, State

from .conftest import NEUTRAL, Bench

EXACT_US = 0.5
SET_US = (1500.0, 1100.0, 1900.0, 1234.0, 1501.0, 1500.5, 1700.0, 1299.5)


def test_each_pin_has_the_width_that_was_asked_for(bench: Bench) -> None:
    bench.armed()
    bench.drive(SET_US, 200)
    bench.send(bench.command(SET_US))
    for found, wanted in zip(bench.widths(), SET_US, strict=True):
        assert found
        assert all(width == pytest.approx(wanted, abs=EXACT_US) for width in found)
    assert bench.told.widths_us == SET_US
    assert bench.told.state is State.ARMED


def test_h4_the_first_pulse_of_each_pin_is_neutral_and_so_are_all_until_it_is_armed(bench: Bench) -> None:
    bench.ready()
    bench.drive(SET_US, 300)
    assert {pulse.channel for pulse in bench.pulses} == set(range(8))
    assert all(pulse.width_us == pytest.approx(1500.0, abs=EXACT_US) for pulse in bench.pulses)
    assert bench.told.widths_us == NEUTRAL
    assert bench.told.faults == Fault(0)
