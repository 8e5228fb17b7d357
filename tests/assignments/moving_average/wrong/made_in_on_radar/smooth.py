"""Makes its filters anew for each reading, so they remember nothing."""

from pilot import PilotFactory

from snr_sim import Endpoint, EndpointFactory, TaskType

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


class SmootherFactory(EndpointFactory):
    def get(self, parent):
        return Smoother(self, parent, "smoother")


class Smoother(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.task_handlers = {(TaskType.process_data, "radar"): self.on_radar}

    def on_radar(self, task, task_id):
        radar = self.get_data("radar")
        altitude_m = MovingAverage(LENGTH).update(radar["altitude_m"])
        velocity_mps = MovingAverage(LENGTH).update(radar["velocity_mps"])
        return self.store_data_task("smooth", {"altitude_m": altitude_m, "velocity_mps": velocity_mps})


def factories(robot):
    return [SmootherFactory(), PilotFactory()]


def smoothed(values, length):
    average = MovingAverage(length)
    return [average.update(value) for value in values]
