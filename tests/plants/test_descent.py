import math

import pytest

from snr_sim.plants.lander.descent import (
    Descent,
    Engine,
    Motion,
    constant_mass_ignition_m,
    find_root,
    free_fall,
    minimum_fuel_descent,
    propagate,
    stop_height,
    time_to_stop,
)
from snr_sim.prelude.errors import ParameterError

EXHAUST_MPS = 311.0 * 9.80665

# The closed-form rows of the reference table: height, speed down, mass, thrust, exhaust speed, idle thrust; then coast,
# ignition height and speed, burn, fuel.
TABLE = {
    "LM_1km": ((1000, 0, 8000, 45040, EXHAUST_MPS, 0), (29.6972, 285.639, 48.1095, 11.8139, 174.465)),
    "LM_lowgate": ((150, 5, 7500, 45040, EXHAUST_MPS, 0), (8.8441, 42.423, 19.3274, 4.3813, 64.702)),
    "LM_60pct": ((1000, 0, 8000, 27024, EXHAUST_MPS, 0), (25.4469, 475.488, 41.224, 22.8826, 202.756)),
    "LM_full_15km": ((15000, 0, 15103, 45040, EXHAUST_MPS, 0), (93.7995, 7873.332, 151.9553, 100.0773, 1477.926)),
    "small": ((500, 10, 1000, 6000, 2500, 0), (15.7263, 142.412, 35.4766, 7.9933, 19.184)),
    "LM_1km_min10pct": ((1000, 0, 8000, 45040, EXHAUST_MPS, 4504), (38.807, 205.1, 40.94, 9.976, 204.63)),
}
DIGITS = {"LM_1km_min10pct": (0.0005, 0.05, 0.005, 0.0005, 0.005)}


def best(case: str) -> Descent:
    (height, speed, mass, thrust, exhaust, idle), _ = TABLE[case]
    return minimum_fuel_descent(Motion(height, -speed, mass), Engine(thrust, exhaust), idle)


@pytest.mark.parametrize("case", TABLE)
def test_minimum_fuel_descent_equals_reference_table(case: str) -> None:
    for value, expected, half_digit in zip(
        best(case), TABLE[case][1], DIGITS.get(case, (0.00005, 0.0005, 0.00005, 0.00005, 0.0005)), strict=True
    ):
        assert value == pytest.approx(expected, abs=half_digit * 1.01)


@pytest.mark.parametrize(
    ("case", "bound_kg", "ignition_m"),
    [
        ("LM_1km", 147.923, 287.744),
        ("LM_lowgate", 55.384, 42.546),
        ("LM_60pct", 147.923, 479.574),
        ("LM_full_15km", 1053.171, 8148.377),
        ("small", 16.452, 143.333),
    ],
)
def test_bounds_equal_reference_table(case: str, bound_kg: float, ignition_m: float) -> None:
    (height, speed, mass, thrust, exhaust, _), _ = TABLE[case]
    start, engine = Motion(height, -speed, mass), Engine(thrust, exhaust)
    # No descent is cheaper than that of an infinitely strong engine, which stops at the ground at once.
    fall_mps = free_fall(start.height_m, start.velocity_mps, engine.gravity_mps2)[1]
    assert -mass * math.expm1(-fall_mps / exhaust) == pytest.approx(bound_kg, abs=0.0006)
    assert constant_mass_ignition_m(start, engine) == pytest.approx(ignition_m, abs=0.0006)
    assert best(case).fuel_kg > bound_kg


def test_minimum_fuel_descent_is_cheapest_of_ignition_grid() -> None:
    engine, start = Engine(45040, EXHAUST_MPS), Motion(1000.0, 0.0, 8000.0)
    cheapest = best("LM_1km")
    for early_s in (0.5, 2.0, 8.0):
        ignition = propagate(start, 0.0, EXHAUST_MPS, 1.62, cheapest.coast_s - early_s)
        # With just so much thrust that it stops at the ground: weaker and longer.
        thrust = find_root(lambda t, at=ignition: -stop_height(at, engine._replace(thrust_n=t)), 20000.0, 45040.0)
        burn_s = time_to_stop(ignition, engine._replace(thrust_n=thrust))
        assert thrust / EXHAUST_MPS * burn_s > cheapest.fuel_kg


# To 3.05 m/s, which the gear takes: propellant [kg]. Integrated outside of this code in steps of 1 ms.
TO_THE_GEAR = {"LM_1km": 163.660, "LM_lowgate": 54.756}
GEAR_MPS = 3.05


