"""Wrong solutions of the lab "debug by replay", their lost points and their hints."""

from tests.assignments.mistakes import Mistake, replace

MISTAKES = {
    "first_command": Mistake(
        "Gives the records where the commands begin to differ instead of those of the faulty component.",
        lost={"diverges": 10.0},
        hint="not where the commands begin to differ",
        changes=[
            replace("findings.toml", "seq = 15", "seq = 1219"),
            replace("findings.toml", "seq = 2267", "seq = 2269"),
        ],
    ),
    "two_of_three": Mistake(
        "Leaves the third finding empty.",
        lost={"filled_in": 3.333, "diverges": 10.0, "lands": 40.0, "each_is_needed": 15.0},
        hint="Finding 3 has no repair yet",
        changes=[
            replace(
                "findings.toml",
                """\
seq = 2267
component = "planner"
was = '''
        if self.phase == "sink" and (height_m < DROP_M or velocity_mps > -SLOW_MPS):
""",
                """\
seq = 0
component = ""
was = '''
""",
            ),
            replace(
                "findings.toml",
                """\
        if self.phase == "sink" and (height_m < DROP_M and velocity_mps > -SLOW_MPS):
'''
cause = "The engine goes out as soon as it is slow, however high it still is: both must be true, not one of them."
""",
                "'''\ncause = \"\"\n",
            ),
        ],
    ),
    "symptom": Mistake(
        "Commands a slower descent instead of repairing the throttler.",
        lost={"diverges": 20.0},
        hint="compensates for a mistake of another component",
        changes=[
            replace(
                "findings.toml",
                """\
component = "throttler"
was = '''
        if plan["phase"] == "brake":
""",
                """\
component = "planner"
was = '''
            plan["target_speed_mps"] = -min(SINK_MPS, max(LAST_MPS, height_m / 5.0))
""",
            ),
            replace(
                "findings.toml",
                """\
        if plan["phase"] in ("brake", "sink"):
'''
cause = "While it sinks nothing holds its weight, so it comes in about 1.6 m/s faster than planned."
""",
                """\
            plan["target_speed_mps"] = -min(SINK_MPS, max(LAST_MPS, height_m / 5.0)) + 1.6
'''
cause = "It sinks 1.6 m/s faster than its target, so the target must be slower."
""",
            ),
        ],
    ),
    "without_the_spaces": Mistake(
        "Quotes a line without its exact spaces.",
        lost={"filled_in": 3.333, "diverges": 10.0, "lands": 40.0, "each_is_needed": 15.0},
        hint="with the spaces before it",
        changes=[
            replace(
                "findings.toml",
                '        height_m = radar["altitude_m"] - velocity_mps * late_s\n',
                '    height_m = radar["altitude_m"]-velocity_mps * late_s\n',
            )
        ],
    ),
    "failed_code_changed": Mistake(
        "Repairs failed.py itself.",
        lost={"unchanged": 5.0, "filled_in": 10.0, "diverges": 30.0, "lands": 40.0, "each_is_needed": 15.0},
        hint="failed.py has been changed",
        changes=[replace("failed.py", 'radar["altitude_m"] - velocity_mps', 'radar["altitude_m"] + velocity_mps')],
    ),
    "no_causes": Mistake(
        "Writes 'fixed' instead of a cause.",
        lost={"filled_in": 10.0},
        hint="Describe in `cause`, in one line, what is wrong",
        changes=[
            replace(
                "findings.toml",
                "The module keeps falling after the reading, so the estimate must be lower than the radar's value, "
                "not higher.",
                "fixed",
            ),
            replace(
                "findings.toml",
                "While it sinks nothing holds its weight, so it comes in about 1.6 m/s faster than planned.",
                "fixed",
            ),
            replace(
                "findings.toml",
                "The engine goes out as soon as it is slow, however high it still is: both must be true, "
                "not one of them.",
                "fixed",
            ),
        ],
    ),
    "not_toml": Mistake(
        "Leaves a value empty, which is not valid TOML.",
        lost={"filled_in": 10.0, "diverges": 30.0, "lands": 40.0, "each_is_needed": 15.0},
        hint="findings.toml cannot be read",
        changes=[replace("findings.toml", "seq = 1989", "seq = ")],
    ),
}
