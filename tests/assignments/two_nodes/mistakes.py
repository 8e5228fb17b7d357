"""Wrong solutions of the lab "two nodes", their lost points and their hints."""

from tests.assignments.mistakes import Mistake, replace

MISTAKES = {
    "age_from_arrival": Mistake(
        "Counts the age of a command from its arrival instead of its creation.",
        lost={"narrow": 14.0, "gone": 10.0},
        hint="The time since a page arrived does not include",
        changes=[
            replace(
                "vehicle.py",
                """\
        made_s = self.get_time_s() - self.get_age_s("controls")
        if made_s > self.made_s:
            self.command, self.made_s = controls, made_s
""",
                """\
        if self.command is None or controls["number"] > self.command["number"]:
            self.command, self.made_s = controls, self.get_time_s()
""",
            )
        ],
    ),
    "no_age_check": Mistake(
        "Never checks the age of a command.",
        lost={"vehicle_alone": 10.0, "cut": 18.0},
        hint="It applied a command that was created more than 0.45 s before",
        changes=[replace("vehicle.py", "return self.get_time_s() - self.made_s <= COUNTS_S", "return True")],
    ),
    "arrival_order": Mistake(
        "Takes the command that arrives last, even if it is not the newest.",
        lost={"lost_and_overtaken": 14.0},
        hint="last one to arrive is not always the newest",
        changes=[
            replace(
                "vehicle.py",
                """\
        made_s = self.get_time_s() - self.get_age_s("controls")
        if made_s > self.made_s:
            self.command, self.made_s = controls, made_s
""",
                """\
        self.command, self.made_s = controls, self.get_time_s() - self.get_age_s("controls")
""",
            )
        ],
    ),
    "timeout_too_short": Mistake(
        "Drops commands after 0.25 s instead of 0.45 s.",
        lost={"vehicle_alone": 10.0, "late": 10.0},
        hint="The pulses are neutral although a fresh enough command had arrived",
        changes=[replace("vehicle.py", "COUNTS_S = 0.45", "COUNTS_S = 0.25")],
    ),
    "sends_only_while_connected": Mistake(
        "Sends commands only while it receives pages of the vehicle.",
        lost={"surface_alone": 8.0},
        hint="also while the vehicle is silent",
        changes=[
            replace(
                "topside.py",
                """\
        return [self.store_data_task("controls", sticks), self.store_data_task("alarm", {"state": state})]
""",
                """\
        alarm = self.store_data_task("alarm", {"state": state})
        if state == "lost":
            return alarm
        return [self.store_data_task("controls", sticks), alarm]
""",
            )
        ],
    ),
    "ignores_page_age": Mistake(
        "Reports 'ok' while the link is up, even if the vehicle's pages are old.",
        lost={"watches": 16.0},
        hint="'old' while the link is up and the newest page 'vehicle'",
        changes=[
            replace(
                "topside.py",
                """\
        if self.get_data("vehicle") is None or self.get_age_s("vehicle") > OLD_S:
            return "old"
""",
                "",
            )
        ],
    ),
    "pulses_on_every_command": Mistake(
        "Stores pulses at every command, too, instead of only at every `imu` page.",
        lost={"vehicle_alone": 10.0, "late": 10.0},
        hint="Store one page 'pwm' for each page 'imu'",
        changes=[
            replace(
                "vehicle.py",
                "            self.command, self.made_s = controls, made_s\n",
                """\
            self.command, self.made_s = controls, made_s
        return self.store_data_task("pwm", self.pwm(), process=False)

    def pwm(self):
        pulses = pulses_us(self.command["surge"], self.command["yaw"]) if self.counts() else neutral_us()
        return {"pulses_us": pulses, "is_armed": self.command is not None and self.command["is_armed"]}
""",
            ),
            replace(
                "vehicle.py",
                """\
        is_armed = self.command is not None and self.command["is_armed"]
        pulses = neutral_us()
        if counts:
            pulses = pulses_us(self.command["surge"], self.command["yaw"])
        answer = [self.store_data_task("pwm", {"pulses_us": pulses, "is_armed": is_armed}, process=False)]
""",
                '        answer = [self.store_data_task("pwm", self.pwm(), process=False)]\n',
            ),
        ],
    ),
    "disarms_on_timeout": Mistake(
        "Stores `is_armed` as false when the command is too old.",
        lost={"vehicle_alone": 10.0, "gone": 10.0},
        hint="'is_armed' of the page 'pwm' must be that of the newest command",
        changes=[replace("vehicle.py", 'self.command is not None and self.command["is_armed"]', "counts")],
    ),
}