@pytest.mark.parametrize("case", TO_THE_GEAR)
def test_minimum_fuel_touchdown_speed_equals_integration(case: str) -> None:
    (height, speed, mass, thrust, exhaust, _), _ = TABLE[case]
    start, engine = Motion(height, -speed, mass), Engine(thrust, exhaust)
    gentle, fast = minimum_fuel_descent(start, engine), minimum_fuel_descent(start, engine, touchdown_mps=GEAR_MPS)
    assert fast.fuel_kg == pytest.approx(TO_THE_GEAR[case], abs=0.001)
    assert fast.fuel_kg < 0.95 * gentle.fuel_kg

    def touchdown(ignite_m: float, dt: float = 1e-3) -> tuple[float, float]:
        """Return speed and propellant of a fall and a burn to the ground, integrated by the midpoint rule."""
        h, v, m, flow = height, -speed, mass, thrust / exhaust
        while h > 0.0:
            on = 1.0 if h <= ignite_m else 0.0
            middle_v = v + 0.5 * dt * (on * thrust / m - 1.62)
            v += dt * (on * thrust / (m - 0.5 * dt * on * flow) - 1.62)
            h, m = h + dt * middle_v, m - dt * on * flow
            if v >= 0.0:
                return 0.0, math.inf  # stopped above the ground
        return -v, mass - m

    speed_mps, fuel_kg = touchdown(fast.ignite_height_m)
    assert speed_mps == pytest.approx(GEAR_MPS, abs=0.05)  # the millisecond of the ignition is worth 0.02 m/s
    assert fuel_kg == pytest.approx(fast.fuel_kg, abs=0.5)


def test_minimum_fuel_descent_to_gear_limit_is_cheapest_of_grid() -> None:
    """Earlier and weaker burns, coming to rest above the ground and falling the rest, and two burns."""
    engine, start = Engine(45040, EXHAUST_MPS), Motion(1000.0, 0.0, 8000.0)
    min_kg = minimum_fuel_descent(start, engine, touchdown_mps=GEAR_MPS).fuel_kg
    drop_m = GEAR_MPS**2 / (2.0 * 1.62)
    fuels = [minimum_fuel_descent(start._replace(height_m=1000.0 - drop_m), engine).fuel_kg]
    weaker = [Engine(share * 45040, EXHAUST_MPS) for share in (0.5, 0.7, 0.9, 0.99)]
    fuels += [minimum_fuel_descent(start, one, touchdown_mps=GEAR_MPS).fuel_kg for one in weaker]
    for coast_s in (1.0, 10.0, 25.0):
        for burn_s in (0.1, 1.0):
            first = propagate(start, 0.0, EXHAUST_MPS, 1.62, coast_s)
            middle = propagate(first, 45040, EXHAUST_MPS, 1.62, burn_s)
            rest = minimum_fuel_descent(middle, engine, touchdown_mps=GEAR_MPS)
            fuels.append(8000.0 - middle.mass_kg + rest.fuel_kg)
    assert min(fuels) > min_kg


def test_fall_within_gear_limit_needs_no_fuel() -> None:
    low = Motion(2.0, 0.0, 8000.0)
    assert minimum_fuel_descent(low, Engine(45040, EXHAUST_MPS), touchdown_mps=GEAR_MPS).fuel_kg == 0.0


def test_propagate_in_two_parts_equals_one_part() -> None:
    start = Motion(300.0, -40.0, 8000.0)
    halfway = propagate(start, 45040, EXHAUST_MPS, 1.62, 3.7)
    assert propagate(halfway, 45040, EXHAUST_MPS, 1.62, 4.1) == pytest.approx(
        propagate(start, 45040, EXHAUST_MPS, 1.62, 7.8), rel=1e-13
    )


def test_propagate_equals_fine_integration() -> None:
    height, velocity, mass, dt = 300.0, -40.0, 8000.0, 1e-4
    for _ in range(50000):
        middle = velocity + 0.5 * dt * (45040 / (mass - 0.25 * dt * 45040 / EXHAUST_MPS) - 1.62)
        height += middle * dt
        velocity += dt * (45040 / (mass - 0.5 * dt * 45040 / EXHAUST_MPS) - 1.62)
        mass -= dt * 45040 / EXHAUST_MPS
    assert propagate(Motion(300.0, -40.0, 8000.0), 45040, EXHAUST_MPS, 1.62, 5.0) == pytest.approx(
        (height, velocity, mass), rel=1e-8
    )


def test_propagate_without_gravity_equals_rocket_equation() -> None:
    assert EXHAUST_MPS * math.log(15103 / 6855) == pytest.approx(2409.1, abs=0.05)
    burn_s = (15103 - 6855) / (45040 / EXHAUST_MPS)
    assert burn_s == pytest.approx(558.5, abs=0.05)
    assert propagate(Motion(0.0, 0.0, 15103.0), 45040, EXHAUST_MPS, 0.0, burn_s).velocity_mps == pytest.approx(
        2409.137, abs=0.001
    )


def test_free_fall_100_m_on_moon_takes_11_s() -> None:
    assert free_fall(100.0, 0.0) == pytest.approx((math.sqrt(200 / 1.62), 18.0))


def test_time_to_stop_when_rising_is_zero() -> None:
    assert time_to_stop(Motion(10.0, 0.5, 8000.0), Engine(45040, EXHAUST_MPS)) == 0.0


def test_late_start_and_weak_engine_raise_with_numbers() -> None:
    with pytest.raises(ParameterError, match="even full thrust is too late"):
        minimum_fuel_descent(Motion(50.0, -60.0, 8000.0), Engine(45040, EXHAUST_MPS))
    with pytest.raises(ParameterError, match="cannot hold 8000 kg"):
        time_to_stop(Motion(50.0, -6.0, 8000.0), Engine(9000, EXHAUST_MPS))
    with pytest.raises(ParameterError, match="already lifts"):
        minimum_fuel_descent(Motion(50.0, 0.0, 1000.0), Engine(45040, EXHAUST_MPS), 2000.0)
