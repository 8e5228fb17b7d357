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
def test_engine_servos_command_survives_round_trip(command: EngineCommand) -> None:
    steps = [round(pulse * 2) / 2 for pulse in SERVOS.pulses_us(command)]  # steps of half a microsecond
    back = SERVOS.command(steps)
    for field, (_, high) in SERVOS.limits.items():
        assert getattr(back, field) == pytest.approx(getattr(command, field), abs=high / 1600 + 1e-12)


def test_engine_servos_neutral_and_shorter_pulses_have_no_thrust() -> None:
    assert SERVOS.pulses_us(EngineCommand()) == [1500.0, 1500.0, 1500.0]
    assert SERVOS.command([1100.0, 1500.0, 1500.0]) == EngineCommand()


def test_engine_servos_zero_gimbal_raises_error() -> None:
    with pytest.raises(ParameterError, match="gimbal_rad must be from 0 to pi"):
        EngineServos(0.0)
