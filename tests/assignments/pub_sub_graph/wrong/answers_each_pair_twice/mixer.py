"""Answers a pair of "turn" and "lift" as often as it finds it complete, which may be twice."""

from laws import STOP_US, pulses_us

from snr_sim import Endpoint, EndpointFactory, TaskType


def factories(robot):
    return [MixerFactory()]


class MixerFactory(EndpointFactory):
    def get(self, parent):
        return Mixer(self, parent, "mixer")


class Mixer(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.task_handlers = {
            (TaskType.process_data, "turn"): self.on_any,
            (TaskType.process_data, "lift"): self.on_any,
        }

    def on_any(self, task, task_id):
        turn, lift = self.get_data("turn"), self.get_data("lift")
        if turn is None or lift is None or turn["stamp_s"] != lift["stamp_s"]:
            return None
        controls = self.get_data("controls")
        is_armed = controls is not None and controls["is_armed"]
        pulses = pulses_us(turn["moment_nm"], lift["force_n"]) if is_armed else [STOP_US] * 8
        return self.store_data_task("pwm", {"pulses_us": pulses, "is_armed": is_armed}, process=False)
