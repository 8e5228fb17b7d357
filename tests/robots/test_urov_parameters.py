"""Parameters of the underwater vehicle's software: implausible ones are reported by name, where they are written."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest

from snr_sim.prelude.errors import ParameterError
from snr_sim.scenario import library

library.load_robot(library.find("robots", "urov"))

from snr_sim_robot_urov.failsafe_monitor import FailsafeLimits  # noqa: E402
from snr_sim_robot_urov.failsafes import Failsafes, Rearm  # noqa: E402
from snr_sim_robot_urov.parameters import Gains, HoldParameters, Sensors, UrovParameters, vehicle  # noqa: E402

RATES_HZ = Sensors().rates_hz
GAINS = {"kp": 8.0, "ki": 1.5, "kd": 4.0, "output_limit": 8.0}


def parameters(**numbers: Any) -> UrovParameters:
    return UrovParameters(vehicle(), **numbers)


@pytest.mark.parametrize(
    ("make", "numbers", "message"),
    [
        (FailsafeLimits, {"stale_s": math.nan}, "FailsafeLimits.stale_s is nan"),
        (FailsafeLimits, {"stale_s": 250}, r"FailsafeLimits.stale_s is 250: milliseconds\?"),
        (FailsafeLimits, {"lost_s": -2.0}, "FailsafeLimits.lost_s is -2.0"),
        (FailsafeLimits, {"lost_s": 0.1}, r"FailsafeLimits.lost_s \(0.1\) must not be below stale_s \(0.25\)"),
        (FailsafeLimits, {"hold_s": None}, "FailsafeLimits.hold_s is None"),
        (FailsafeLimits, {"low_v": "13"}, "FailsafeLimits.low_v is '13'"),
        (FailsafeLimits, {"low_v": math.inf}, "FailsafeLimits.low_v is inf"),
        (FailsafeLimits, {"sag_ohm": 30}, r"FailsafeLimits.sag_ohm is 30: milliohms\?"),
        (Failsafes, {"leak": "surfce"}, "failsafe leak is 'surfce'"),
        (Failsafes, {"leak": True}, "failsafe leak is True"),
        (Failsafes, {"no_rearm_s": math.nan}, "failsafes' no_rearm_s is nan"),
        (Failsafes, {"line_lost": "warn"}, "line_lost is 'warn', but disarmed outputs do not push"),
        (Failsafes, {"no_rearm": "warn"}, "no_rearm is 'warn', but disarmed outputs"),
        (Failsafes, {"no_rearm": Rearm(5.0)}, "never takes effect: it starts when re-arming is late"),
        (Failsafes, {"leak": Rearm(5.0)}, "never takes effect: it lasts until the next start"),
        (Rearm, {"within_s": 0.0}, "failsafe's Rearm is 0.0"),
        (Rearm, {"within_s": 5000}, r"failsafe's Rearm is 5000: milliseconds\?"),
        (parameters, {"failsafes": {"leak": "surface"}}, "failsafes is {'leak': 'surface'}"),
        (Gains, {**GAINS, "kp": math.nan}, "gain kp is nan"),
        (Gains, {**GAINS, "kd": -4.0}, "gain kd is -4.0"),
        (Gains, {**GAINS, "output_limit": 0.0}, r"gain output_limit is 0\.0(.|\n)*the most that a controller asks for"),
        (HoldParameters, {"depth": 120.0}, "hold's depth is 120.0"),
        (HoldParameters, {"sticks_n": (60.0, 60.0)}, "hold's sticks_n is"),
        (HoldParameters, {"sticks_n": (60.0, math.nan, 60.0)}, "hold's sticks_n of sway is nan"),
        (HoldParameters, {"turn_radps": 40.0}, r"hold's turn_radps is 40.0: degrees\?"),
        (HoldParameters, {"sink_mps": 0.0}, "hold's sink_mps is 0.0"),
        (Sensors, {"depth": 2.0}, "sensor depth is 2.0"),
        (Sensors, {"camera": "down"}, "camera is 'down'"),
        (Sensors, {"rates_hz": {**RATES_HZ, "imu": 0.0}}, "rates_hz of 'imu' is 0.0"),
        (Sensors, {"rates_hz": {**RATES_HZ, "gyro": 50.0}}, "rates_hz has 'gyro'"),
        (Sensors, {"rates_hz": {"imu": 50.0}}, "rates_hz has no entry for 'depth'"),
        (parameters, {"nominal_v": 148.0}, "nominal_v is 148.0"),
        (parameters, {"slew_nps": math.nan}, "slew_nps is nan"),
        (parameters, {"command_hz": 0}, "command_hz is 0"),
        (parameters, {"pwm_hz": -50.0}, "pwm_hz is -50.0"),
        (parameters, {"priority_axes": ("heve",)}, "priority_axes has 'heve', which is not an axis"),
        (parameters, {"port": 91.5}, "port is 91.5, which is not an integer"),
    ],
)
def test_implausible_parameter_raises_error_with_name(
    make: Callable[..., Any], numbers: dict[str, Any], message: str
) -> None:
    with pytest.raises(ParameterError, match=message) as caught:
        make(**numbers)
    assert caught.value.fix
