"""What all attacks in flight stand on: a pilot that falls, and does something else at each reading of the radar."""

from snr_sim import Endpoint, EndpointFactory, TaskType


class FallingFactory(EndpointFactory):
    def __init__(self, act):
        super().__init__()
        self.act = act

    def get(self, parent):
        return Falling(self, parent, "falling")


class Falling(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.act = factory.act
        self.times = 0
        self.task_handlers = {(TaskType.process_data, "radar"): self.on_radar}

    def on_radar(self, task, task_id):
        self.times += 1
        return self.act(self)


def falling(act):
    return [FallingFactory(act)]
