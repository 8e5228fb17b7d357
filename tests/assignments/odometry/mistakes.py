"""Wrong solutions of the lab "odometry", their lost points and their hints."""

from tests.assignments.mistakes import Mistake, replace

FILE = "where.py"
ALL_DRIVES = {"in_the_node": 10, "square": 20}

MISTAKES = {
    "one_wheel": Mistake(
        "Takes the way of one wheel.",
        lost={"way": 15, "square": 20},
        hint="It takes the wheel motor_LF alone",
        changes=[replace(FILE, "    return sum(ways) / len(ways)\n", "    return ways[0]\n")],
    ),
    "sum_of_wheels": Mistake(
        "Adds up the ways of all wheels.",
        lost={"way": 15, **ALL_DRIVES},
        hint="take their mean",
        changes=[replace(FILE, "sum(ways) / len(ways)", "sum(ways)")],
    ),
    "outer_radius": Mistake(
        "Takes the wheel's radius for the rolling radius.",
        lost={"way": 15},
        hint="The rolling radius is ROLLING_M",
        changes=[replace(FILE, "ROLLING_M * (now", "0.13 * (now")],
    ),
    "since_the_start": Mistake(
        "Takes the whole way since the start each time.",
        lost={"way": 15, **ALL_DRIVES},
        hint="That is the way since the start",
        changes=[replace(FILE, "(now - before) for", "now for")],
    ),
    "heading_before": Mistake(
        "Moves along the heading before the turn.",
        lost={"move": 20},
        hint="heading before the turn",
        changes=[replace(FILE, "middle = heading_rad + turn_rad / 2.0", "middle = heading_rad")],
    ),
    "sine_for_x": Mistake(
        "Takes the sine for x and the cosine for y.",
        lost={"move": 20, **ALL_DRIVES},
        hint="x goes with the cosine",
        changes=[
            replace(
                FILE,
                "x_m + way_m * math.cos(middle), y_m + way_m * math.sin(middle)",
                "x_m + way_m * math.sin(middle), y_m + way_m * math.cos(middle)",
            )
        ],
    ),
    "not_wrapped": Mistake(
        "Turns by more than half a circle.",
        lost={"bearing": 15, "square": 20},
        hint="shorter the other way round",
        changes=[replace(FILE, "math.remainder(direction - heading_rad, 2.0 * math.pi)", "direction - heading_rad")],
    ),
    "atan": Mistake(
        "Cannot tell ahead from behind.",
        lost={"bearing": 15, "square": 20},
        hint="use math.atan2",
        changes=[
            replace(
                FILE,
                "math.atan2(point_m[1] - y_m, point_m[0] - x_m)",
                "math.atan((point_m[1] - y_m) / ((point_m[0] - x_m) or 1e-9))",
            )
        ],
    ),
    "bias_stays": Mistake(
        "Adds up the bias of the gyroscope.",
        lost={"gyro": 15},
        hint="It adds up the bias too",
        changes=[replace(FILE, "+= (rate_radps - self.bias_radps) *", "+= rate_radps *")],
    ),
    "fixed_step": Mistake(
        "Takes all readings to be 0.02 s apart.",
        lost={"gyro": 15, "in_the_node": 10},
        hint="do not come at equal distances",
        changes=[replace(FILE, "* (stamp_s - self.before_s)", "* 0.02")],
    ),
    "first_reading_is_a_way": Mistake(
        "Takes the first reading for a way.",
        lost={"in_the_node": 10},
        hint="It jumps at the first page",
        changes=[
            replace(FILE, "        self.wheels_rad = None  #", "        self.wheels_rad = [0.0] * 6  #"),
        ],
    ),
    "compass_of_the_last_time": Mistake(
        "Forgets where it looked, so a turn is the whole heading.",
        lost=ALL_DRIVES,
        hint="puts them together in another way",
        changes=[
            replace(
                FILE,
                "self.wheels_rad, self.heading_rad = now_rad, self.gyro.heading_rad",
                "self.wheels_rad = now_rad",
            ),
            replace(FILE, '"heading_rad": self.heading_rad, "off', '"heading_rad": self.gyro.heading_rad, "off'),
        ],
    ),
}
