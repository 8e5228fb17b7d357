"""Wrong solutions of the lab "perception drop-in", their lost points and their hints."""

from tests.assignments.mistakes import Mistake, replace

MISTAKES = {
    "red_threshold": Mistake(
        "Searches for red, which water absorbs first.",
        lost={"clear": 15.0, "murky": 15.0, "covered": 10.0, "cluttered": 15.0, "lost": 15.0, "hovers": 10.0},
        hint="water absorbs red first",
        changes=[
            replace(
                "perception.py",
                """\
    if yellow.max() < MIN_YELLOW:
        return None
    best, best_px = None, 0
    for rows, columns in spots(yellow > max(MIN_YELLOW, SHARE * yellow.max())):
""",
                "    best, best_px = None, 0\n    for rows, columns in spots(rgb[..., 0] > 150):\n",
            )
        ],
    ),
    "fixed_threshold": Mistake(
        "Compares colours with fixed numbers instead of the rest of the picture.",
        lost={"murky": 15.0, "hovers": 10.0},
        hint="compare with the rest of the picture, not with a fixed number",
        changes=[
            replace(
                "perception.py",
                """\
    yellow = yellow - np.median(yellow)  # whatever colour the water has
    yellow[green < DARK * np.median(green)] = 0.0  # a dark thing has no blue, either
    if yellow.max() < MIN_YELLOW:
""",
                """\
    yellow = yellow + 60.0
    yellow[green < DARK * np.median(green)] = 0.0  # a dark thing has no blue, either
    if yellow.max() < 100.0:
""",
            ),
            replace("perception.py", "max(MIN_YELLOW, SHARE * yellow.max())", "100.0"),
        ],
    ),
    "mean_of_all": Mistake(
        "Takes the mean of all yellow pixels instead of the largest spot.",
        lost={"cluttered": 15.0, "lost": 7.5, "hovers": 10.0},
        hint="which pixels are connected",
        changes=[
            replace(
                "perception.py",
                """\
    best, best_px = None, 0
    for rows, columns in spots(yellow > max(MIN_YELLOW, SHARE * yellow.max())):
        if len(rows) >= MIN_PX and slenderness(rows, columns) < LONGEST and len(rows) > best_px:
            best, best_px = (rows, columns), len(rows)
    if best is None:
        return None
    height, width = yellow.shape
    rows, columns = best
    return sum(columns) / len(columns) - 0.5 * (width - 1), sum(rows) / len(rows) - 0.5 * (height - 1)
""",
                """\
    rows, columns = np.nonzero(yellow > SHARE * yellow.max())
    return float(columns.mean()) - 31.5, float(rows.mean()) - 23.5
""",
            )
        ],
    ),
    "rows_for_columns": Mistake(
        "Exchanges rows and columns.",
        lost={"clear": 15.0, "murky": 15.0, "covered": 10.0, "cluttered": 15.0, "hovers": 10.0},
        hint="the first index of an array is its row",
        changes=[
            replace(
                "perception.py",
                "columns) / len(columns) - 0.5 * (width - 1), sum(rows) / len(rows) - 0.5 * (height",
                "rows) / len(rows) - 0.5 * (height - 1), sum(columns) / len(columns) - 0.5 * (width",
            )
        ],
    ),
    "left_for_right": Mistake(
        "Returns how far left of the middle the plate is instead of how far right.",
        lost={"clear": 15.0, "murky": 15.0, "covered": 10.0, "cluttered": 15.0, "hovers": 10.0},
        hint="right_px has the wrong sign",
        changes=[
            replace(
                "perception.py",
                "return sum(columns) / len(columns) - 0.5 * (width - 1),",
                "return 0.5 * (width - 1) - sum(columns) / len(columns),",
            )
        ],
    ),
    "keeps_the_last": Mistake(
        "Repeats the last position when the plate is out of sight.",
        lost={"lost": 15.0, "hovers": 10.0},
        hint="the last position is no longer valid",
        changes=[
            replace(
                "perception.py",
                "        super().__init__(factory, parent, name)\n        self.lost_s = None\n",
                "        super().__init__(factory, parent, name)\n        self.last = (0.0, 0.0)\n",
            ),
            replace(
                "perception.py",
                """\
            self.lost_s = None
            target["right_px"], target["down_px"] = found
        else:
            if self.lost_s is None:
                self.lost_s = camera["stamp_s"]
            target["mode"] = "search" if camera["stamp_s"] - self.lost_s >= SEARCH_S else "stop"
""",
                '            self.last = found\n        target["right_px"], target["down_px"] = self.last\n',
            ),
        ],
    ),
    "no_search": Mistake(
        "Never searches when the plate is out of sight.",
        lost={"lost": 15.0, "hovers": 10.0},
        hint="It stops and never searches",
        changes=[replace("perception.py", '"search" if camera["stamp_s"] - self.lost_s >= SEARCH_S else ', "")],
    ),
    "another_gain": Mistake(
        "Changes a gain in steer.py, which must stay as it is.",
        lost={"unchanged": 10.0, "hovers": 10.0},
        hint="steer.py differs from the starter's",
        changes=[replace("steer.py", "STICK_PER_PX = 0.012", "STICK_PER_PX = 0.02")],
    ),
}
