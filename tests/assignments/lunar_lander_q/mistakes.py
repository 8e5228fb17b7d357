"""Wrong solutions of the lab "lunar lander: Q-learning", their lost points and their hints.

`lost` counts the visible cases only, except for `trained_on_the_test`, which passes those and fails the hidden ones.
"""

from pathlib import Path

from tests.assignments.mistakes import Mistake, remove, replace, write

# Learned with the mistake; a training takes longer than reading 10 kB.
POLICIES = Path(__file__).parent / "policies"
UNTRAINED = {"learns": 15}  # the grader does not train a file with a wrong function
UNLEARNED = {"policy_file": 5, "lands": 25, "learns": 15, "is_sturdy": 10}

STATES = "STATES = (len(HEIGHTS_M) + 1) * (len(ERRORS_MPS) + 1)\n"
ENCODE = """\
    height = bisect_right(HEIGHTS_M, altitude_m)
    error = bisect_right(ERRORS_MPS, velocity_mps - target_speed_mps(altitude_m))
    return height * (len(ERRORS_MPS) + 1) + error
"""
REWARD = """\
    if outcome == "landed":
        return 10.0
    if outcome == "crashed":
        return -10.0
    before = abs(velocity_mps - target_speed_mps(altitude_m))
    after = abs(next_velocity_mps - target_speed_mps(next_altitude_m))
    return before - after - 0.05  # and time costs a little, so hovering does not pay
"""
BY_FORMULA = """\
def by_formula(altitude_m, velocity_mps):
    fast = target_speed_mps(altitude_m) - velocity_mps
    return 3 if fast > 1.0 else 2 if fast > 0.0 else 1 if fast > -0.7 else 0


"""

