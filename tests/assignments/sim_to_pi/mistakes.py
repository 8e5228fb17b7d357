"""Wrong solutions of the lab "sim to Pi", their lost points and their hints."""

from tests.assignments.mistakes import Mistake, replace

MISTAKES = {
    "no_ages": Mistake(
        "Never checks the age of `controls` and `depth`.",
        lost={"stale": 10.0, "no_jump": 2.5},
        hint="check the age of the page with get_age_s",
        changes=[
            replace(
                "depth_hold.py",
                """\
        is_fresh = self.get_age_s("controls") <= CONTROLS_S and self.get_age_s("depth") <= DEPTH_S
        return controls["is_armed"] and is_fresh and not self.is_stopped
""",
                '        return controls["is_armed"] and not self.is_stopped\n',
            )
        ],
    ),
    "stop_ends_by_itself": Mistake(
        "Ends the stop at the next page that does not request it.",
        lost={"stop": 10.0},
        hint="keep it in `self.is_stopped`",
        changes=[
            replace(
                "depth_hold.py",
                """\
        if controls["is_stop"]:
            self.is_stopped = True
        elif controls["clears_stop"] and not controls["is_armed"]:
            self.is_stopped = False
""",
                '        self.is_stopped = controls["is_stop"]\n',
            )
        ],
    ),
    "clears_while_armed": Mistake(
        "Clears the stop while the vehicle is armed.",
        lost={"stop": 3.333},
        hint="counts only if it is disarmed",
        changes=[replace("depth_hold.py", ' and not controls["is_armed"]:', ":")],
    ),
    "newest_page_only": Mistake(
        "Reads only the newest `controls` at each `imu` page and misses a stop in an earlier one.",
        lost={"stop": 3.333},
        hint="A stop that was sent in one page only was missed",
        changes=[
            replace("depth_hold.py", '    @handles("controls")\n', ""),
            replace(
                "depth_hold.py",
                "        pulses_us = [STOP_US] * 8\n",
                """\
        pulses_us = [STOP_US] * 8
        if controls is not None:
            self.on_controls(controls)
""",
            ),
        ],
    ),
    "no_reset_while_idle": Mistake(
        "Keeps the integral and the goal while nothing may push.",
        lost={"no_jump": 5.0},
        hint="reset the goal while the outputs are neutral",
        changes=[replace("depth_hold.py", "        else:\n            self.reset()\n", "")],
    ),
    "proportional_only": Mistake(
        "Has no integral term and too little gain.",
        lost={"holds": 35.0},
        hint="which term sums the error over time",
        changes=[replace("depth_hold.py", "80.0, 20.0, 70.0  # N/m, N/(m s), N s/m", "10.0, 0.0, 30.0")],
    ),
    "inside_dead_band": Mistake(
        "Computes pulses that stay within the thrusters' dead band.",
        lost={"holds": 35.0},
        hint="are the pulses beyond the dead band",
        changes=[replace("depth_hold.py", "DEAD_US + share * (FULL_US - DEAD_US)", "5.0 * share")],
    ),
}
