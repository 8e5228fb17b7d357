"""Wrong solutions of the lab "mission state machine", their lost points and their hints.

The same ones in the other forms of the machine: as a table, and as text.
"""

import shutil
from collections.abc import Sequence
from pathlib import Path

from tests.assignments.mistakes import Change, Mistake, replace

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
        "Ignores the emergency stop in the states 'waiting', 'surfacing' and 'done'.",
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


HERE = Path(__file__).parent
ANOTHER_WAY = HERE.parents[2] / "assignments" / "05_mission_state_machine" / "starter" / "another_way"
TABLE, TEXT = "machine.py", "mission.lrp"
STICKS = MISTAKES["stops_with_sticks_at_zero"].changes  # of mission.py, which is the same in all forms
ALARM = 'on(known("stop"), to="stopped")'
GO_ON = "(on [robot.reset_button.read() and not robot.stop_button.read()] stopped -> waiting)"
LIMITS_S = {"lining_up": 30, "passing": 20, "holding": 5}

# The changes of a mistake, by form and by its name in MISTAKES; one that is not here cannot be written in this form.
FORMS: dict[str, dict[str, Sequence[Change]]] = {
    "table": {
        "stops_while_pressed": [replace(TABLE, 'm.data("reset") and not m.data("stop")', 'not m.data("stop")')],
        "stops_in_some_states": [
            replace(TABLE, f"    anywhere=[{ALARM}],\n", ""),
            *(replace(TABLE, f'"{name}",\n', f'"{name}",\n            {ALARM},\n') for name in LIMITS_S),
        ],
        "stops_with_sticks_at_zero": STICKS,
        "timeout_from_run_start": [
            replace(
                TABLE,
                f'"{name}",\n            on(known("is_wet"), to="surfacing"),\n            on(is_over({limit_s:.1f})',
                f'"{name}",\n            on(known("is_wet"), to="surfacing"),\n'
                f'            on(lambda m: m.data("now_s") > {limit_s}',
            )
            for name, limit_s in LIMITS_S.items()
        ],
        "no_hold_timeout": [replace(TABLE, '            on(is_over(5.0), to="surfacing"),\n', "")],
        "adds_up_short_stays": [replace(TABLE, 'on(is_far, to="far"), ', "")],
        "resumes_after_stop": [replace(TABLE, 'on(is_released, to="waiting")', 'on(is_released, to="lining_up")')],
    },
    "text": {
        "stops_while_pressed": [replace(TEXT, GO_ON, "(on [not robot.stop_button.read()] stopped -> waiting)")],
        "stops_in_some_states": [
            replace(
                TEXT,
                "(on stop * -> stopped)",
                "\n  ".join(f"(on stop {name} -> stopped)" for name in LIMITS_S),
            )
        ],
        "stops_with_sticks_at_zero": STICKS,
        "timeout_from_run_start": [
            replace(TEXT, f"(ontime {limit_s}000 {name} ", f"(on [now_ms > {limit_s}000] {name} ")
            for name, limit_s in LIMITS_S.items()
        ],
        "no_hold_timeout": [replace(TEXT, "  (ontime 5000 holding -> surfacing)\n", "")],
        "adds_up_short_stays": [replace(TEXT, "      (on [far_m() > 0.25] near -> far)\n", "")],
        "resumes_after_stop": [replace(TEXT, GO_ON, GO_ON.replace("waiting", "lining_up"))],
    },
}


def use_form(form: str) -> Change:
    """Return a change that puts the machine of the reference, and what is given with its form, into a folder."""

    def change(folder: Path) -> None:
        for source in (ANOTHER_WAY / form, HERE / form):
            shutil.copytree(source, folder, dirs_exist_ok=True, ignore=shutil.ignore_patterns("__pycache__"))

    return change
