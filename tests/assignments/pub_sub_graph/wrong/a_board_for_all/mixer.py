"""Makes pulses out of what others want: one page "pwm" for each pair of "turn" and "lift" of one moment.

page "turn" --.
page "lift" --+--> both have the same stamp: page "pwm"
page "controls": may anything push?
"""

from laws import STOP_US, pulses_us
from shared import BOARD

from snr_sim import Endpoint, EndpointFactory, TaskType


def factories(robot):
    return [MixerFactory()]


class MixerFactory(EndpointFactory):
    def get(self, parent):
        return Mixer(self, parent, "mixer")


class Mixer(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.turn = None
        self.lift = None
        self.task_handlers = {
            (TaskType.process_data, "turn"): self.on_turn,
            (TaskType.process_data, "lift"): self.on_lift,
        }

    def on_turn(self, task, task_id):
        self.turn = BOARD
        return self.mixed()

    def on_lift(self, task, task_id):
        self.lift = self.get_data("lift")
        return self.mixed()

    def mixed(self):
        if self.turn is None or self.lift is None or self.turn["stamp_s"] != self.lift["stamp_s"]:
            return None
        controls = self.get_data("controls")
        is_armed = controls is not None and controls["is_armed"]
        pulses = pulses_us(self.turn["moment_nm"], self.lift["force_n"]) if is_armed else [STOP_US] * 8
        return self.store_data_task("pwm", {"pulses_us": pulses, "is_armed": is_armed}, process=False)
