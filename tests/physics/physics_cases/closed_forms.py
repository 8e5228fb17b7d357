"""Motions that can be written down: along one axis against drag, a pendulum, a steady circle; and Runge-Kutta, for one
or two numbers, where none can."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from snr_sim.plants.urov.vehicle import Vehicle

from .vehicles import along_axis

Rate: TypeAlias = Callable[[float, tuple[float, ...]], tuple[float, ...]]  # of time and state


def step_response(mass: float, a: float, b: float, push: float, time_s: float) -> tuple[float, float]:
    """Return speed and distance from rest under a constant push, against drag a u + b u |u|."""
    u1 = (math.sqrt(a * a + 4.0 * b * push) - a) / (2.0 * b)
    u2 = u1 + a / b
    k = b * (u1 + u2) / mass
    e = math.exp(-k * time_s)
    return u1 * (1.0 - e) / (1.0 + u1 / u2 * e), u1 * time_s - (u1 + u2) / k * math.log(
        (1.0 + u1 / u2) / (1.0 + u1 / u2 * e)
    )


def terminal_speed(a: float, b: float, push: float) -> float:
    """Return the speed at which drag is the push."""
    return (math.sqrt(a * a + 4.0 * b * push) - a) / (2.0 * b)


def coasting(mass: float, a: float, b: float, speed: float, time_s: float) -> float:
    """Return what is left of a speed."""
    if a == 0.0:
        return speed / (1.0 + b * speed * time_s / mass)
    return a / (math.exp(a * time_s / mass) * (a / speed + b) - b)


def pendulum_period(mass: float, stiffness: float, swing_rad: float) -> float:
    """Return the period of an undamped pendulum at any swing, by the arithmetic-geometric mean."""
    a, b = 1.0, math.cos(0.5 * swing_rad)
    while abs(a - b) > 1e-15:
        a, b = 0.5 * (a + b), math.sqrt(a * b)
    return 2.0 * math.pi * math.sqrt(mass / stiffness) / a


def steady_circle(one: Vehicle, push: float) -> tuple[float, float, float]:
    """Return speed ahead, sideways and rate of the circle that a push ahead ends in, by Newton's method."""
    mx, my = along_axis(one, 0)[0], along_axis(one, 1)[0]

    def unbalanced(state: np.ndarray) -> np.ndarray:
        u, v, r = state
        drag = [
            one.linear_damping[i] * value + one.quadratic_damping[i] * value * abs(value)
            for i, value in ((0, u), (1, v), (5, r))
        ]
        return np.array([push + my * v * r - drag[0], -mx * u * r - drag[1], (mx - my) * u * v - drag[2]])

    # Begins from where the circle is wide: sideways speed as great as half of the speed ahead.
    ahead = terminal_speed(one.linear_damping[0], one.quadratic_damping[0], push)
    state = np.array([0.7 * ahead, -0.4 * ahead, 0.5])
    for _ in range(100):
        slope = np.array([(unbalanced(state + 1e-7 * e) - unbalanced(state)) / 1e-7 for e in np.eye(3)]).T
        state = state - 0.5 * np.linalg.solve(slope, unbalanced(state))
    u, v, r = state.tolist()
    return u, v, r


def sliding(mass: float, a: float, b: float, friction: float, speed: float, time_s: float) -> float:
    """Return what is left of a speed that friction and drag a u + b u^2 take, before it has stopped."""
    rest = friction - 0.25 * a * a / b  # mass u' = -(b (u + a / 2b)^2 + rest)
    fast = math.sqrt(rest / b)
    return fast * math.tan(math.atan((speed + 0.5 * a / b) / fast) - math.sqrt(rest * b) * time_s / mass) - 0.5 * a / b


def rk4(rate: Rate, state: tuple[float, ...], time_s: float, step_s: float) -> tuple[float, ...]:
    """Return the state after a time, by the Runge-Kutta rule of fourth order."""
    half = 0.5 * step_s
    for i in range(round(time_s / step_s)):
        t = i * step_s
        k1 = rate(t, state)
        k2 = rate(t + half, tuple(x + half * k for x, k in zip(state, k1, strict=True)))
        k3 = rate(t + half, tuple(x + half * k for x, k in zip(state, k2, strict=True)))
        k4 = rate(t + step_s, tuple(x + step_s * k for x, k in zip(state, k3, strict=True)))
        slopes = zip(state, k1, k2, k3, k4, strict=True)
        state = tuple(x + step_s / 6.0 * (a + 2.0 * b + 2.0 * c + d) for x, a, b, c, d in slopes)
    return state
