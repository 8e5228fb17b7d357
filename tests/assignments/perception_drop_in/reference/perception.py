"""A solution: water takes the red, so yellow is green without blue; of such spots the biggest compact one."""

import numpy as np
from steer import SteerFactory

from snr_sim import Endpoint, TaskType

MIN_YELLOW = 12.0  # more than the picture's middle value: noise has less
DARK = 0.8  # of the picture's green
SHARE = 0.5  # of the most yellow spot
MIN_PX = 10  # of a spot
LONGEST = 3.0  # times as long as it is wide: a hose is more
SEARCH_S = 1.5


class Perception(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.lost_s = None
        self.task_handlers = {(TaskType.store_page, "camera"): self.on_picture}

    def on_picture(self, task, task_id):
        camera = self.get_data("camera")
        target = {"mode": "track", "right_px": 0.0, "down_px": 0.0, "stamp_s": camera["stamp_s"]}
        found = find_plate(camera["rgb"])
        if found is not None:
            self.lost_s = None
            target["right_px"], target["down_px"] = found
        else:
            if self.lost_s is None:
                self.lost_s = camera["stamp_s"]
            target["mode"] = "search" if camera["stamp_s"] - self.lost_s >= SEARCH_S else "stop"
        return self.store_data_task("target", target)


def find_plate(rgb):
    """Return how far right of the middle, and how far below it, the plate is [pixels]; None if it is not there."""
    green, blue = (np.asarray(rgb, dtype=float)[..., i] for i in (1, 2))
    yellow = green - blue
    yellow = yellow - np.median(yellow)  # whatever colour the water has
    yellow[green < DARK * np.median(green)] = 0.0  # a dark thing has no blue, either
    if yellow.max() < MIN_YELLOW:
        return None
    best, best_px = None, 0
    for rows, columns in spots(yellow > max(MIN_YELLOW, SHARE * yellow.max())):
        if len(rows) >= MIN_PX and slenderness(rows, columns) < LONGEST and len(rows) > best_px:
            best, best_px = (rows, columns), len(rows)
    if best is None:
        return None
    height, width = yellow.shape
    rows, columns = best
    return sum(columns) / len(columns) - 0.5 * (width - 1), sum(rows) / len(rows) - 0.5 * (height - 1)


def slenderness(rows, columns):
    """Return how much longer than wide a spot is, whichever way it lies."""
    short, long = np.linalg.eigvalsh(np.cov(rows, columns))
    return float(np.sqrt(long / max(short, 0.1)))


def spots(mask):
    """Yields the rows and columns of the pixels of each spot: pixels that touch belong together."""
    left = {(int(row), int(column)) for row, column in np.argwhere(mask)}
    while left:
        waiting, rows, columns = [left.pop()], [], []
        while waiting:
            row, column = waiting.pop()
            rows.append(row)
            columns.append(column)
            for near in ((row + 1, column), (row - 1, column), (row, column + 1), (row, column - 1)):
                if near in left:
                    left.remove(near)
                    waiting.append(near)
        yield rows, columns


def factories(robot):
    return [Perception.factory(), SteerFactory(robot.parameters)]