# Each has one wrong function or policy.
WRONG = {
    "bootstraps_through_terminal": Mistake(
        "Adds the value of the state after a touchdown.",
        lost={"updates": 20, **UNTRAINED},
        hint="After a touchdown there is no next state",
        changes=[
            replace(
                "q_lander.py",
                """\
    expected = 0.0
    if not step.is_terminated:
        expected = max((table.values[step.next_state][action] for action in tried(table, step.next_state)), default=0.0)
""",
                """\
    expected = max((table.values[step.next_state][action] for action in tried(table, step.next_state)), default=0.0)
""",
            )
        ],
    ),
    "stops_at_truncation": Mistake(
        "Treats an episode that was cut off as one that ended.",
        lost={"updates": 20, **UNTRAINED},
        hint="is_truncated means only that the time limit was reached",
        changes=[replace("q_lander.py", "step.is_terminated", "(step.is_terminated or step.is_truncated)")],
    ),
    "learns_from_the_untried": Mistake(
        "Counts the 0 of an untried action as a value when it learns.",
        lost={"updates": 20, **UNTRAINED},
        hint="includes actions that were never tried",
        changes=[
            replace(
                "q_lander.py",
                "(table.values[step.next_state][action] for action in tried(table, step.next_state)), default=0.0",
                "table.values[step.next_state]",
            )
        ],
    ),
    "counts_before_it_looks": Mistake(
        "Counts the visit before it reads the values of the next state, which may be the same state.",
        lost={"updates": 20, **UNTRAINED},
        hint="before you count the visit",
        changes=[
            replace("q_lander.py", "    table.visits[step.state][step.action] += 1\n", ""),
            replace(
                "q_lander.py",
                "    expected = 0.0\n",
                "    table.visits[step.state][step.action] += 1\n    expected = 0.0\n",
            ),
        ],
    ),
    "stops_learning": Mistake(
        "Uses a step size that is almost 0 after a few visits.",
        lost={"updates": 20, **UNTRAINED},
        hint="a step size that falls so soon",
        changes=[
            replace(
                "q_lander.py",
                "max(MIN_STEP_SIZE, 1.0 / table.visits[step.state][step.action])",
                "1.0 / table.visits[step.state][step.action] ** 3",
            )
        ],
    ),
    "changes_the_next_state": Mistake(
        "Updates the row of the next state.",
        lost={"updates": 20, **UNTRAINED},
        hint="It changes the row of the next state",
        changes=[
            replace(
                "q_lander.py",
                """\
    old = table.values[step.state][step.action]
    table.values[step.state][step.action] = old + size * (step.reward + DISCOUNT * expected - old)
""",
                """\
    old = table.values[step.next_state][step.action]
    table.values[step.next_state][step.action] = old + size * (step.reward + DISCOUNT * expected - old)
""",
            )
        ],
    ),
    "explores_when_evaluated": Mistake(
        "Explores with an epsilon of its own.",
        lost={"chooses": 15, **UNTRAINED},
        hint="With epsilon 0 it still explores",
        changes=[replace("q_lander.py", "epsilon > 0.0 and", "rng.random() < 0.05 or")],
    ),
    "chooses_the_untried": Mistake(
        "Counts the 0 of an untried action as a value when it chooses.",
        lost={"chooses": 15, **UNTRAINED},
        hint="It takes an action that was never tried",
        changes=[
            replace(
                "q_lander.py",
                "tried(table, state), key=lambda action: table.values[state][action], default=0",
                "range(ACTIONS), key=lambda action: table.values[state][action]",
            )
        ],
    ),
    "plays_a_recording": Mistake(
        "Counts its calls and repeats one recorded landing instead of reading the table.",
        lost={"chooses": 15, **UNTRAINED},
        hint="it must depend on its arguments alone",
        changes=[
            replace("q_lander.py", "def choose(", "BURNS = [0] * 120 + [3] * 30\ncalls = 0\n\n\ndef choose("),
            replace(
                "q_lander.py",
                "    return max(tried(table, state), key=lambda action: table.values[state][action], default=0)\n",
                """\
    global calls
    calls += 1
    return BURNS[calls % len(BURNS)]
""",
            ),
        ],
    ),
    "loses_the_sign": Mistake(
        "Encodes how far the velocity is off, but not in which direction.",
        lost={"encodes": 10, **UNTRAINED},
        hint="is the sign lost",
        changes=[
            replace(
                "q_lander.py",
                "(ERRORS_MPS, velocity_mps - target_speed_mps(altitude_m))",
                "(ERRORS_MPS, abs(velocity_mps - target_speed_mps(altitude_m)))",
            )
        ],
    ),
    "learns_for_a_while": Mistake(
        "Stops learning after 500 transitions.",
        lost=UNTRAINED,
        hint="What does update() keep in between, or leave out?",
        changes=[
            replace("q_lander.py", STATES, STATES + "COUNTED = []  # transitions\n"),
            replace(
                "q_lander.py",
                "    expected = 0.0\n",
                """\
    COUNTED.append(1)
    if len(COUNTED) > 500:
        return
    expected = 0.0
""",
            ),
        ],
    ),
    "is_paid_for_hovering": Mistake(
        "Rewards every step in the air.",
        lost={"lands": 25, "learns": 15, "is_sturdy": 10},
        hint="It hovers until its two minutes are over",
        changes=[
            replace("q_lander.py", "return before - after - 0.05", "return 1.0"),
            write("policy.npz", (POLICIES / "is_paid_for_hovering.npz").read_bytes()),
        ],
    ),
}

