"""Holds the depth that the pilot asks for: in simulation, on the emulated board and on the vehicle, without a change.

page "depth" ----.
page "controls" --+--> page "imu" comes, 50 times a second --> page "pwm": a pulse for each of eight thrusters
"""

from telling import vehicle_status

from snr_sim import Endpoint, handles

STOP_US = 1500.0
# The four thrusters that push up and down: channel, and +1 if a pulse above 1500 pushes the vehicle up.
VERTICAL = {4: +1.0, 5: -1.0, 6: -1.0, 7: +1.0}


class DepthHold(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.target_m = None
        self.is_stopped = False

    @handles("imu")
    def on_tick(self, imu):
        controls = self.get_data("controls")
        depth = self.get_data("depth")
        pulses_us = [STOP_US] * 8
        is_armed = False
        if controls is not None and depth is not None and self.may_push(controls):
            is_armed = True
            if controls["depth_m"] is not None:  # the pilot sends it once
                self.target_m = controls["depth_m"]
            if self.target_m is not None:
                up_n = self.up_force_n(depth["depth_m"])
                for channel, sign in VERTICAL.items():
                    pulses_us[channel] = pulse_us(sign * up_n / len(VERTICAL))
        vehicle = vehicle_status(controls, self.target_m, self.is_stopped, imu)
        return [
            # Outputs that are not armed stay at neutral, whatever the pulses say.
            self.store_data_task("pwm", {"pulses_us": pulses_us, "is_armed": is_armed}, process=False),
            self.store_data_task("vehicle", vehicle),
        ]

    def may_push(self, controls):
        """Return whether the thrusters may push now."""
        # Step 2: not if the controls, or the depth, are too old (self.get_age_s("controls")). Not after a stop.
        return controls["is_armed"]

    def up_force_n(self, depth_m):
        """Return the force that should push the vehicle up [N]."""
        # Step 2: this is a proportional controller. What does it lack?
        return 10.0 * (depth_m - self.target_m)


def pulse_us(thrust_n):
    """Return the pulse that makes a thruster push so hard; negative is astern."""
    # Step 2: nothing turns within 30 us of 1500, and from there on thrust does not grow in a straight line.
    return STOP_US + 5.0 * thrust_n


def factories(robot):
    return [DepthHold.factory()]
