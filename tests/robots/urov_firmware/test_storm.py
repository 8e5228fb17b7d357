"""Whatever is asked for, in whatever order, with resets in between: what must never be seen at a pin is not seen."""

import random

import pytest

from snr_sim.devices.wire.mcu_messages import (
    Arm,
    ClearStop,
    Disarm,
    EmergencyStop,
    Hello,
    McuState,
    Telemetry,
    ToMcu,
)

from .conftest import NEUTRAL, SESSION, Bench

STEPS = 1200
LIMITS_US = (1099.5, 1900.5)
SLEW_US_PER_MS = 4.0
RARE: list[ToMcu] = [
    Disarm(SESSION),
    EmergencyStop(),
    ClearStop(SESSION),
    ClearStop(SESSION),
    Hello(SESSION),
    Hello(SESSION),
    Hello(SESSION + 1),
]


def do_something(bench: Bench, rng: random.Random) -> bool:
    """Return whether the board was reset."""
    what = rng.random()
    if what < 0.55:
        some = tuple(rng.choice([1500.0, rng.randrange(2000, 4000) / 2]) for _ in NEUTRAL)
        bench.send(bench.command(rng.choice([some, NEUTRAL]), age_ms=rng.choice([0, 0, 0, 50, 150, 250])))
    elif what < 0.70:
        bench.send(bench.command(NEUTRAL), Arm(SESSION))
    elif what < 0.73:
        bench.send(rng.choice(RARE))
    elif what < 0.80:
        bench.board.uart_in(rng.randbytes(rng.randrange(40)))
    elif what < 0.803:
        bench.board.run_us(rng.randrange(8000))
        bench.board.reset()
        return True
    elif what < 0.81:
        bench.run(rng.randrange(100, 400))
    return False


@pytest.mark.parametrize("seed", [1, 2])
def test_h7_random_commands_keep_limits_slew_and_arming(bench: Bench, seed: int) -> None:
    rng = random.Random(seed)
    bench.ready()
    reset_us, last, armed = 0.0, dict.fromkeys(range(8), (0.0, 1500.0)), 0
    for _ in range(STEPS):
        bench.received.clear()
        bench.pulses.clear()
        if do_something(bench, rng):
            reset_us, last = bench.board.now_us, dict.fromkeys(range(8), (bench.board.now_us, 1500.0))
        bench.run(rng.choice([3, 10, 10, 17]))
        for message in bench.received:
            if isinstance(message, Telemetry):
                armed += message.state is McuState.ARMED
                assert message.state is McuState.ARMED or message.widths_us == NEUTRAL
        for pulse in bench.pulses:
            if pulse.rise_us < reset_us:
                continue  # cut off
            before_us, width_us = last[pulse.channel]
            last[pulse.channel] = pulse.rise_us, pulse.width_us
            may_us = SLEW_US_PER_MS * (round((pulse.rise_us - before_us) / 1000) + 1) + 1.0
            assert LIMITS_US[0] <= pulse.width_us <= LIMITS_US[1]
            assert abs(pulse.width_us - width_us) <= may_us or abs(pulse.width_us - 1500.0) <= 1.0
    assert armed > 100
