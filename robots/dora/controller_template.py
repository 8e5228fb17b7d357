"""A controller for Dora: sets both motors after each reading of the ultrasonic sensor.

page "range":  distance_m, confidence (0: no echo), stamp_s
page "touch":  left, right, stamp_s
page "motors": a (left) and d (right), percent of full speed, -100 to 100
"""

from snr_sim import Endpoint, handles


class ControllerTemplate(Endpoint):
    near_m = 0.35  # nearer than this it turns

    @handles("range")
    def on_range(self, reading):
        if reading["distance_m"] < self.near_m:
            return self.store_data_task("motors", {"a": -25.0, "d": 25.0})
        return self.store_data_task("motors", {"a": 40.0, "d": 40.0})


def factories(robot):
    return [ControllerTemplate.factory()]
