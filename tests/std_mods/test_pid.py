"""The PID controller, part by part and in closed loops whose course is known in closed form."""

import math

import pytest

from snr_sim.prelude.errors import ParameterError
from snr_sim.std_mods.pid import Pid

DT_S = 0.001


def test_each_part_does_what_the_formula_says() -> None:
    assert Pid(kp=2.0).update(5.0, 3.5, DT_S) == pytest.approx(3.0)
    integral = Pid(kp=0.0, ki=2.0)
    outputs = [integral.update(1.0, 0.5, 0.1) for _ in range(3)]
    assert outputs == pytest.approx([0.1, 0.2, 0.3])
    assert Pid(kp=0.0, kd=4.0).update(0.0, 0.0, DT_S, rate=0.25) == pytest.approx(-1.0)
    assert Pid(kp=0.0).update(0.0, 0.0, DT_S, feed_forward=7.0) == 7.0


def test_a_new_setpoint_does_not_kick_the_derivative() -> None:
    pid = Pid(kp=0.0, kd=10.0)
    for _ in range(3):
        assert pid.update(0.0, 1.0, DT_S) == 0.0
    assert pid.update(100.0, 1.0, DT_S) == 0.0


def test_missing_rate_is_computed_from_measurement() -> None:
    pid = Pid(kp=0.0, kd=2.0)
    outputs = [pid.update(0.0, 0.3 * i * DT_S, DT_S) for i in range(5)]
    assert outputs == pytest.approx([0.0] + [-0.6] * 4)


def test_derivative_filter_is_a_first_order_low_pass() -> None:
    pid = Pid(kp=0.0, kd=1.0, derivative_filter_s=0.1)
    rates = [-pid.update(0.0, 1.0 * i * DT_S, DT_S) for i in range(301)]
    assert rates[100] == pytest.approx(1.0 - math.exp(-1.0), abs=0.004)
    assert rates[300] == pytest.approx(1.0 - math.exp(-3.0), abs=0.004)


def test_pi_on_first_order_plant_equals_closed_form() -> None:
    """x' = (u - x) / T with u = kp e + ki I: a damped oscillation whose course is textbook."""
    lag, kp, ki = 2.0, 3.0, 8.0
    a, b = (1.0 + kp) / (2.0 * lag), ki / lag  # x'' + 2 a x' + b x = b + kp / T d(step)
    w = math.sqrt(b - a * a)
    pid, x = Pid(kp, ki), 0.0
    for k in range(4000):
        t = k * DT_S
        # x(0) = 0 and x'(0) = kp / T
        exact = 1.0 - math.exp(-a * t) * (math.cos(w * t) + (a - kp / lag) / w * math.sin(w * t))
        assert x == pytest.approx(exact, abs=0.003)
        x += (pid.update(1.0, x, DT_S) - x) / lag * DT_S


def overshoot(limits: tuple[float, float]) -> float:
    """How far a body pushed by a PI controller with these limits passes its setpoint, 10 m away."""
    pid, x, v, peak = Pid(kp=4.0, ki=0.5, kd=6.0, limits=limits), 0.0, 0.0, 0.0
    for _ in range(60_000):
        force = pid.update(10.0, x, DT_S, rate=v)
        v += (min(1.0, max(-1.0, force)) - 0.2 * v) * DT_S
        x += v * DT_S
        peak = max(peak, x)
    return peak - 10.0


def test_the_integral_does_not_wind_up_while_the_output_is_at_its_limit() -> None:
    assert overshoot((-1.0, 1.0)) < 0.35 * overshoot((-100.0, 100.0))
    pid = Pid(kp=1.0, ki=1.0, limits=(-2.0, 2.0))
    for _ in range(10_000):
        assert pid.update(100.0, 0.0, DT_S) == 2.0
    assert pid.integral <= 2.0
    assert pid.update(-0.5, 0.0, DT_S) < 0.0, "it comes back at once"


def test_saturated_integral_still_unwinds() -> None:
    pid = Pid(kp=0.0, ki=1.0, limits=(-1.0, 1.0))
    pid.reset(integral=5.0)
    pid.update(0.0, 1.0, 0.5)
    assert pid.integral == pytest.approx(4.5)


def test_an_angle_is_corrected_the_shorter_way_round() -> None:
    pid = Pid(kp=1.0, kd=1.0, is_angle=True)
    assert pid.update(math.radians(-170.0), math.radians(170.0), 0.1) == pytest.approx(math.radians(20.0))
    turned = pid.update(math.radians(-170.0), math.radians(-179.0), 0.1)  # it turned by 11 deg, not by -349
    assert turned == pytest.approx(math.radians(9.0) - math.radians(11.0) / 0.1)


def test_reset_clears_state() -> None:
    pid = Pid(kp=1.0, ki=3.0, kd=0.5)
    first = [pid.update(1.0, 0.1 * i, DT_S) for i in range(5)]
    pid.reset()
    assert [pid.update(1.0, 0.1 * i, DT_S) for i in range(5)] == first


@pytest.mark.parametrize(
    "numbers",
    [
        {"kp": math.nan},
        {"kp": 1.0, "ki": math.inf},
        {"kp": 1.0, "derivative_filter_s": -1.0},
        {"kp": 1, "limits": (1, -1)},
    ],
)
def test_constructor_rejects_invalid_parameters(numbers: dict[str, float]) -> None:
    with pytest.raises(ParameterError, match=list(numbers)[-1]):
        Pid(**numbers)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("setpoint", "measurement", "dt_s"), [(math.nan, 0, 1), (0, math.inf, 1), (0, 0, 0), (0, 0, -1)]
)
def test_non_finite_values_are_rejected_and_keep_state(setpoint: float, measurement: float, dt_s: float) -> None:
    pid = Pid(kp=1.0, ki=1.0)
    with pytest.raises(ParameterError, match="dt_s"):
        pid.update(setpoint, measurement, dt_s)
    assert pid.integral == 0.0
