"""The driver: moves tracks and blade in each state. Stores page "dozer": left_mps, right_mps, blade."""

from __future__ import annotations

import math

from snr_sim.behaviors.processes import ObserverState

from .parameters import DOZER, HousecatParameters

YARD = HousecatParameters()
FULL_MPS = DOZER.full_speed_mps
FRONT_M = 0.5 * DOZER.size_m[0]
MAX_LANE_M = 0.9  # farther from the middle are walls and posts
TURN_PER_S = 2.0  # how fast it turns to a heading
MAX_SLANT_RAD = 0.7  # between its heading and the lane
BEYOND_M = 0.03  # how far the blade goes beyond the edge of the pit
STUCK_S, STUCK_M = 3.0, 0.05  # so long without so much way


class Drive(ObserverState):
    """Base of the driver's states."""

    def command(self, left_mps: float, right_mps: float, blade: float = 0.0) -> None:
        """Send a command, within full speed."""
        left_mps, right_mps = (min(FULL_MPS, max(-FULL_MPS, one)) for one in (left_mps, right_mps))
        self.store_data("dozer", {"left_mps": left_mps, "right_mps": right_mps, "blade": blade})

    def exit(self) -> None:
        """Stop, until all processes have ended this state and the next begins."""
        self.command(0.0, 0.0)

    def follow_lane(self, y_m: float, speed_mps: float, blade: float = 0.0) -> None:
        """Drive along a line to the east, forward or back."""
        pose = self.get_data("pose")
        forward = math.copysign(1.0, speed_mps)
        slant = forward * math.atan(2.0 * (y_m - pose["position_m"][1]))
        slant = min(MAX_SLANT_RAD, max(-MAX_SLANT_RAD, slant))
        turn_mps = 0.5 * DOZER.track_m * TURN_PER_S * (slant - pose["heading_rad"])
        turn_mps = min(0.5 * FULL_MPS, max(-0.5 * FULL_MPS, turn_mps))
        speed_mps = forward * min(abs(speed_mps), FULL_MPS - abs(turn_mps))
        self.command(speed_mps - turn_mps, speed_mps + turn_mps, blade)

    def lane_m(self) -> float | None:
        """Return y of the stones, if they are known."""
        heap = self.get_data("heap_3d")
        return None if heap is None else min(MAX_LANE_M, max(-MAX_LANE_M, heap["y_m"]))


class Stand(Drive):
    """Stands, with the blade up."""

    def run_state(self) -> None:
        """See `ObserverState`."""
        self.command(0.0, 0.0)


class Approach(Drive):
    """Drives towards the lane of the stones that were seen in this state."""

    def run_state(self) -> None:
        """See `ObserverState`."""
        heap, lane = self.get_data("heap_3d"), self.lane_m()
        if lane is None or heap["stamp_s"] < self.entered_s - 0.5:
            self.command(0.0, 0.0)
        else:
            self.follow_lane(lane, 0.7 * FULL_MPS)


class Push(Drive):
    """Pushes to the east, until the blade is at the edge or the vehicle is stuck."""

    def enter(self) -> None:
        """See `ObserverState`."""
        self.y_m = self.lane_m() or 0.0
        self.moved_s, self.moved_x_m = self.entered_s, -math.inf

    def run_state(self) -> None:
        """See `ObserverState`."""
        x, _ = self.get_data("pose")["position_m"]
        now_s = self.get_time_s()
        if x > self.moved_x_m + STUCK_M:
            self.moved_s, self.moved_x_m = now_s, x
        if x + FRONT_M >= YARD.edge_m + BEYOND_M:
            self.publish_event("PUSHED")
        elif now_s - self.moved_s > STUCK_S:
            self.publish_event("BLOCKED")
        self.follow_lane(self.y_m, FULL_MPS, blade=1.0)


class BackUp(Drive):
    """Drives back to where a look begins, with the blade up."""

    def run_state(self) -> None:
        """See `ObserverState`."""
        x, y = self.get_data("pose")["position_m"]
        if x <= YARD.home_m:
            self.publish_event("CLEAR")
        self.follow_lane(y, -FULL_MPS)


DRIVER = {"search": Stand, "approach": Approach, "push": Push, "back_up": BackUp, "done": Stand}
