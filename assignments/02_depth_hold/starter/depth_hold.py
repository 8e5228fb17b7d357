"""Holds the depth that the pilot asks for.

page "depth":    depth_m, in metres, positive down; a new one 20 times a second
page "controls": is_armed, and depth_m: the goal in the page in which the pilot sends it, and None in all others
page "pwm":      pulses_us: eight pulses, and is_armed
"""

from telling import vehicle_status
from thruster import NEWTONS_PER_KGF, STOP_US, pulse_us

from snr_sim import Endpoint, handles

KP_NPM = 5.0  # force for each metre of error [N/m]: yours to choose
MAX_FORCE_N = 80.0  # of all four thrusters together, up or down

# The four thrusters that push up and down: channel, and +1 if running ahead pushes the vehicle up.
VERTICAL = {4: +1, 5: -1, 6: -1, 7: +1}


def factories(robot):
    return [DepthHold.factory()]


class DepthHold(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.goal_m = None

    @handles("imu")
    def on_tick(self, imu):
        """Comes 50 times a second."""
        controls = self.get_data("controls")
        depth = self.get_data("depth")
        is_armed = controls is not None and controls["is_armed"]
        pulses = [STOP_US] * 8
        if controls is not None:
            # Step 2: the pilot sends a goal once. This drops it at the next page.
            self.goal_m = controls["depth_m"]
        if is_armed and depth is not None and self.goal_m is not None:
            pulses = pulses_us(up_force_n(depth["depth_m"], self.goal_m))
        vehicle = vehicle_status(controls, self.goal_m, False, imu)
        return [
            self.store_data_task("pwm", {"pulses_us": pulses, "is_armed": is_armed}, process=False),
            self.store_data_task("vehicle", vehicle),
        ]


def up_force_n(depth_m, goal_m):
    """Return the force that should push the vehicle up [N]; negative pushes it down. At most MAX_FORCE_N."""
    # Step 2: proportional to the error.
    return 0.0


def pulses_us(up_n):
    """Return the list of eight pulses that give this force together; the four that do not push up stand still."""
    # Step 2: share it among the four, and mind the maker's unit and which way each one is mounted.
    pulses = [STOP_US] * 8
    return pulses
