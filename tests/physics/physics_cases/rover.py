"""Results of the rover's motion that are known without a simulation."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from snr_sim.plants.ground.height_map import HeightMap, flat, make_hills, ramp
from snr_sim.plants.ground.rocks import Ledge
from snr_sim.plants.ground.rover import Rover, RoverStart
from snr_sim.plants.ground.rover_file import read_rover
from snr_sim.plants.ground.rover_vehicle import RoverVehicle
from snr_sim.plants.ground.terramechanics import DRY_SAND, Ground
from snr_sim.prelude.ground_signals import DriveCommand, MotorReading

from .case import Case

ROVER_STEPS_S = (0.001, 0.002, 0.004)
VEHICLE = read_rover(Path(__file__).parents[3] / "robots" / "rover" / "vehicles" / "competition.toml")
STRONG = replace(VEHICLE, motor=replace(VEHICLE.motor, limit_a=60.0))  # its brakes hold any wheel
MOTOR, COUNT, GRAVITY = VEHICLE.motor, len(VEHICLE.wheels), 9.80665
RADIUS_M, WIDTH_M = VEHICLE.wheels[0].radius_m, VEHICLE.wheels[0].width_m
LEFT, RIGHT = slice(0, 3), slice(3, 6)
FRICTION = 0.8

SOFT = "tyres are soft, so loads shift a little as they are pressed"
REGULARISED = "MuJoCo's friction begins and ends gradually"
LAST_STEP = "friction of soil follows load and slip of the step before"


def made(
    step_s: float,
    ground: HeightMap | None = None,
    soil: Ground | None = None,
    vehicle: RoverVehicle = VEHICLE,
    start: RoverStart = RoverStart(),  # noqa: B008 - frozen
    ledges: tuple[Ledge, ...] = (),
) -> Rover:
    return Rover(vehicle, ground or flat(), lambda seed: start, soil, ledges, step_s=step_s)


def go(rover: Rover, seconds: float, mode: str = "", *values: float) -> Rover:
    """Drive for a time, after a command to all wheels or to those of the left and the right side."""
    if mode:
        each = list(values) if len(values) == COUNT else [values[0]] * (COUNT // 2) + [values[-1]] * (COUNT // 2)
        rover.write("drive", DriveCommand(mode, each))
    for _ in range(round(seconds / rover.step_s)):
        rover.step(rover.step_s)
    return rover


def motors(rover: Rover) -> list[MotorReading]:
    return [rover.read(f"motor_{wheel.name}") for wheel in rover.vehicle.wheels]


def rates(rover: Rover) -> np.ndarray:
    return np.array([motor.speed_radps for motor in motors(rover)])


def place(rover: Rover) -> np.ndarray:
    return np.array(rover.read("pose").position_m)


def speed_mps(rover: Rover) -> float:
    return float(rover.truth()["values"]["speed_mps"])


def slope(degrees: float, size_m: float = 80.0) -> HeightMap:
    return ramp((math.tan(math.radians(degrees)), 0.0), size_m)


def rolling_radius_m(rover: Rover) -> float:
    """Return the distance from the axles to the middle of the contacts, the mean of all wheels."""
    above = [
        sum(
            (a - p) * n
            for a, p, n in zip(rover.truth()["poses"][f"wheel_{wheel.name}"][:3], at[:3], at[3:], strict=True)
        )
        for wheel, at in zip(VEHICLE.wheels, rover.contacts.planes, strict=True)
    ]
    return 0.5 * (RADIUS_M + sum(above) / COUNT)


def loads_at_rest() -> list[Case]:
    """Loads by the rule of levers: chassis and rocker are one body, the differential holds them; the bogie another."""
    hung = VEHICLE.suspension
    assert hung is not None
    (rx, _), (bx, _) = hung.rocker_pivot_m, hung.bogie_pivot_m
    front, middle, back = (wheel.position_m[0] for wheel in VEHICLE.wheels[LEFT])
    wheel_kg = VEHICLE.wheels[0].mass_kg
    body = [
        (0.5 * VEHICLE.chassis_kg, VEHICLE.center_of_mass_m[0]),
        (hung.rocker_kg, rx + 0.25 * (front - rx + bx - rx)),
        (wheel_kg, front),
    ]
    bogie = [(hung.bogie_kg, bx + 0.25 * (middle - bx + back - bx)), (wheel_kg, middle), (wheel_kg, back)]

    def shared(parts: list[tuple[float, float]], one: float, other: float, more: tuple[float, float]) -> list[float]:
        weight = GRAVITY * sum(kg for kg, _ in parts) + more[0]
        moment = GRAVITY * sum(kg * x for kg, x in parts) + more[0] * more[1]
        at_other = (moment - weight * one) / (other - one)
        return [weight - at_other, at_other]

    on_front, on_bogie = shared(body, front, bx, (0.0, 0.0))
    expected = [on_front, *shared(bogie, middle, back, (on_bogie, bx))]

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
    half_m = VEHICLE.wheels[0].position_m[1]
    hung = VEHICLE.suspension
    assert hung is not None
    # The height of the centre of mass over the contacts: parts by their masses, rods in their middle.
    (_, rz), (_, bz) = hung.rocker_pivot_m, hung.bogie_pivot_m
    axle = VEHICLE.wheels[0].position_m[2]
    rocker_z, bogie_z = rz + 0.25 * (axle - rz + bz - rz), bz + 0.5 * (axle - bz)
    height_m = (
        VEHICLE.chassis_kg * VEHICLE.center_of_mass_m[2]
        + 2.0 * (hung.rocker_kg * rocker_z + hung.bogie_kg * bogie_z)
        + COUNT * VEHICLE.wheels[0].mass_kg * axle
    ) / VEHICLE.mass_kg

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
    """Turning rate at which friction of six sliding wheels is in balance: the least power of friction.

    With wheel rates and loads given, power is a convex function of the three speeds of the body; it is found by
    weighted least squares, repeated (Weiszfeld), which shares nothing with MuJoCo.
    """
    at = np.array([wheel.position_m[:2] for wheel in VEHICLE.wheels])

    @cache
    def found(step_s: float, left: float, right: float) -> tuple[float, np.ndarray, np.ndarray, float]:
        rover = go(made(step_s), 3.0, "speed", left, right)
        turns, speeds = [], []
        for _ in range(round(1.0 / step_s)):
            rover.step(step_s)
            turns.append(rover.read("imu").rate_radps[2])
            speeds.append(rates(rover))
        loads = np.array(rover.contacts.read_loads())
        return float(np.mean(turns)), np.mean(speeds, axis=0), loads, rolling_radius_m(rover)

    def balance(left: float, right: float) -> float:
        _, wheel_rates, loads, radius_m = found(ROVER_STEPS_S[0], left, right)
        rolled, twist = wheel_rates * radius_m, np.zeros(3)
        per_twist = [np.array([[1.0, 0.0, -y], [0.0, 1.0, x]]) for x, y in at]
        for _ in range(5000):
            matrix, vector = np.zeros((3, 3)), np.zeros(3)
            for to_speed, along, load in zip(per_twist, rolled, loads, strict=True):
                slid = to_speed @ twist - [along, 0.0]
                weight = load / math.sqrt(slid @ slid + 1e-16)
                matrix += weight * to_speed.T @ to_speed
                vector += weight * to_speed.T @ [along, 0.0]
            new = np.linalg.solve(matrix, vector)
            if np.abs(new - twist).max() < 1e-12:
                break
            twist = new
        return float(twist[2])

    return [
        Case(
            "Driving",
            f"turning rate with wheels commanded to {left:g} and {right:g} rad/s",
            lambda a=left, b=right: balance(a, b),
            "rad/s",
            lambda s, a=left, b=right: found(s, a, b)[0],
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

    def slide(step_s: float) -> float:
        rover = go(made(step_s, slope(40.0), vehicle=STRONG, start=RoverStart((20.0, 0.0))), 1.5, "brake", 60.0)
        before = speed_mps(rover)
        return (speed_mps(go(rover, 1.0)) - before) / 1.0

    def stop(step_s: float) -> float:
        """Return the way of a stop with locked wheels from 2 m/s."""
        rover = go(made(step_s, vehicle=STRONG), 1.0, "brake", 60.0)
        before = place(rover)[0]
        rover._data.qvel[0] = 2.0
        return float(place(go(rover, 2.0))[0] - before)

    steep = math.radians(40.0)
    return [
        Case("Gripping", "creeps down 20 degrees with locked wheels", 0.0, "mm/s", creep(20.0), 5.0, REGULARISED),
        Case("Gripping", f"creeps 0.6 degrees below {limit:.2f}", 0.0, "mm/s", creep(limit - 0.6), 15.0, REGULARISED),
        Case(
            "Gripping",
            "acceleration down 40 degrees with locked wheels",
            GRAVITY * (math.sin(steep) - FRICTION * math.cos(steep)),
            "m/s2",
            slide,
            0.01,
            REGULARISED,
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


def on_soil() -> list[Case]:
    """Slip at which traction carries the weight's share and the resistance of the soil, with the loads found."""

    @cache
    def found(step_s: float, degrees: float) -> tuple[float, list[float]]:
        rover = go(made(step_s, slope(degrees), DRY_SAND, start=RoverStart((-25.0, 0.0))), 8.0, "speed", 4.0)
        speed = speed_mps(rover)
        return 1.0 - speed / (float(rates(rover).mean()) * rolling_radius_m(rover)), rover.contacts.read_loads()

    def expected(degrees: float) -> float:
        loads = found(ROVER_STEPS_S[0], degrees)[1]
        needed_n = VEHICLE.mass_kg * GRAVITY * math.sin(math.radians(degrees))
        needed_n += sum(DRY_SAND.resistance_n(load, RADIUS_M, WIDTH_M) for load in loads)
        low, high = 0.0, 1.0
        for _ in range(60):
            slip = 0.5 * (low + high)
            traction_n = sum(load * DRY_SAND.friction_at(slip, load, RADIUS_M, WIDTH_M) for load in loads)
            low, high = (slip, high) if traction_n < needed_n else (low, slip)
        return low

    return [
        Case(
            "Dry sand",
            f"slip on {degrees:g} degrees",
            lambda d=degrees: expected(d),
            "",
            lambda s, d=degrees: found(s, d)[0],
            0.005,
            LAST_STEP,
        )
        for degrees in (0.0, 2.5, 5.0, 8.0)
    ]


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
        )
    ]


def rover_cases() -> list[Case]:
    """Return all cases, in the order of the page."""
    groups = (loads_at_rest, leaning, rolling, turning, gripping, driven, on_soil, suspended, refined)
    return [case for group in groups for case in group()]
