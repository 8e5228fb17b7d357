"""A controller for the underwater vehicle: gets the pilot's commands, sets the pulses of eight thrusters.

page "controls": is_armed, and the sticks surge, sway, heave, yaw (-1 to 1); 20 times a second
page "depth":    depth_m, positive down;  page "imu": roll_rad, pitch_rad, yaw_rad, and rates
page "pwm":      pulses_us of the eight thrusters, and is_armed
page "vehicle":  what the vehicle reports to the surface; the pilot begins when it arrives
"""

from snr_sim_robot_urov.controls import manual_status

from snr_sim import Endpoint, handles

STOP_US = 1500.0  # a thruster stands still; 1900 is full ahead, 1100 full astern


class ControllerTemplate(Endpoint):
    @handles("controls")
    def on_controls(self, controls):
        pulses_us = [STOP_US] * 8
        return self.store_data_task("pwm", {"pulses_us": pulses_us, "is_armed": controls["is_armed"]})

    @handles("imu")
    def on_imu(self, imu):
        return self.store_data_task("vehicle", manual_status(self.get_data("controls"), imu))


def factories(robot):
    return [ControllerTemplate.factory()]
