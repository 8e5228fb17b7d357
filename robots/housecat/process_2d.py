"""Process_2D: where in the picture the nearest stones are. Stores page "heap_2d": bearing_rad, stamp_s."""

from __future__ import annotations

from snr_sim.behaviors.processes import ObserverState

from .vision import nearest_bearing_rad

LOST_S = 2.0  # without a stone in any picture


class Look(ObserverState):
    """Looks for stones in each new picture."""

    stamp_s = -1.0

    def look(self) -> float | None:
        """Return the bearing of the nearest stones in the newest picture; None if it shows none, or is an old one."""
        mono = self.get_data("mono")
        if mono is None or mono["stamp_s"] <= max(self.stamp_s, self.entered_s):
            return None
        self.stamp_s = mono["stamp_s"]
        bearing = nearest_bearing_rad(mono["rgb"], mono["field_of_view_rad"])
        if bearing is not None:
            self.store_data("heap_2d", {"bearing_rad": bearing, "stamp_s": self.stamp_s}, process=False)
        return bearing


class Search(Look):
    """Reports the first stones, or that there are none."""

    def run_state(self) -> None:
        """See `ObserverState`."""
        if self.look() is not None:
            self.publish_event("HEAP_SEEN")
        elif self.get_time_s() - self.entered_s > LOST_S:
            self.publish_event("HEAP_LOST")


class Approach(Look):
    """Follows the stones, and reports if they are out of sight."""

    def enter(self) -> None:
        """See `ObserverState`."""
        self.seen_s = self.entered_s

    def run_state(self) -> None:
        """See `ObserverState`."""
        if self.look() is not None:
            self.seen_s = self.get_time_s()
        elif self.get_time_s() - self.seen_s > LOST_S:
            self.publish_event("HEAP_LOST")


class Done(Look):
    """Reports stones that show up later."""

    def run_state(self) -> None:
        """See `ObserverState`."""
        if self.look() is not None:
            self.publish_event("HEAP_SEEN")


class Idle(ObserverState):
    """Looks at nothing: the blade hides what it pushes."""

    def run_state(self) -> None:
        """See `ObserverState`."""


PROCESS_2D = {"search": Search, "approach": Approach, "push": Idle, "back_up": Idle, "done": Done}
