"""Wrong solutions of the lab "supervision", their lost points and their hints."""

from tests.assignments.mistakes import Mistake, replace

PLAN, DRIVE = "supervise.py", "drive.py"
VISION = """            Supervisor("vision", [camera, Child("detector", "on_failure")], strategy="rest_for_one"),
"""

MISTAKES = {
    "silent_too_late": Mistake(
        "Calls a part silent only after its timeout.",
        lost={"watchdog": 20},
        hint="for its whole timeout: >=",
        changes=[
            replace(PLAN, "now_s - self.reported_s[name] >= timeout_s", "now_s - self.reported_s[name] > timeout_s")
        ],
    ),
    "exactly_then": Mistake(
        "Compares the silence by ==, so that one which jumps over the timeout is never found.",
        lost={"watchdog": 20},
        hint="counted from its own last report",
        changes=[
            replace(PLAN, "now_s - self.reported_s[name] >= timeout_s", "now_s - self.reported_s[name] == timeout_s")
        ],
    ),
    "watches_all": Mistake(
        "Begins to watch all that report.",
        lost={"watchdog": 20},
        hint="A part that was never added is not watched",
        changes=[
            replace(
                PLAN,
                "        if name in self.timeouts_s:\n            self.reported_s[name] = now_s\n",
                "        self.reported_s[name] = now_s\n        self.timeouts_s.setdefault(name, 1.0)\n",
            )
        ],
    ),
    "adds_up": Mistake(
        "Adds the new timeout to the old one.",
        lost={"watchdog": 20},
        hint="extend changes the timeout, not the time",
        changes=[
            replace(
                PLAN,
                "            self.timeouts_s[name] = timeout_s\n\n    def hanging",
                "            self.timeouts_s[name] += timeout_s\n\n    def hanging",
            )
        ],
    ),
    "grows_steadily": Mistake(
        "Waits 0.1 s longer each time.",
        lost={"delays": 4},
        hint="Twice as long each time",
        changes=[replace(PLAN, "0.1 * 2.0 ** min(failures, 20)", "0.1 * (failures + 1)")],
    ),
    "waits_too_long": Mistake(
        "Doubles the delay without an end.",
        lost={"delays": 2},
        hint="5 s at most",
        changes=[replace(PLAN, "min(0.1 * 2.0 ** min(failures, 20), 5.0)", "0.1 * 2.0 ** min(failures, 20)")],
    ),
    "counts_all": Mistake(
        "Counts restarts of long ago.",
        lost={"budget": 4},
        hint="Only restarts of the last 30 s count",
        changes=[replace(PLAN, "[one for one in restarted_s if now_s - one < WITHIN_S]", "restarted_s")],
    ),
    "one_more": Mistake(
        "Allows a fourth restart.",
        lost={"budget": 4},
        hint="Three restarts in 30 s",
        changes=[replace(PLAN, "len(recent) < RESTARTS", "len(recent) <= RESTARTS")],
    ),
    "alone": Mistake(
        "Starts the camera again without its detector.",
        lost={"restarts": 4.286},
        hint="useless without its camera",
        changes=[replace(PLAN, ', strategy="rest_for_one"', "")],
    ),
    "all_in_a_row": Mistake(
        "Starts all again that come after what failed.",
        lost={"restarts": 6.429},
        hint="put what is independent apart",
        changes=[replace(PLAN, '"root",\n        [', '"root",\n        strategy="rest_for_one",\n        children=[')],
    ),
    "detector_first": Mistake(
        "Starts the detector before its camera.",
        lost={"restarts": 6.429},
        hint="the camera comes first",
        changes=[
            replace(PLAN, '[camera, Child("detector", "on_failure")]', '[Child("detector", "on_failure"), camera]')
        ],
    ),
    "never": Mistake(
        "Does not start the navigator again.",
        lost={"restarts": 2.143},
        hint="A failed 'navigator' is not started again",
        changes=[replace(PLAN, 'Child("navigator", "on_failure")', 'Child("navigator", "never")')],
    ),
    "impatient": Mistake(
        "Ends a camera that starts slowly.",
        lost={"tree": 4},
        hint="A camera needs 20 s to start",
        changes=[replace(PLAN, ", Timeouts(setup_s=30.0)", "")],
    ),
    "motors_hang": Mistake(
        "Waits 5 s for motors that hang.",
        lost={"tree": 2},
        hint="Motors that are silent for 0.5 s hang",
        changes=[replace(PLAN, "Timeouts(hang_s=0.5)", "Timeouts()")],
    ),
    "short_for_all": Mistake(
        "Gives the navigator no time to think.",
        lost={"tree": 2},
        hint="A navigator may think for three seconds",
        changes=[
            replace(PLAN, 'Child("navigator", "on_failure")', 'Child("navigator", "on_failure", Timeouts(hang_s=0.5))')
        ],
    ),
    "page_of_all": Mistake(
        "Counts failures of the page with those of the motors.",
        lost={"tree": 2},
        hint="A page that failed five times stopped the rover",
        changes=[
            replace(
                PLAN,
                'Supervisor("surface", [Child("page", "on_failure")], intensity=Intensity(10, 30.0))',
                'Child("page", "on_failure")',
            )
        ],
    ),
    "opens_again": Mistake(
        "Opens a page that a person has closed.",
        lost={"tree": 4},
        hint="A page that a person has closed is started again",
        changes=[replace(PLAN, '[Child("page", "on_failure")]', '[Child("page", "always")]')],
    ),
    "motors_last": Mistake(
        "Starts the motors last, so that they are ended first.",
        lost={"tree": 6},
        hint="The motors are started first",
        changes=[
            replace(PLAN, '            Child("motors", "on_failure", Timeouts(hang_s=0.5)),\n', ""),
            replace(PLAN, VISION, VISION + '            Child("motors", "on_failure", Timeouts(hang_s=0.5)),\n'),
        ],
    ),
    "moves_by_itself": Mistake(
        "Drives on after a restart by a command from before.",
        lost={"drives": 6},
        hint="It moves by a stick from before its begin",
        changes=[
            replace(
                DRIVE, '        if self.begun_s is None or stick["made_s"] <= self.begun_s:\n            return\n', ""
            )
        ],
    ),
    "no_lease": Mistake(
        "Drives on while the stick is silent.",
        lost={"drives": 20},
        hint="The stick is silent, and it drives on",
        changes=[replace(DRIVE, ' or imu["stamp_s"] - self.stick["made_s"] > LEASE_S', "")],
    ),
    "last_to_come": Mistake(
        "Takes the last command to come for the newest.",
        lost={"drives": 4},
        hint="A stick that was overtaken replaces a newer one",
        changes=[replace(DRIVE, 'self.stick is None or stick["made_s"] > self.stick["made_s"]', "True")],
    ),
}
