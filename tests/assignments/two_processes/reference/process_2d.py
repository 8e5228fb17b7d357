"""Process_2D: where the nearest stones are in the image of the mono camera.

Stores page "heap_2d": bearing_rad (positive to the left), stamp_s (of the image). Publishes HEAP_SEEN and HEAP_LOST.
"""

import math

import numpy as np

from snr_sim.behaviors.processes import ObserverState

LOST_S = 1.5  # without a stone in any image
RED_PER_BLUE = 2.25  # stones have 2.5, posts 2.0
MIN_RED = 40  # darker pixels have no color to speak of
MIN_PIXELS = 2
NEAR_ROWS = 2  # the lowest rows with stones show the nearest


def find_stones(rgb, field_of_view_rad):
    """Return the bearing of the nearest stones in an image, or None if it shows no stones."""
    red, blue = rgb[..., 0].astype(float), rgb[..., 2].astype(float)
    rows, columns = np.nonzero((red > RED_PER_BLUE * blue) & (red > MIN_RED))
    if len(rows) < MIN_PIXELS:
        return None
    near = np.sort(columns[rows > rows.max() - NEAR_ROWS])
    column, width = near[len(near) // 2], rgb.shape[1]  # one that shows a stone: a mean may lie between two
    tangent = math.tan(0.5 * field_of_view_rad)
    return float(-math.atan(tangent * (column - 0.5 * (width - 1)) / (0.5 * width)))


class Look(ObserverState):
    """Base of the states that look."""

    def enter(self):
        """No image of this state was looked at, and its time begins."""
        self.stamp_s = self.entered_s
        self.seen_s = self.entered_s

    def look(self):
        """Return whether a new image shows stones, and store where."""
        mono = self.get_data("mono")
        if mono is None or mono["stamp_s"] <= self.stamp_s:
            return False
        self.stamp_s = mono["stamp_s"]
        bearing_rad = find_stones(mono["rgb"], mono["field_of_view_rad"])
        if bearing_rad is None:
            return False
        self.seen_s = self.get_time_s()
        self.store_data("heap_2d", {"bearing_rad": bearing_rad, "stamp_s": self.stamp_s}, process=False)
        return True

    def is_lost(self):
        """Return whether no image has shown stones for some time."""
        return self.get_time_s() - self.seen_s > LOST_S


class Search(Look):
    """Looks for the first stones."""

    def run_state(self):
        """One look."""
        if self.look():
            self.publish_event("HEAP_SEEN")
        elif self.is_lost():
            self.publish_event("HEAP_LOST")


class Approach(Look):
    """Follows the stones while the vehicle drives to them."""

    def run_state(self):
        """One look."""
        self.look()
        if self.is_lost():
            self.publish_event("HEAP_LOST")


class Done(Look):
    """Looks whether there are stones after all."""

    def run_state(self):
        """One look."""
        if self.look():
            self.publish_event("HEAP_SEEN")


class Idle(ObserverState):
    """Looks at nothing: the blade hides what it pushes."""

    def run_state(self):
        """Nothing."""


PROCESS_2D = {"search": Search, "approach": Approach, "push": Idle, "back_up": Idle, "done": Done}
