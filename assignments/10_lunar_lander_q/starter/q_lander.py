"""Q-learning of a landing: what a state is, what is good, what is done, and what is learned from it.

Your work is in the five functions. `learn.py` lets them learn, and so does the grader.
"""

import math

ACTIONS = 4  # throttle 0, 0.25, 0.5 and 1
DISCOUNT = 0.95
MIN_STEP_SIZE = 0.02

STATES = 1  # how many different numbers encode() returns


def target_speed_mps(altitude_m):
    """Return the velocity from which gentle braking, by 1 m/s2, ends at 0.3 m/s on the ground."""
    return -math.sqrt(0.3**2 + 2.0 * 1.0 * max(0.0, altitude_m))


def encode(altitude_m, velocity_mps):
    """Return the number of the state, from 0 to STATES - 1."""
    # Step 1: with one state, high and low are the same, and so are fast and slow.
    return 0


def choose(table, state, epsilon, rng):
    """Return an action: any with probability epsilon, else the best of those that were tried, the first of several."""
    # Step 2
    return 0


def update(table, step):
    """Learns from one transition: changes table.values and table.visits."""
    # Step 3


def reward(altitude_m, velocity_mps, next_altitude_m, next_velocity_mps, burned_kg, outcome):
    """Return what a step was worth. outcome is "landed", "crashed", "timeout", or "" while it flies."""
    # Step 4: what do you want? And what does a lander do that gets exactly this?
    return 1.0 if outcome == "landed" else 0.0


def epsilon(share):
    """Return how often an action is taken at random, when this share of the training is over, 0 to 1."""
    # Step 5
    return 1.0