# These learn nothing, and bring no policy that could fly instead.
CHEATS = {
    "uses_a_formula": Mistake(
        "Learns nothing: encode() passes its arguments to choose(), which uses a formula.",
        lost=UNLEARNED,
        hint="All rewards were 0",
        changes=[
            replace("q_lander.py", STATES, STATES + "PLACES = []  # observations for which no action was chosen yet\n"),
            replace("q_lander.py", "def encode(", BY_FORMULA + "def encode("),
            replace("q_lander.py", ENCODE, "    PLACES.append((altitude_m, velocity_mps))\n" + ENCODE),
            replace("q_lander.py", REWARD, "    return 0.0\n"),
            replace(
                "q_lander.py",
                "    if epsilon > 0.0",
                """\
    if PLACES:
        return by_formula(*PLACES.pop(0))
    if epsilon > 0.0""",
            ),
            remove("policy.npz"),
        ],
    ),
    "brings_its_table": Mistake(
        "Learns nothing: the file contains a table that was learned elsewhere.",
        lost=UNLEARNED,
        hint="Only action 0 was ever tried",
        changes=[
            replace(
                "q_lander.py",
                STATES,
                STATES
                + """\
AT_HOME = [int(digit) for digit in "012001010232201000032300000333220000333221000333221010333320000"]
FLIGHTS = []  # not empty during a flight
""",
            ),
            replace("q_lander.py", ENCODE, "    FLIGHTS.append(1)\n" + ENCODE),
            replace("q_lander.py", "return max(0.05, 0.6 * (1.0 - share / 0.8))", "return 0.0"),
            replace(
                "q_lander.py",
                "    if epsilon > 0.0",
                """\
    if FLIGHTS:
        return AT_HOME[state]
    if epsilon > 0.0""",
            ),
            remove("policy.npz"),
        ],
    ),
    "encodes_actions_in_states": Mistake(
        "Learns nothing: encode() returns a state whose best action is that of a formula.",
        lost=UNLEARNED,
        hint="encode() must depend on its two arguments alone",
        changes=[
            replace(
                "q_lander.py",
                STATES,
                """\
STATES = 5000
NOW = {}  # "since": number of states since the last step of a training; "flies"; "next": a new state
ALONE = {}  # of each action a state in which nothing else was tried
""",
            ),
            replace("q_lander.py", "def encode(", BY_FORMULA + "def encode("),
            replace(
                "q_lander.py",
                ENCODE,
                """\
    since = NOW.get("since")
    if since is None:
        height = bisect_right(HEIGHTS_M, altitude_m)
        error = bisect_right(ERRORS_MPS, velocity_mps - target_speed_mps(altitude_m))
        return height * (len(ERRORS_MPS) + 1) + error
    NOW["since"] = since + 1
    if since == 0:
        NOW["flies"] = round(altitude_m, 2) != altitude_m  # a radar is not as exact as the plant: this is a flight
    if NOW["flies"]:
        return ALONE.get(by_formula(altitude_m, velocity_mps), 0)
    NOW["next"] = min(NOW.get("next", 63) + 1, STATES - 1)
    return NOW["next"]
""",
            ),
            replace("q_lander.py", REWARD, "    return 0.0\n"),
            replace(
                "q_lander.py",
                "    return max(0.05, 0.6 * (1.0 - share / 0.8))\n",
                """\
    NOW["since"] = 0
    return 1.0
""",
            ),
            replace(
                "q_lander.py",
                "    expected = 0.0\n",
                """\
    if 63 < step.state < STATES - 1:
        ALONE.setdefault(step.action, step.state)
    expected = 0.0
""",
            ),
            remove("policy.npz"),
        ],
    ),
    "replaces_the_grader": Mistake(
        "Has no correct function and replaces those of the grader in its own process.",
        lost={"encodes": 10, "chooses": 15, "updates": 20, **UNLEARNED},
        hint="update() has made another",
        changes=[
            write(
                "q_lander.py",
                '''\
import math
import sys
from base64 import b64encode

STATES = 4
ASKS = sys.modules["snr_sim_lab_10_lunar_lander_q.grader.pilot"]


def encode(altitude_m, velocity_mps):
    return 0


def choose(table, state, epsilon, rng):
    return 0


def update(table, step):
    """Learns nothing."""


def reward(altitude_m, velocity_mps, next_altitude_m, next_velocity_mps, burned_kg, outcome):
    return 0.0


def epsilon(share):
    return 1.0


def by_formula(packed):
    fast = [-math.sqrt(0.09 + 2.0 * max(0.0, height)) - speed for height, speed in zip(*ASKS.rows_of(packed, 2))]
    return [3 if one > 1.0 else 2 if one > 0.0 else 1 if one > -0.7 else 0 for one in fast]


def learn(pilot, share, packed, ends, done):
    # Rewards that make the best action of each state the number of the state.
    count = len(ASKS.b64decode(packed)) // 8 // (5 if done else 4)
    paid = [1.0 if i % 4 == int(action) else -1.0 for i, action in enumerate(done)]
    return {
        "states": ASKS.packed_states([i % 4 for i in range(count)]),
        "last": [0] * len(ends),
        "rewards": b64encode(ASKS.array("d", paid).tobytes()).decode(),
        "epsilon": 1.0,
    }


ASKS.StudentPolicy.learn = learn
ASKS.StudentPolicy.encode_packed = lambda pilot, packed: ASKS.packed_states(by_formula(packed))
ASKS.StudentPolicy.act = lambda pilot, packed: "".join(map(str, by_formula(packed)))
''',
            ),
            remove("policy.npz"),
        ],
    ),
}

MISTAKES = {
    **WRONG,
    **CHEATS,
    "trained_on_the_test": Mistake(
        "Submits a policy that was trained on the visible starts.",
        lost={"lands": 18.75, "is_sturdy": 8.91},
        hint="it was trained on its test cases",
        changes=[write("policy.npz", (POLICIES / "trained_on_the_test.npz").read_bytes())],
    ),
}
