"""An engine behind servo outputs: its commands as pulses, and the handling of invalid pages."""

import math

import pytest

from snr_sim.devices.pwm.engine_pwm import EngineServos
from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.signals import EngineCommand

SERVOS = EngineServos(gimbal_rad=math.radians(6.0))


@pytest.mark.parametrize(
    "command", [EngineCommand(), EngineCommand(1.0, 0.1, -1.0), EngineCommand(0.1, -0.05, 0.25), EngineCommand(0.6)]
)
def test_a_command_comes_back_from_its_pulses_as_exactly_as_the_steps_allow(command: EngineCommand) -> None:
    steps = [round(pulse * 2) / 2 for pulse in SERVOS.pulses_us(command)]  # steps of half a microsecond
    back = SERVOS.command(steps)
    for field, (_, most) in SERVOS.limits.items():
        assert getattr(back, field) == pytest.approx(getattr(command, field), abs=most / 1600 + 1e-12)


def test_neutral_is_no_thrust_and_pulses_below_it_are_none_either() -> None:
    assert SERVOS.pulses_us(EngineCommand()) == [1500.0, 1500.0, 1500.0]
    assert SERVOS.command([1100.0, 1500.0, 1500.0]) == EngineCommand()


def test_a_nozzle_that_does_not_turn_has_no_servo() -> None:
    with pytest.raises(ParameterError, match="more than 0"):
        EngineServos(0.0)
