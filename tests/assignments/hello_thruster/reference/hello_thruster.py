"""A solution."""

from wiring import wired

from snr_sim import Endpoint, handles

STOP_US = 1500.0
FULL_US = 400.0
REST = 0.05

HEAVE = [0, 0, 0, 0, +1, -1, -1, +1]
SURGE = [+1, +1, -1, -1, 0, 0, 0, 0]


def counted(value):
    """Return how far a stick counts: nothing at rest, and never more than 1."""
    if abs(value) < REST:
        return 0.0
    return max(-1.0, min(1.0, value))


def pulses_us(heave, surge):
    """Return the list of eight pulses for two sticks."""
    pulses = []
    for channel in range(8):
        share = HEAVE[channel] * counted(heave) + SURGE[channel] * counted(surge)
        pulses.append(STOP_US + FULL_US * share)
    return pulses


class HelloThruster(Endpoint):
    @handles("controls")
    def on_controls(self, controls):
        pulses = [STOP_US] * 8
        if controls["is_armed"]:
            pulses = pulses_us(controls["heave"], controls["surge"])
        return self.store_data_task("pwm", {"pulses_us": pulses, "is_armed": controls["is_armed"]})


def factories(robot):
    return wired(HelloThruster)
