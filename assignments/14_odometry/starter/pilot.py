"""Drives to the point that page "place" names, and brakes when there is none. Do not change this file.

page "place": off_rad, the bearing of the next point from where the rover looks, positive to the left, and left_m, how
far it is; both None when there is none.
"""

from snr_sim import Endpoint, handles

AHEAD_MPS = 0.5
SPIN_FROM_RAD, SPIN_TO_RAD = 0.3, 0.06  # further off than this it turns on the spot
SPIN_RADPS = 0.5
ROLLING_M, HALF_TRACK_M = 0.1255, 0.38
# Six wheels slide sideways in a turn, so that it turns as if its wheels were 2.5 times as far apart.
EFFECTIVE = 2.5


class Pilot(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.spins = False

    @handles("place")
    def on_place(self, place):
        off_rad = place["off_rad"]
        if off_rad is None:
            return self.store_data_task("drive", {"mode": "brake", "values": [6.0] * 6})
        self.spins = abs(off_rad) > (SPIN_TO_RAD if self.spins else SPIN_FROM_RAD)
        speed_mps, turn_radps = AHEAD_MPS, min(0.2, max(-0.2, off_rad))
        if self.spins:
            speed_mps, turn_radps = 0.0, SPIN_RADPS if off_rad > 0.0 else -SPIN_RADPS
            if abs(off_rad) < SPIN_FROM_RAD:
                turn_radps *= 0.5
        sideways_mps = EFFECTIVE * HALF_TRACK_M * turn_radps
        left, right = (speed_mps - sideways_mps) / ROLLING_M, (speed_mps + sideways_mps) / ROLLING_M
        return self.store_data_task("drive", {"mode": "speed", "values": [left] * 3 + [right] * 3})
