"""Process_2D: where the nearest stones are in the image of the mono camera. This is the file that you write.

Stores page "heap_2d": bearing_rad (positive to the left), stamp_s (of the image). Publishes HEAP_SEEN and HEAP_LOST.
"""

import math

import numpy as np

from snr_sim.behaviors.processes import ObserverState

LOST_S = 1.5  # without a stone in any image


def find_stones(rgb, field_of_view_rad):
    """Return the bearing of the nearest stones in an image, or None if it shows no stones.

    Args:
        rgb: numpy array of shape (36, 48, 3), 0 to 255: the top row first, its left pixel first.
        field_of_view_rad: angle between the left and the right edge of the image.
    """
    # Step 2: which pixels show stones, and which of these are the nearest?
    bearing_rad = None
    return bearing_rad


class Search(ObserverState):
    def enter(self):
        """Is called once, when the state begins."""

    def run_state(self):
        """Is called 20 times a second, while the state lasts."""
        # Step 3: is there a new image in page "mono"? Look at it, store page "heap_2d", and publish an event.
        # An ObserverState has get_data(key), store_data(key, data), publish_event(name), get_time_s() and entered_s.


class Idle(ObserverState):
    def run_state(self):
        """Does nothing."""


# Step 3: `approach` and `done` look, too.
PROCESS_2D = {"search": Search, "approach": Idle, "push": Idle, "back_up": Idle, "done": Idle}
