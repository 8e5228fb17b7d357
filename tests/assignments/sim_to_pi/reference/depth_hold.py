"""A solution: proportional, integral and derivative, a curve for the thruster, and three reasons to do nothing."""

from telling import vehicle_status

from snr_sim import Endpoint, handles

STOP_US = 1500.0
VERTICAL = {4: +1.0, 5: -1.0, 6: -1.0, 7: +1.0}
PERIOD_S = 0.02  # of the imu's readings

KP, KI, KD = 80.0, 20.0, 70.0  # N/m, N/(m s), N s/m
MAX_FORCE_N, MAX_INTEGRAL_N = 60.0, 15.0
SMOOTHING_S = 0.2  # of the speed, which is computed from a depth that has 3 mm of noise
SINK_MPS = 0.3  # how fast the held depth moves to the target

CONTROLS_S, DEPTH_S = 0.25, 0.3  # ages from which nothing pushes
DEAD_US, FULL_US = 30.0, 400.0
FULL_N = 50.0  # of a T200 at 16 V, ahead; astern it has a fifth less, which the integral makes up for


class DepthHold(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.is_stopped = False
        self.reset()

    def reset(self):
        """Resets the state: the next hold starts where the vehicle then is."""
        self.target_m = None
        self.held_m = None
        self.seen = None
        self.sink_mps = 0.0
        self.integral_n = 0.0

    @handles("imu")
    def on_tick(self, imu):
        controls = self.get_data("controls")
        depth = self.get_data("depth")
        pulses_us = [STOP_US] * 8
        may_push = controls is not None and depth is not None and self.may_push(controls)
        if may_push:
            if controls["depth_m"] is not None:
                self.target_m = controls["depth_m"]
            up_n = self.up_force_n(depth)
            for channel, sign in VERTICAL.items():
                pulses_us[channel] = pulse_us(sign * up_n / len(VERTICAL))
        else:
            self.reset()
        vehicle = vehicle_status(controls, self.target_m, self.is_stopped, imu)
        return [
            self.store_data_task(
                "pwm", {"pulses_us": pulses_us, "is_armed": may_push, "is_stop": self.is_stopped}, process=False
            ),
            self.store_data_task("vehicle", vehicle),
        ]

    @handles("controls")
    def on_controls(self, controls):
        """Handles every page of the pilot: a stop in one that is soon overtaken counts, too."""
        if controls["is_stop"]:
            self.is_stopped = True
        elif controls["clears_stop"] and not controls["is_armed"]:
            self.is_stopped = False

    def may_push(self, controls):
        is_fresh = self.get_age_s("controls") <= CONTROLS_S and self.get_age_s("depth") <= DEPTH_S
        return controls["is_armed"] and is_fresh and not self.is_stopped

    def up_force_n(self, depth):
        depth_m = depth["depth_m"]
        if self.held_m is None:
            self.held_m = depth_m
        if self.target_m is None:
            self.target_m = depth_m
        if self.seen is not None and depth["stamp_s"] > self.seen["stamp_s"]:
            period_s = depth["stamp_s"] - self.seen["stamp_s"]
            newest_mps = (depth_m - self.seen["depth_m"]) / period_s
            self.sink_mps += (newest_mps - self.sink_mps) * period_s / (period_s + SMOOTHING_S)
        self.seen = depth
        step_m = SINK_MPS * PERIOD_S
        move_m = min(step_m, max(-step_m, self.target_m - self.held_m))
        self.held_m += move_m
        error_m = depth_m - self.held_m
        if move_m == 0.0:  # on the way the drag of the water would be taken for weight
            self.integral_n += KI * error_m * PERIOD_S
        self.integral_n = min(MAX_INTEGRAL_N, max(-MAX_INTEGRAL_N, self.integral_n))
        up_n = KP * error_m + self.integral_n + KD * (self.sink_mps - move_m / PERIOD_S)
        return min(MAX_FORCE_N, max(-MAX_FORCE_N, up_n))


def pulse_us(thrust_n):
    """Return the pulse for a thrust: over the dead band at once, and then about as the root."""
    if abs(thrust_n) < 0.05:
        return STOP_US
    share = min(1.0, (abs(thrust_n) / FULL_N) ** 0.55)
    width_us = DEAD_US + share * (FULL_US - DEAD_US)
    return STOP_US + width_us if thrust_n > 0.0 else STOP_US - width_us


def factories(robot):
    return [DepthHold.factory()]
