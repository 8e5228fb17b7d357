"""A solution."""

from pilot import Pilot

from snr_sim import Endpoint, handles

LENGTH = 60


class MovingAverage:
    def __init__(self, length):
        self.length = length
        self.window = []

    def update(self, value):
        self.window.append(value)
        if len(self.window) > self.length:
            self.window.pop(0)
        return sum(self.window) / len(self.window)


class Smoother(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.altitude = MovingAverage(LENGTH)
        self.velocity = MovingAverage(LENGTH)

    @handles("radar")
    def on_radar(self, radar):
        altitude_m = self.altitude.update(radar["altitude_m"])
        velocity_mps = self.velocity.update(radar["velocity_mps"])
        return self.store_data_task("smooth", {"altitude_m": altitude_m, "velocity_mps": velocity_mps})


def factories(robot):
    return [Smoother.factory(), Pilot.factory()]


def smoothed(values, length):
    average = MovingAverage(length)
    return [average.update(value) for value in values]
