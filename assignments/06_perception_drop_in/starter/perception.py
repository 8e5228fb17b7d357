"""Finds the plate in the camera's picture. This is the file that you write.

page "camera" --> where in the picture the plate is --> page "target" --> steer.py
"""

import numpy as np
from steer import SteerFactory

from snr_sim import Endpoint, TaskType


class Perception(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.task_handlers = {(TaskType.store_page, "camera"): self.on_picture}

    def on_picture(self, task, task_id):
        camera = self.get_data("camera")
        found = find_plate(camera["rgb"])
        # Step 4: what if it has not been found? Stop at once; search if that lasts for longer than a second.
        target = {"mode": "stop", "right_px": 0.0, "down_px": 0.0, "stamp_s": camera["stamp_s"]}
        if found is not None:
            right_px, down_px = found
            target = {"mode": "track", "right_px": right_px, "down_px": down_px, "stamp_s": camera["stamp_s"]}
        return self.store_data_task("target", target)


def find_plate(rgb):
    """Return how far right of the middle, and how far below it, the plate is [pixels]; None if it is not there.

    Args:
        rgb: numpy array of shape (48, 64, 3), 0 to 255: the top row first, its left pixel first.
    """
    rows, columns = np.nonzero(rgb[..., 0] > 150)  # yellow is red and green: but is it, down there?
    if len(rows) == 0:
        return None
    # Step 3: which of these belong together? And this is counted from the top left corner, not from the middle.
    return float(columns.mean()), float(rows.mean())


def factories(robot):
    return [Perception.factory(), SteerFactory(robot.parameters)]
