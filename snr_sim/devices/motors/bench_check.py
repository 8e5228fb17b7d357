"""One motor turned on the bench by its controller, to see which it is, and whether it stops without commands."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from snr_sim.devices.motors.controller_line import ControllerLine
from snr_sim.devices.wire import vesc_messages as vesc
from snr_sim.prelude.errors import DeviceError

DUTY = 0.05  # of the battery's voltage
TURN_S = 1.0
MAX_TIMEOUT_S = 0.3  # of a controller that may drive a wheel
MIN_RATE_RADPS = 0.1  # of a wheel that turns
SLOWER = 0.8  # fraction of its rate that a motor is below as soon as it brakes
_GIVE_UP_S = 2.0
_PERIOD_S = 0.01


def turn(line: ControllerLine[Any], sleep: Callable[[float], None] = time.sleep) -> float:
    """Turn a motor for a second; return the rate that it reached [rad/s]. The controller's timeout ends it."""
    for _ in range(round(TURN_S / _PERIOD_S)):
        line.send(vesc.SetDuty(DUTY))
        line.update()
        sleep(_PERIOD_S)
    return _rate_radps(line)


def measure_timeout(line: ControllerLine[Any], sleep: Callable[[float], None] = time.sleep) -> float:
    """Turn a motor, send no more commands, and return how long it took until it became slower [s].

    Raises:
        DeviceError: it does not turn, or it turns for longer than `MAX_TIMEOUT_S`.
    """
    rate_radps = turn(line, sleep)
    if rate_radps < MIN_RATE_RADPS:
        raise DeviceError(f"{line.title} does not turn its motor.", fix="is the battery connected, and the wheel free?")
    from_s = line.now_s()
    while line.now_s() < from_s + _GIVE_UP_S and _rate_radps(line) > SLOWER * rate_radps:
        sleep(_PERIOD_S)
        line.update()
    line.send(vesc.SetCurrent(0.0))
    took_s = line.now_s() - from_s
    if took_s > MAX_TIMEOUT_S:
        raise DeviceError(
            f"{line.title} drives its motor for {took_s:.2f} s without a command.",
            fix="set its timeout to 250 ms with a brake current of 4 A in VESC Tool, App Settings, General.",
        )
    return took_s


def _rate_radps(line: ControllerLine[Any]) -> float:
    return abs(line.values.speed_radps) if line.values is not None else 0.0
