"""Says where the rover is, by its wheels and its gyroscope, and where the next point is.

page "imu":      rate_radps: [about x, about y, about z], z is up, positive to the left; stamp_s; 50 times a second
page "motor_..": turned_rad: how far that wheel has turned, ahead is positive; stamp_s; 20 times a second
page "place":    x_m, y_m, heading_rad from the start: x ahead, y to the left; off_rad and left_m of the next point
"""

import math

from pilot import Pilot

from snr_sim import Endpoint, handles

ROLLING_M = 0.1255  # how far a wheel rolls for each radian: its radius, less half of what its tyre is pressed in
STANDS_S = 2.0  # the rover stands for so long at the start
REACHED_M = 0.2
MOTORS = ["motor_LF", "motor_LM", "motor_LB", "motor_RF", "motor_RM", "motor_RB"]


def factories(robot):
    return [Where.factory(points_m=robot.parameters.points_m), Pilot.factory()]


def way_m(before_rad, now_rad):
    """Return how far the rover rolled while its six wheels turned from `before_rad` to `now_rad`: two lists of six."""
    # Step 2: the mean of all six.
    return 0.0


def moved(x_m, y_m, heading_rad, turn_rad, way_m):
    """Return x and y after a short way, in which the rover turned by `turn_rad` from `heading_rad`."""
    # Step 3: along the heading in the middle of the turn.
    return x_m, y_m


def off_rad(x_m, y_m, heading_rad, point_m):
    """Return the bearing of a point from where the rover looks: -pi to pi, positive to the left."""
    # Step 4: the direction to the point, less the heading; 350 degrees to the left are 10 to the right.
    return 0.0


class Gyro:
    """The heading, from rates of turning. While the rover stands, it measures what the gyroscope reads at rest."""

    def __init__(self):
        self.heading_rad = 0.0

    def update(self, rate_radps, stamp_s):
        """Take a rate and its time; return the heading."""
        # Step 5: first the mean while it stands, then add up what is more than that.
        return self.heading_rad


def headings(rates_radps, stamps_s):
    """Return what a new Gyro makes of a list of rates. For tests, yours and ours: needs no change."""
    gyro = Gyro()
    return [gyro.update(rate, stamp) for rate, stamp in zip(rates_radps, stamps_s, strict=True)]


class Where(Endpoint):
    points_m = ()

    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.gyro = Gyro()
        self.x_m, self.y_m = 0.0, 0.0
        self.wheels_rad = None  # how far the wheels had turned last time
        self.heading_rad = 0.0  # and where it looked
        self.next = 0  # number of the next point

    @handles("imu")
    def on_imu(self, imu):
        self.gyro.update(imu["rate_radps"][2], imu["stamp_s"])

    @handles("motor_RB")  # the last of the six
    def on_motors(self, motor):
        now_rad = [self.get_data(name)["turned_rad"] for name in MOTORS]
        # Step 6: with the way since the last time, set self.x_m and self.y_m. What is it the first time?
        self.wheels_rad, self.heading_rad = now_rad, self.gyro.heading_rad
        return self.store_data_task("place", self.place(motor["stamp_s"]))

    def place(self, stamp_s):
        """Return page "place"; needs no change."""
        place = {"x_m": self.x_m, "y_m": self.y_m, "heading_rad": self.heading_rad, "off_rad": None, "left_m": None}
        while self.next < len(self.points_m) and self.gap_m(self.points_m[self.next]) < REACHED_M:
            self.next += 1
        if stamp_s > STANDS_S and self.next < len(self.points_m):
            point_m = self.points_m[self.next]
            place["off_rad"] = off_rad(self.x_m, self.y_m, self.heading_rad, point_m)
            place["left_m"] = self.gap_m(point_m)
        return place

    def gap_m(self, point_m):
        """Return how far a point is; needs no change."""
        return math.hypot(point_m[0] - self.x_m, point_m[1] - self.y_m)
