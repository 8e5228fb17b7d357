"""Vertical descent on closed forms: what a burn does, and the descent that costs least.

One engine, straight up, above flat ground: velocity is positive up and thrust is constant while it burns. Everything
here is exact, so it serves three readers: the plant that moves by it, the guidance law that plans by it, and the
score that compares a flight with the best one possible.

With m = m0 - mu t, mu = thrust / exhaust speed:

    v(t) = v0 - g t + c ln(m0 / m)
    h(t) = h0 + v0 t - g t^2 / 2 + c (t - (m / mu) ln(m0 / m))

Source: Tsiolkovsky's equation with constant gravity, integrated once more. That falling first and then burning at
full thrust is the cheapest descent follows from Pontryagin's principle: one switch, and never back. It holds for any
speed at the ground; the faster a touchdown may be, the less it costs.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from snr_sim.prelude.errors import ParameterError

STANDARD_GRAVITY_MPS2 = 9.80665  # turns a specific impulse in seconds into an exhaust speed; exact by definition
MOON_GRAVITY_MPS2 = 1.62  # mean at the surface of the Moon


class Motion(NamedTuple):
    """State of a module in its descent.

    Args:
        height_m: over the ground.
        velocity_mps: positive up.
        mass_kg: all of it, propellant included.
    """

    height_m: float
    velocity_mps: float
    mass_kg: float


class Engine(NamedTuple):
    """What pushes, and against what.

    Args:
        thrust_n: at full throttle.
        exhaust_mps: effective exhaust speed.
        gravity_mps2: pulls down.
    """

    thrust_n: float
    exhaust_mps: float
    gravity_mps2: float = MOON_GRAVITY_MPS2


class Descent(NamedTuple):
    """The cheapest descent: fall, then burn."""

    coast_s: float  # how long to fall
    ignite_height_m: float  # where the burn begins
    ignite_speed_mps: float  # how fast it then falls, positive down
    burn_s: float  # how long it burns until it touches the ground
    fuel_kg: float  # what all of it costs


def propagate(start: Motion, thrust_n: float, exhaust_mps: float, gravity_mps2: float, time_s: float) -> Motion:
    """Return where constant thrust leads; zero thrust is free fall. The ground is not noticed.

    >>> round(propagate(Motion(100.0, 0.0, 1.0), 0.0, 3000.0, 1.62, 10.0).height_m, 9)
    19.0
    """
    height, velocity, mass = start
    fallen_height = height + (velocity - 0.5 * gravity_mps2 * time_s) * time_s
    if thrust_n <= 0.0:
        return Motion(fallen_height, velocity - gravity_mps2 * time_s, mass)
    flow = thrust_n / exhaust_mps
    left = mass - flow * time_s
    log_ratio = -math.log1p(-flow * time_s / mass)
    return Motion(
        fallen_height + exhaust_mps * (time_s - left / flow * log_ratio),
        velocity - gravity_mps2 * time_s + exhaust_mps * log_ratio,
        left,
    )


def free_fall(height_m: float, velocity_mps: float, gravity_mps2: float = MOON_GRAVITY_MPS2) -> tuple[float, float]:
    """Return time to the ground [s] and speed there [m/s, positive down].

    >>> [round(x, 3) for x in free_fall(100.0, 0.0)]
    [11.111, 18.0]
    """
    speed = math.sqrt(velocity_mps**2 + 2.0 * gravity_mps2 * height_m)
    return (velocity_mps + speed) / gravity_mps2, speed


def time_to_stop(start: Motion, engine: Engine, final_mps: float = 0.0) -> float:
    """Return how long full thrust needs to end a fall [s], or to slow it to a speed; 0 when it falls no faster.

    Args:
        start: of the burn.
        engine: at full thrust.
        final_mps: the speed at its end, positive down.

    Raises:
        ParameterError: the thrust cannot lift the mass, so the search has no safe side.
    """
    velocity, mass = start.velocity_mps + final_mps, start.mass_kg  # what is to be taken away
    if velocity >= 0.0:
        return 0.0
    thrust, exhaust, gravity = engine
    if thrust <= mass * gravity:
        raise ParameterError(
            f"{thrust:g} N cannot hold {mass:g} kg, which weighs {mass * gravity:g} N.",
            fix="more thrust, or less mass.",
        )
    # With constant mass it would take longest. From that side Newton's steps on the convex v(t) never overshoot.
    rate = thrust / (exhaust * mass)
    time = min(-velocity / (thrust / mass - gravity), 0.999 / rate)
    for _ in range(60):
        miss = velocity - gravity * time - exhaust * math.log1p(-rate * time)
        step = miss / (exhaust * rate / (1.0 - rate * time) - gravity)
        time -= step
        if abs(step) <= 1e-13 * time:
            break
    return time


def stop_height(start: Motion, engine: Engine, final_mps: float = 0.0) -> float:
    """Return the height at which full thrust from now on would end the fall [m]; below 0 it is too late.

    `final_mps`, positive down, is the speed that counts as its end.
    """
    return propagate(start, *engine, time_to_stop(start, engine, final_mps)).height_m


def minimum_fuel_descent(
    start: Motion, engine: Engine, idle_thrust_n: float = 0.0, touchdown_mps: float = 0.0
) -> Descent:
    """Return the descent that uses least propellant and is at height 0 no faster than a speed.

    Args:
        start: as it is now.
        engine: at full thrust it must be able to brake in time.
        idle_thrust_n: what the engine gives while 'falling', if it cannot be shut off.
        touchdown_mps: that speed, positive down: 0 to come to rest, or what the gear takes.

    Raises:
        ParameterError: even full thrust from now on is too late, or idling already lifts it.
    """
    if stop_height(start, engine, touchdown_mps) < 0.0:
        raise ParameterError(
            f"From {start.height_m:g} m at {start.velocity_mps:g} m/s even full thrust is too late.",
            fix="start higher or slower.",
        )
    thrust, exhaust, gravity = engine
    if idle_thrust_n >= start.mass_kg * gravity:
        raise ParameterError(f"Idling at {idle_thrust_n:g} N already lifts {start.mass_kg:g} kg.")

    def miss(coast_s: float) -> float:
        return stop_height(propagate(start, idle_thrust_n, exhaust, gravity, coast_s), engine, touchdown_mps)

    # A fall that has reached the ground is too late. One that idles takes longer, as it grows lighter: look further.
    late = free_fall(start.height_m, start.velocity_mps, gravity - idle_thrust_n / start.mass_kg)[0]
    while miss(late) > 0.0:
        late *= 1.1
    coast = find_root(miss, 0.0, late)
    ignition = propagate(start, idle_thrust_n, exhaust, gravity, coast)
    burn = time_to_stop(ignition, engine, touchdown_mps)
    fuel = start.mass_kg - ignition.mass_kg + thrust / exhaust * burn
    return Descent(coast, ignition.height_m, -ignition.velocity_mps, burn, fuel)


def constant_mass_ignition_m(start: Motion, engine: Engine) -> float:
    """Return the ignition height if burning cost no mass [m]: the first estimate on the back of an envelope."""
    energy = 0.5 * start.velocity_mps**2 + engine.gravity_mps2 * start.height_m
    return energy / (engine.thrust_n / start.mass_kg)


def find_root(function: Callable[[float], float], low: float, high: float) -> float:
    """Return where a function that is positive at `low` and negative at `high` crosses 0, to the last bit.

    Bisection, because it always converges and some fifty calls are fast enough.
    """
    while True:
        middle = 0.5 * (low + high)
        if not low < middle < high:
            return middle
        if function(middle) > 0.0:
            low = middle
        else:
            high = middle
