"""Q-learning of a landing: what a state is, what is good, what is done, and what is learned from it."""

import math
from bisect import bisect_right

ACTIONS = 4  # throttle 0, 0.25, 0.5 and 1
DISCOUNT = 0.95
MIN_STEP_SIZE = 0.02

HEIGHTS_M = (1.0, 3.0, 10.0, 40.0, 150.0, 500.0)
ERRORS_MPS = (-4.0, -2.0, -1.0, -0.3, 0.3, 1.0, 2.0, 4.0)
STATES = (len(HEIGHTS_M) + 1) * (len(ERRORS_MPS) + 1)


def target_speed_mps(altitude_m):
    """Return the velocity from which gentle braking, by 1 m/s2, ends at 0.3 m/s on the ground."""
    return -math.sqrt(0.3**2 + 2.0 * 1.0 * max(0.0, altitude_m))


def encode(altitude_m, velocity_mps):
    """Return the number of the state: which height, and how far from the velocity that belongs to it."""
    height = bisect_right(HEIGHTS_M, altitude_m)
    error = bisect_right(ERRORS_MPS, velocity_mps - target_speed_mps(altitude_m))
    return height * (len(ERRORS_MPS) + 1) + error


def reward(altitude_m, velocity_mps, next_altitude_m, next_velocity_mps, burned_kg, outcome):
    """Return what a step was worth."""
    if outcome == "landed":
        return 10.0
    if outcome == "crashed":
        return -10.0
    before = abs(velocity_mps - target_speed_mps(altitude_m))
    after = abs(next_velocity_mps - target_speed_mps(next_altitude_m))
    return before - after - 0.05  # and time costs a little, so hovering does not pay


def epsilon(share):
    """Return how often an action is taken at random, when this share of the training is over."""
    return max(0.05, 0.6 * (1.0 - share / 0.8))


def tried(table, state):
    """Return the actions that have been tried in a state."""
    return [action for action in range(ACTIONS) if table.visits[state][action] > 0]


def choose(table, state, epsilon, rng):
    """Return an action: any with probability epsilon, else the best of those that were tried, the first of several."""
    if epsilon > 0.0 and rng.random() < epsilon:
        return rng.randrange(ACTIONS)
    return max(tried(table, state), key=lambda action: table.values[state][action], default=0)


def update(table, step):
    """Learns from one transition."""
    expected = 0.0
    if not step.is_terminated:
        expected = max((table.values[step.next_state][action] for action in tried(table, step.next_state)), default=0.0)
    table.visits[step.state][step.action] += 1
    size = max(MIN_STEP_SIZE, 1.0 / table.visits[step.state][step.action])
    old = table.values[step.state][step.action]
    table.values[step.state][step.action] = old + size * (step.reward + DISCOUNT * expected - old)
