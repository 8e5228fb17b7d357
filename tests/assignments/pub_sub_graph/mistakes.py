"""Wrong solutions of the lab "pub-sub graph", their lost points and their hints."""

from tests.assignments.mistakes import Mistake, replace, write

MISTAKES = {
    "shared_global": Mistake(
        "Shares a global dict between modules instead of storing pages.",
        lost={"mixer_alone": 20.0, "in_any_order": 20.0, "apart": 6.0},
        hint="it imports shared",
        changes=[
            replace(
                "heading.py",
                "from laws import turn_moment_nm\n",
                "from laws import turn_moment_nm\nfrom shared import BOARD\n",
            ),
            replace(
                "heading.py",
                """\
        return self.store_data_task("turn", {"stamp_s": imu["stamp_s"], "moment_nm": self.moment_nm(imu)})
""",
                """\
        BOARD["stamp_s"], BOARD["moment_nm"] = imu["stamp_s"], self.moment_nm(imu)
        return self.store_data_task("turn", dict(BOARD))
""",
            ),
            replace(
                "mixer.py",
                "from laws import STOP_US, pulses_us\n",
                "from laws import STOP_US, pulses_us\nfrom shared import BOARD\n",
            ),
            replace("mixer.py", "self.turn = turn", "self.turn = BOARD"),
            write("shared.py", 'BOARD = {"stamp_s": None, "moment_nm": 0.0}\n'),
        ],
    ),
    "direct_object_access": Mistake(
        "Writes into the mixer object instead of storing a page.",
        lost={"depth_alone": 12.0, "in_any_order": 20.0, "apart": 3.0},
        hint="it accesses another component",
        changes=[
            replace("depth.py", "return None", "return"),
            replace(
                "depth.py",
                '        return self.store_data_task("lift", {"stamp_s": imu["stamp_s"], "force_n": force_n})\n',
                """\
        self.parent.components["mixer"].lift = {"stamp_s": imu["stamp_s"], "force_n": force_n}
        return
""",
            ),
        ],
    ),
    "misses_transient_page": Mistake(
        "Reads the newest `controls` at each `imu` page and misses a request that is sent once.",
        lost={"heading_alone": 12.0, "dropped_in": 12.0},
        hint="handle every page 'controls'",
        changes=[
            replace(
                "heading.py",
                '    @handles("controls")\n    def on_controls(self, controls):\n',
                "    def apply(self, controls):\n",
            ),
            replace(
                "heading.py",
                "    def on_imu(self, imu):\n",
                """\
    def on_imu(self, imu):
        controls = self.get_data("controls")
        if controls is not None:
            self.apply(controls)
""",
            ),
        ],
    ),
    "stale_setpoint": Mistake(
        "Keeps the requested depth after the vehicle is disarmed.",
        lost={"depth_alone": 12.0},
        hint="Drop requests from before the vehicle was disarmed",
        changes=[
            replace(
                "depth.py",
                """\
        if not self.is_armed:
            self.target_m = None
        elif controls["depth_m"] is not None:
""",
                '        if controls["depth_m"] is not None:\n',
            )
        ],
    ),
    "waits_for_the_depth": Mistake(
        "Waits for process_data of `depth`, which the vehicle's sensor does not send.",
        lost={"depth_alone": 12.0},
        hint="depth.py handles process_data 'depth'",
        changes=[
            replace("depth.py", "self.depth_m = None", "self.rate_mps = 0.0"),
            replace(
                "depth.py",
                '            self.target_m = controls["depth_m"]\n\n',
                """\
            self.target_m = controls["depth_m"]

    @handles("depth")
    def on_depth(self, depth):
        self.rate_mps = self.rate.update(depth["depth_m"], depth["stamp_s"])

""",
            ),
            replace("depth.py", '        rate_mps = self.rate.update(depth["depth_m"], depth["stamp_s"])\n', ""),
            replace(
                "depth.py",
                '(self.target_m, depth["depth_m"], rate_mps)',
                '(self.target_m, depth["depth_m"], self.rate_mps)',
            ),
        ],
    ),
    "answers_each_pair_twice": Mistake(
        "Answers a pair as often as it finds it complete, which may be twice.",
        lost={"in_any_order": 20.0},
        hint="each handler finds the pair complete",
        changes=[
            replace("mixer.py", "        self.turn = None\n        self.lift = None\n", ""),
            replace(
                "mixer.py",
                """\
    @handles("turn")
    def on_turn(self, turn):
        self.turn = turn
        return self.mixed()

    @handles("lift")
    def on_lift(self, lift):
        self.lift = lift
        return self.mixed()

    def mixed(self):
        if self.turn is None or self.lift is None or self.turn["stamp_s"] != self.lift["stamp_s"]:
""",
                """\
    @handles("turn", task=True)
    @handles("lift", task=True)
    def on_any(self, task):
        turn, lift = self.get_data("turn"), self.get_data("lift")
        if turn is None or lift is None or turn["stamp_s"] != lift["stamp_s"]:
""",
            ),
            replace(
                "mixer.py",
                'pulses_us(self.turn["moment_nm"], self.lift["force_n"])',
                'pulses_us(turn["moment_nm"], lift["force_n"])',
            ),
        ],
    ),
    "stamps_its_own_time": Mistake(
        "Stamps its page with the current time instead of the stamp of the `imu` page.",
        lost={"depth_alone": 12.0, "in_any_order": 20.0},
        hint="The stamp of 'lift' is not that of",
        changes=[replace("depth.py", 'imu["stamp_s"]', "self.get_time_s()")],
    ),
    "mixes_at_every_imu": Mistake(
        "Stores pulses at every `imu` page instead of once for each pair.",
        lost={"mixer_alone": 20.0, "in_any_order": 20.0},
        hint="Does it read them from elsewhere?",
        changes=[
            replace(
                "mixer.py",
                """\
    @handles("turn")
    def on_turn(self, turn):
        self.turn = turn
        return self.mixed()

    @handles("lift")
    def on_lift(self, lift):
        self.lift = lift
        return self.mixed()

    def mixed(self):
        if self.turn is None or self.lift is None or self.turn["stamp_s"] != self.lift["stamp_s"]:
""",
                """\
    @handles("imu")
    def on_imu(self, imu):
        self.turn, self.lift = self.get_data("turn"), self.get_data("lift")
        if self.turn is None or self.lift is None:
""",
            ),
        ],
    ),
    "mixes_with_the_last_one": Mistake(
        "Combines a lift with the newest turn, whatever its stamp.",
        lost={"mixer_alone": 20.0},
        hint="The first page of a pair has no partner yet",
        changes=[
            replace(
                "mixer.py",
                """\
    @handles("turn")
    def on_turn(self, turn):
        self.turn = turn
        return self.mixed()

    @handles("lift")
    def on_lift(self, lift):
        self.lift = lift
""",
                """\
    @handles("lift")
    def on_lift(self, lift):
        self.turn, self.lift = self.get_data("turn"), self.get_data("lift")
""",
            ),
            replace("mixer.py", ' or self.lift is None or self.turn["stamp_s"] != self.lift["stamp_s"]:', ":"),
        ],
    ),
    "one_for_all_vehicles": Mistake(
        "Keeps the waiting pages in a global, which all vehicles share.",
        lost={"apart": 3.0},
        hint="'WAITING' is defined outside of every object",
        changes=[
            replace(
                "mixer.py",
                "from snr_sim import Endpoint, handles\n",
                """\
from snr_sim import Endpoint, handles

WAITING = {}
""",
            ),
            replace("mixer.py", "        self.turn = None\n        self.lift = None\n", ""),
            replace("mixer.py", "self.turn = turn", 'WAITING["turn"] = turn'),
            replace("mixer.py", "self.lift = lift", 'WAITING["lift"] = lift'),
            replace(
                "mixer.py",
                """\
        if self.turn is None or self.lift is None or self.turn["stamp_s"] != self.lift["stamp_s"]:
""",
                """\
        turn, lift = WAITING.get("turn"), WAITING.get("lift")
        if turn is None or lift is None or turn["stamp_s"] != lift["stamp_s"]:
""",
            ),
            replace(
                "mixer.py",
                'pulses_us(self.turn["moment_nm"], self.lift["force_n"])',
                'pulses_us(turn["moment_nm"], lift["force_n"])',
            ),
        ],
    ),
    "forgets_to_limit": Mistake(
        "Limits the moment to 2 N m instead of 1 N m.",
        lost={"dropped_in": 12.0},
        hint="gentle.py turns harder than 1 N m",
        changes=[replace("gentle.py", "MAX_NM = 1.0", "MAX_NM = 2.0")],
    ),
    "never_takes_gentle": Mistake(
        "Ignores the option heading=gentle.",
        lost={"holds_heading": 6.0},
        hint="does graph.py put gentle.py in heading's place?",
        changes=[
            replace("graph.py", "from gentle import Gentle\n", ""),
            replace(
                "graph.py",
                """\
    turns = Gentle if robot.options.get("heading") == "gentle" else Heading
    return [turns.factory("heading"), DepthHold.factory(), Mixer.factory(), StatusPublisher.factory()]
""",
                "    return [Heading.factory(), DepthHold.factory(), Mixer.factory(), StatusPublisher.factory()]\n",
            ),
        ],
    ),
}
