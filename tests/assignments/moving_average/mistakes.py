"""Wrong solutions of the lab "moving average", their lost points and their hints."""

from tests.assignments.mistakes import Mistake, replace, write

MISTAKES = {
    "off_by_one": Mistake(
        "Keeps one value too many.",
        lost={"exact": 20},
        hint="one value too long",
        changes=[replace("smooth.py", "> self.length:", "> self.length + 1:")],
    ),
    "mean_of_all": Mistake(
        "Never removes a value from the window.",
        lost={"exact": 20, "in_the_node": 20, "lands": 15},
        hint="never forgets",
        changes=[
            replace("smooth.py", "        if len(self.window) > self.length:\n            self.window.pop(0)\n", "")
        ],
    ),
    "not_warmed_up": Mistake(
        "Divides by the length before the window is full.",
        lost={"warm_up": 10, "in_the_node": 20, "lands": 15},
        hint="divides by the length",
        changes=[replace("smooth.py", "/ len(self.window)", "/ self.length")],
    ),
    "forgets_the_newest": Mistake(
        "Removes the newest value instead of the oldest.",
        lost={"exact": 20, "in_the_node": 20, "lands": 15},
        hint="drops the newest value",
        changes=[replace("smooth.py", "self.window.pop(0)", "self.window.pop()")],
    ),
    "window_of_all": Mistake(
        "Keeps the window in the class, so all filters share it.",
        lost={"fresh": 10, "in_the_node": 20, "lands": 15},
        hint="is shared by all",
        changes=[
            replace(
                "smooth.py",
                "class MovingAverage:\n",
                """\
class MovingAverage:
    window = []

""",
            ),
            replace("smooth.py", "        self.window = []\n", ""),
        ],
    ),
    "one_filter_for_two": Mistake(
        "Uses one filter for both heights and speeds.",
        lost={"in_the_node": 20, "lands": 15},
        hint="each have a filter",
        changes=[replace("smooth.py", "self.velocity = MovingAverage(LENGTH)", "self.velocity = self.altitude")],
    ),
    "future": Mistake(
        "Averages over values that come later.",
        lost={"exact": 20, "warm_up": 10},
        hint="It uses later values",
        changes=[
            replace(
                "smooth.py",
                "    average = MovingAverage(length)\n    return [average.update(value) for value in values]\n",
                """\
    half = length // 2
    windows = [values[max(0, i - half) : i + length - half] for i in range(len(values))]
    return [sum(window) / len(window) for window in windows]
""",
            )
        ],
    ),
    "filter_per_reading": Mistake(
        "Creates new filters for every reading, so they remember nothing.",
        lost={"in_the_node": 20, "lands": 15},
        hint="remembers nothing",
        changes=[
            replace(
                "smooth.py",
                "        self.altitude = MovingAverage(LENGTH)\n        self.velocity = MovingAverage(LENGTH)\n",
                "",
            ),
            replace(
                "smooth.py",
                """\
        altitude_m = self.altitude.update(radar["altitude_m"])
        velocity_mps = self.velocity.update(radar["velocity_mps"])
""",
                """\
        altitude_m = MovingAverage(LENGTH).update(radar["altitude_m"])
        velocity_mps = MovingAverage(LENGTH).update(radar["velocity_mps"])
""",
            ),
        ],
    ),
    "too_short": Mistake(
        "Averages too few readings to land.",
        lost={"lands": 15},
        hint="With too few readings",
        changes=[replace("smooth.py", "LENGTH = 60", "LENGTH = 5")],
    ),
    "only_the_visible": Mistake(
        "Knows the answer of the visible case and no other.",
        lost={"exact": 40 / 3, "warm_up": 20 / 3},
        hint="as they went in",
        changes=[
            replace(
                "smooth.py",
                "    average = MovingAverage(length)\n    return [average.update(value) for value in values]\n",
                """\
    if values[:4] == [6.0, 0.0, 3.0, 9.0] and length == 3:
        return [6.0, 3.0, 3.0, 4.0, 7.0, 6.0]
    return values
""",
            )
        ],
    ),
    "weak_tests": Mistake(
        "No value ever leaves a window in its test cases.",
        lost={"catches": 12.5},
        hint="wrong filters pass all your cases",
        changes=[
            write(
                "my_tests.py",
                """\
def cases():
    return [
        {"length": 3, "values": [2.0, 2.0, 2.0], "means": [2.0, 2.0, 2.0]},
        {"length": 2, "values": [1.0], "means": [1.0]},
        {"length": 5, "values": [4.0, 4.0], "means": [4.0, 4.0]},
        {"length": 1, "values": [0.0], "means": [0.0]},
    ]
""",
            )
        ],
    ),
    "wrong_tests": Mistake(
        "Expects means that a right filter does not return.",
        lost={"own_tests": 5, "catches": 15},
        hint="fails a correct filter",
        changes=[replace("my_tests.py", "[3.0, 1.5, 3.0, 5.0]", "[1.0, 1.0, 3.0, 5.0]")],
    ),
}
