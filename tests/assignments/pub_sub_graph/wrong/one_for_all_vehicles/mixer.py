"""Makes pulses out of what others want: one page "pwm" for each pair of "turn" and "lift" of one moment.

page "turn" --.
page "lift" --+--> both have the same stamp: page "pwm"
page "controls": may anything push?
"""

from laws import STOP_US, pulses_us

from snr_sim import Endpoint, EndpointFactory, TaskType

WAITING = {}


def factories(robot):
    return [MixerFactory()]


class MixerFactory(EndpointFactory):
    def get(self, parent):
        return Mixer(self, parent, "mixer")


class Mixer(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.task_handlers = {
            (TaskType.process_data, "turn"): self.on_turn,
            (TaskType.process_data, "lift"): self.on_lift,
        }

    def on_turn(self, task, task_id):
        WAITING["turn"] = self.get_data("turn")
        return self.mixed()

    def on_lift(self, task, task_id):
        WAITING["lift"] = self.get_data("lift")
        return self.mixed()

    def mixed(self):
        turn, lift = WAITING.get("turn"), WAITING.get("lift")
        if turn is None or lift is None or turn["stamp_s"] != lift["stamp_s"]:
            return None
        controls = self.get_data("controls")
        is_armed = controls is not None and controls["is_armed"]
        pulses = pulses_us(turn["moment_nm"], lift["force_n"]) if is_armed else [STOP_US] * 8
        return self.store_data_task("pwm", {"pulses_us": pulses, "is_armed": is_armed}, process=False)
