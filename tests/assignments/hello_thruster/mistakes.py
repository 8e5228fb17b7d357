"""Wrong solutions of the lab "hello thruster", their lost points and their hints."""

from tests.assignments.mistakes import Mistake, replace

MISTAKES = {
    "sign_error": Mistake(
        "Every thruster pushes the opposite way.",
        lost={"heave": 20, "surge": 15, "dives": 15},
        hint="a sign is reversed",
        changes=[replace("hello_thruster.py", "STOP_US + FULL_US", "STOP_US - FULL_US")],
    ),
    "off_by_one": Mistake(
        "Counts the channels from 1.",
        lost={"heave": 20, "surge": 15, "dives": 15},
        hint="the first channel of a list has index 0",
        changes=[
            replace(
                "hello_thruster.py", "] * counted(heave) + SURGE[channel", " - 1] * counted(heave) + SURGE[channel - 1"
            )
        ],
    ),
    "not_clamped": Mistake(
        "A stick above 1 gives more than full thrust.",
        lost={"limits": 10},
        hint="Clamp it to full thrust",
        changes=[replace("hello_thruster.py", "return max(-1.0, min(1.0, value))", "return value")],
    ),
    "no_rest": Mistake(
        "A stick at rest still moves the thrusters.",
        lost={"rest": 10},
        hint="on either side, is at rest",
        changes=[replace("hello_thruster.py", "    if abs(value) < REST:\n        return 0.0\n", "")],
    ),
    "ignores_arming": Mistake(
        "Pushes before the vehicle is armed.",
        lost={"disarmed": 15},
        hint="The vehicle is not armed",
        changes=[
            replace(
                "hello_thruster.py",
                """\
        pulses = [STOP_US] * 8
        if controls["is_armed"]:
            pulses = pulses_us(controls["heave"], controls["surge"])
""",
                '        pulses = pulses_us(controls["heave"], controls["surge"])\n',
            )
        ],
    ),
    "returns_nothing": Mistake(
        "Builds the list and does not return it.",
        lost={
            "loads": 5,
            "heave": 20,
            "surge": 15,
            "rest": 10,
            "limits": 10,
            "disarmed": 15,
            "one_page": 10,
            "dives": 15,
        },
        hint="must be a list of eight pulses; it is None",
        changes=[replace("hello_thruster.py", "    return pulses\n", "")],
    ),
    "growing_default_list": Mistake(
        "A default of [] is created once and grows with every call.",
        lost={"heave": 20, "surge": 15, "rest": 10, "limits": 10, "disarmed": 7.5, "dives": 15},
        hint="is shared by all calls and grows",
        changes=[
            replace(
                "hello_thruster.py",
                '''\
def pulses_us(heave, surge):
    """Return the list of eight pulses for two sticks."""
    pulses = []
''',
                '''\
def pulses_us(heave, surge, pulses=[]):
    """Return the list of eight pulses for two sticks."""
''',
            )
        ],
    ),
    "too_many_pages": Mistake(
        "Stores a second page that the lab does not ask for.",
        lost={"one_page": 10},
        hint="return only the page 'pwm'",
        changes=[
            replace(
                "hello_thruster.py",
                """\
        return self.store_data_task("pwm", {"pulses_us": pulses, "is_armed": controls["is_armed"]})
""",
                """\
        pwm = self.store_data_task("pwm", {"pulses_us": pulses, "is_armed": controls["is_armed"]})
        return [pwm, self.store_data_task("debug", pulses)]
""",
            )
        ],
    ),
    "only_the_visible": Mistake(
        "Knows the answers of the visible cases and no others.",
        lost={"heave": 20 * 2 / 3, "surge": 15 * 2 / 3, "limits": 10, "dives": 15},
        hint="1500 + 400 x stick",
        changes=[
            replace(
                "hello_thruster.py",
                """\
    pulses = []
    for channel in range(8):
        share = HEAVE[channel] * counted(heave) + SURGE[channel] * counted(surge)
        pulses.append(STOP_US + FULL_US * share)
    return pulses
""",
                """\
    known = {-0.6: 0.6, -0.5: 0.5, -1.0: 1.0, 0.25: -0.25, 0.5: -0.5, 1.0: -1.0}
    down = known.get(heave, 0.0)
    ahead = {0.5: 0.5, -0.25: -0.25, 0.2: 0.2, 1.0: 1.0}.get(surge, 0.0)
    return [STOP_US + FULL_US * (SURGE[channel] * ahead - HEAVE[channel] * down) for channel in range(8)]
""",
            )
        ],
    ),
}
