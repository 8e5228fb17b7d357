"""Makes pulses out of what others want: one page "pwm" for each pair of "turn" and "lift" of one moment.

page "turn" --.
page "lift" --+--> both have the same stamp: page "pwm"
page "controls": may anything push?
"""

from laws import STOP_US, pulses_us

from snr_sim import Endpoint, handles


class Mixer(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.turn = None
        self.lift = None

    @handles("turn")
    def on_turn(self, turn):
        self.turn = turn
        return self.mixed()

    @handles("lift")
    def on_lift(self, lift):
        self.lift = lift
        return self.mixed()

    def mixed(self):
        if self.turn is None or self.lift is None or self.turn["stamp_s"] != self.lift["stamp_s"]:
            return None
        controls = self.get_data("controls")
        is_armed = controls is not None and controls["is_armed"]
        pulses = pulses_us(self.turn["moment_nm"], self.lift["force_n"]) if is_armed else [STOP_US] * 8
        return self.store_data_task("pwm", {"pulses_us": pulses, "is_armed": is_armed}, process=False)


def factories(robot):
    return [Mixer.factory()]
