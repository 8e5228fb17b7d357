"""Wrong solutions of the lab "mission state machine", their lost points and their hints."""

from tests.assignments.mistakes import Mistake, replace

MISTAKES = {
    "stops_while_pressed": Mistake(
        "Leaves the stop when the button is released, without a reset.",
        lost={"stops": 15.0, "recovers": 10.0},
        hint="Reset was not pressed",
        changes=[
            replace(
                "machine.py",
                '"waiting" if known["reset"] and not known["stop"] else None',
                'None if known["stop"] else "waiting"',
            )
        ],
    ),
    "stops_in_some_states": Mistake(
        "Ignores the emergency stop in the states 'waiting' and 'done'.",
        lost={"stops": 7.5},
        hint="the emergency stop counts in every state",
        changes=[
            replace("machine.py", '        if known["stop"]:\n            return "stopped"\n', ""),
            replace(
                "machine.py",
                '        if self.state == "done":\n            return None\n',
                """\
        if self.state == "done":
            return None
        if known["stop"]:
            return "stopped"
""",
            ),
        ],
    ),
    "stops_with_sticks_at_zero": Mistake(
        "Sets no `is_stop` when it stops, and stays armed.",
        lost={"check_controls": 8.0, "stops": 15.0},
        hint="Sticks at 0 do not stop it",
        changes=[
            replace(
                "mission.py",
                """\
        if self.machine.state == "stopped":
            controls["is_stop"] = True
        if self.machine.state in ("holding", "surfacing"):
""",
                '        if self.machine.state in ("stopped", "holding", "surfacing"):\n',
            )
        ],
    ),
    "timeout_from_run_start": Mistake(
        "Counts a time limit from the start of the run instead of the start of the state.",
        lost={"time_outs": 12.5, "trouble": 6.667, "stops": 1.875},
        hint="counted from when 'passing' began",
        changes=[
            replace(
                "machine.py",
                'known["is_wet"] or in_state_s > LIMIT_S[self.state]:',
                'known["is_wet"] or known["now_s"] > LIMIT_S[self.state]:',
            )
        ],
    ),
    "no_hold_timeout": Mistake(
        "Holds without a time limit.",
        lost={"time_outs": 7.5},
        hint="'holding' for more than 5 s",
        changes=[replace("machine.py", '"holding": 5.0', '"holding": 1e9')],
    ),
    "adds_up_short_stays": Mistake(
        "Counts a stay near the gate from the first visit, even if the vehicle left in between.",
        lost={"follows_the_picture": 6.0},
        hint="short stays do not add up",
        changes=[
            replace(
                "machine.py",
                """\
        if known["distance_m"] > NEAR_M:
            self.near_since_s = None
        elif self.near_since_s is None:
""",
                """\
        if self.near_since_s is None and known["distance_m"] > NEAR_M:
            return None
        if self.near_since_s is None:
""",
            )
        ],
    ),
    "resumes_after_stop": Mistake(
        "Continues with 'lining_up' after a stop instead of 'waiting'.",
        lost={"recovers": 10.0, "arrows": 10.0},
        hint="there is no such arrow",
        changes=[
            replace("machine.py", '"stopped": ("waiting",),', '"stopped": ("lining_up",),'),
            replace("machine.py", 'return "waiting" if', 'return "lining_up" if'),
        ],
    ),
    "remembers_an_early_reset": Mistake(
        "Accepts a reset that was pressed before the stop.",
        lost={"recovers": 4.0},
        hint="A reset from before the stop does not count",
        changes=[
            replace(
                "machine.py",
                """\
        self.gate = 0  # the gate it is at: 0, 1, 2, and 3 when all are passed
        self.near_since_s = None
""",
                """\
        self.gate = 0  # the gate it is at: 0, 1, 2, and 3 when all are passed
        self.near_since_s = None
        self.was_reset = False
""",
            ),
            replace(
                "machine.py",
                """\
        if self.state == "stopped":
            return "waiting" if known["reset"] and not known["stop"] else None
""",
                """\
        self.was_reset = self.was_reset or known["reset"]
        if self.state == "stopped":
            if known["stop"] or not self.was_reset:
                return None
            self.was_reset = False
            return "waiting"
""",
            ),
        ],
    ),
}
