"""Results of the rover's motion that are known without a simulation."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache

import numpy as np

from snr_sim.plants.ground.height_map import make_hills, ramp
from snr_sim.plants.ground.rocks import Ledge
from snr_sim.plants.ground.rover import RoverStart

from .case import Case
from .rover_arm import arm
from .rover_kin import planar_vehicles
from .rover_limits import in_the_air, tipping
from .rover_plane import beside_mujoco, in_plane
from .rover_power import energy, stalled
from .rover_runs import (
    COUNT,
    FRICTION,
    GRAVITY,
    LEFT,
    MOTOR,
    RADIUS_M,
    REGULARISED,
    ROVER_STEPS_S,
    SOFT,
    STRONG,
    VEHICLE,
    Turn,
    balance,
    go,
    made,
    mass_height_m,
    motors,
    parts_of_a_side,
    place,
    rates,
    rolling_radius_m,
    shared,
    slope,
    speed_mps,
    suspension,
    turn,
)
from .rover_soil import coasting, on_soil, pulling, sunken


def loads_at_rest() -> list[Case]:
    """Loads by the rule of levers: chassis and rocker are one body, the differential holds them; the bogie another."""
    front, middle, back = (wheel.position_m[0] for wheel in VEHICLE.wheels[LEFT])
    pivot = suspension().bogie_pivot_m[0]
    rocker, bogie = parts_of_a_side()
    on_front, on_bogie = shared(rocker, front, pivot)
    expected = [on_front, *shared(bogie, middle, back, (on_bogie, pivot))]

    @cache
    def found(step_s: float) -> list[float]:
        return go(made(step_s), 3.0, "brake", 6.0).contacts.read_loads()

    names = ("front", "middle", "back")
    return [
        Case("At rest", f"load of the {name} wheel", load, "N", lambda s, i=i: found(s)[i], 0.005, SOFT)
        for i, (name, load) in enumerate(zip(names, expected, strict=True))
    ]


def leaning() -> list[Case]:
    """On a slope across, the upper wheels carry weight / 2 * (cos - height / half the track * sin)."""
    half_m, height_m = VEHICLE.wheels[0].position_m[1], mass_height_m()

    def upper(degrees: float) -> Callable[[float], float]:
        def run(step_s: float) -> float:
            ground = ramp((0.0, math.tan(math.radians(degrees))), 40.0)
            rover = go(made(step_s, ground, vehicle=STRONG), 4.0, "brake", 60.0)
            return sum(rover.contacts.read_loads()[LEFT])

        return run

    def expected(degrees: float) -> float:
        angle = math.radians(degrees)
        return 0.5 * VEHICLE.mass_kg * GRAVITY * (math.cos(angle) - height_m / half_m * math.sin(angle))

    why = "the lower tyres are pressed deeper, which leans it a little more"
    return [
        Case(
            "At rest",
            f"{degrees:g} degrees across the slope: load of the upper side",
            expected(degrees),
            "N",
            upper(degrees),
            0.01,
            why,
        )
        for degrees in (10.0, 20.0)
    ]


def rolling() -> list[Case]:
    """Way over angle of a wheel is the distance from its axle to the middle of the contact."""

    def radius(step_s: float) -> float:
        rover = go(made(step_s), 2.0, "speed", 6.0)
        x_m, turned = place(rover)[0], [motor.turned_rad for motor in motors(rover)]
        go(rover, 2.0)
        angles = [after.turned_rad - before for after, before in zip(motors(rover), turned, strict=True)]
        return float(place(rover)[0] - x_m) / (sum(angles) / COUNT)

    def expected() -> float:
        return rolling_radius_m(go(made(0.001), 3.0, "brake", 6.0))

    return [Case("Driving", "way of a wheel over its angle", expected, "m", radius, 0.002, REGULARISED)]


def turning() -> list[Case]:
    """Turning rate at which friction of six sliding wheels is in balance."""

    @cache
    def found(step_s: float, left: float, right: float) -> Turn:
        return turn(made(step_s), left, right)

    def expected(left: float, right: float) -> float:
        there = found(ROVER_STEPS_S[0], left, right)
        return float(balance(VEHICLE, there.wheel_radps * there.radii_m.mean(), there.loads_n)[2])

    return [
        Case(
            "Driving",
            f"turning rate with wheels commanded to {left:g} and {right:g} rad/s",
            lambda a=left, b=right: expected(a, b),
            "rad/s",
            lambda s, a=left, b=right: found(s, a, b).radps,
            0.01,
            REGULARISED,
        )
        for left, right in ((-6.0, 6.0), (-2.0, 6.0), (2.0, 6.0), (4.0, 6.0))
    ]


def gripping() -> list[Case]:
    """Locked wheels hold up to atan(friction), slide faster and faster above, and stop in v^2 / (2 friction g)."""
    limit = math.degrees(math.atan(FRICTION))

    def creep(degrees: float) -> Callable[[float], float]:
        def run(step_s: float) -> float:
            rover = go(made(step_s, slope(degrees), vehicle=STRONG), 1.0, "brake", 60.0)
            before = place(rover)
            return 1e3 * float(np.linalg.norm(place(go(rover, 2.0)) - before)) / 2.0

        return run

    def slide(degrees: float) -> Callable[[float], float]:
        def run(step_s: float) -> float:
            start = RoverStart((20.0, 0.0))
            rover = go(made(step_s, slope(degrees), vehicle=STRONG, start=start), 1.5, "brake", 60.0)
            before = speed_mps(rover)
            return (speed_mps(go(rover, 1.0)) - before) / 1.0

        return run

    def sliding_mps2(degrees: float) -> float:
        angle = math.radians(degrees)
        return GRAVITY * (math.sin(angle) - FRICTION * math.cos(angle))

    def stop(step_s: float) -> float:
        """Return the way of a stop with locked wheels from 2 m/s."""
        rover = go(made(step_s, vehicle=STRONG), 1.0, "brake", 60.0)
        before = place(rover)[0]
        rover._data.qvel[0] = 2.0
        return float(place(go(rover, 2.0))[0] - before)

    return [
        Case("Gripping", "creeps down 20 degrees with locked wheels", 0.0, "mm/s", creep(20.0), 5.0, REGULARISED),
        Case("Gripping", f"creeps 0.6 degrees below {limit:.2f}", 0.0, "mm/s", creep(limit - 0.6), 15.0, REGULARISED),
        *(
            Case(
                "Gripping",
                f"acceleration down {degrees:.5g} degrees with locked wheels",
                sliding_mps2(degrees),
                "m/s2",
                slide(degrees),
                0.01,
                REGULARISED,
            )
            for degrees in (limit + 0.6, 40.0)
        ),
        Case(
            "Gripping",
            "way of a stop with locked wheels from 2 m/s",
            2.0 / (FRICTION * GRAVITY),
            "m",
            stop,
            0.02,
            REGULARISED,
        ),
    ]


def driven() -> list[Case]:
    """Motors: speed by the line of a DC motor, acceleration under a current, power from the battery."""
    wheel_kg = VEHICLE.wheels[0].mass_kg

    @cache
    def climbed(step_s: float, degrees: float, duty: float) -> tuple[float, float, float]:
        """Return the rate of the wheels, and that of the motor's line; power over the line's."""
        rover = go(made(step_s, slope(degrees), start=RoverStart((-25.0, 0.0))), 6.0, "duty", duty)
        supply_v, radius_m = rover.read("power").voltage_v, rolling_radius_m(rover)
        rate = float(rates(rover).mean())
        needed_n = VEHICLE.mass_kg * GRAVITY * math.sin(math.radians(degrees)) / COUNT
        current_a = (needed_n * radius_m + MOTOR.friction_nm) / MOTOR.nm_per_a
        line = (duty * supply_v - current_a * MOTOR.resistance_ohm) / MOTOR.v_per_radps
        # What the climb takes, friction of axles, losses of gears and windings.
        useful_w = COUNT * (needed_n * radius_m + MOTOR.friction_nm) * rate
        power_w = useful_w / MOTOR.efficiency + COUNT * current_a**2 * MOTOR.resistance_ohm
        drawn_w = (rover.read("power").current_a - VEHICLE.electronics_a) * supply_v
        return rate, line, drawn_w / power_w

    def accelerated(current_a: float) -> Callable[[float], float]:
        def run(step_s: float) -> float:
            rover = go(go(made(step_s), 1.0), 0.3, "current", current_a)
            before = speed_mps(rover)
            return (speed_mps(go(rover, 0.4)) - before) / 0.4

        return run

    def expected_mps2(current_a: float) -> Callable[[], float]:
        def compute() -> float:
            radius_m = rolling_radius_m(go(made(0.001), 3.0, "brake", 6.0))
            push_n = COUNT * (MOTOR.nm_per_a * current_a - MOTOR.friction_nm) / radius_m
            turning_kgm2 = COUNT * (MOTOR.wheel_kgm2 + 0.5 * wheel_kg * RADIUS_M**2)
            return push_n / (VEHICLE.mass_kg + turning_kgm2 / radius_m**2)

        return compute

    found = [
        Case(
            "Motors",
            f"duty {duty:g} on {degrees:g} degrees: rate of the wheels",
            lambda d=degrees, k=duty: climbed(0.001, d, k)[1],
            "rad/s",
            lambda s, d=degrees, k=duty: climbed(s, d, k)[0],
            0.01,
            REGULARISED,
        )
        for degrees, duty in ((0.0, 0.5), (10.0, 0.5), (15.0, 0.4))
    ]
    found += [
        Case(
            "Motors",
            f"{current_a:g} A on level ground: acceleration",
            expected_mps2(current_a),
            "m/s2",
            accelerated(current_a),
            0.005,
            REGULARISED,
        )
        for current_a in (1.0, 2.0)
    ]
    found.append(
        Case(
            "Motors",
            "duty 0.5 on 10 degrees: power of the battery over that of climb and losses",
            1.0,
            "",
            lambda s: climbed(s, 10.0, 0.5)[2],
            0.01,
            REGULARISED,
        )
    )
    return found


def suspended() -> list[Case]:
    """The chassis has the mean pitch of both rockers, here with a wheel on a ledge of 8 cm."""

    def off_deg(step_s: float) -> float:
        rover = go(made(step_s, ledges=(Ledge((0.75, 0.38, 0.02), (0.2, 0.15, 0.06)),)), 4.0, "speed", 2.0)
        go(rover, 1.0, "brake", 6.0)
        poses = rover.truth()["poses"]
        pitches = [pitch_deg(poses[name]) for name in ("chassis", "rocker_left", "rocker_right")]
        assert abs(pitches[1] - pitches[2]) > 2.0, "one side is up"
        return pitches[0] - 0.5 * (pitches[1] + pitches[2])

    return [Case("Suspension", "pitch of the chassis over the mean of both rockers", 0.0, "deg", off_deg, 0.2, SOFT)]


def pitch_deg(pose: list[float]) -> float:
    x, y, z, w = pose[3:]
    return math.degrees(math.asin(max(-1.0, min(1.0, 2.0 * (w * y - z * x)))))


def refined() -> list[Case]:
    """Where 12 s of hills end, with wheels of both sides at different rates: against steps of 0.5 ms."""

    @cache
    def end(step_s: float) -> np.ndarray:
        return place(go(made(step_s, make_hills(3, 0.5, 8.0)), 12.0, "speed", 4.0, 6.0))

    return [
        Case(
            "Hills",
            "end of 12 s of hills, from that at steps of 0.5 ms",
            0.0,
            "mm",
            lambda s: 1e3 * float(np.linalg.norm(end(s) - end(0.0005))),
            10.0,
            "of first order in the step",
            is_long=True,
        )
    ]


def rover_cases() -> list[Case]:
    """Return all cases, in the order of the page."""
    groups = (
        loads_at_rest, leaning, tipping, in_the_air, rolling, turning, gripping, driven, stalled, on_soil, pulling,
        coasting, sunken, suspended, refined, energy, planar_vehicles, in_plane, beside_mujoco, arm,
    )  # fmt: skip
    return [case for group in groups for case in group()]
