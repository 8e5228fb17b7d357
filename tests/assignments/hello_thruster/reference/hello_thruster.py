"""A solution."""

from wiring import wired

from snr_sim import Endpoint, TaskType

STOP_US = 1500.0
FULL_US = 400.0
REST = 0.05

HEAVE = [0, 0, 0, 0, +1, -1, -1, +1]
SURGE = [+1, +1, -1, -1, 0, 0, 0, 0]


def counted(value):
    """Returns how far a stick counts: nothing at rest, and never more than 1."""
    if abs(value) < REST:
        return 0.0
    return max(-1.0, min(1.0, value))


def pulses_us(heave, surge):
    """Returns the list of eight pulses for two sticks."""
    pulses = []
    for channel in range(8):
        share = HEAVE[channel] * counted(heave) + SURGE[channel] * counted(surge)
        pulses.append(STOP_US + FULL_US * share)
    return pulses


class HelloThruster(Endpoint):
    def on_controls(self, task, task_id):
        controls = self.get_data("controls")
        pulses = [STOP_US] * 8
        if controls["is_armed"]:
            pulses = pulses_us(controls["heave"], controls["surge"])
        return self.store_data_task("pwm", {"pulses_us": pulses, "is_armed": controls["is_armed"]})

    task_handlers = {(TaskType.process_data, "controls"): on_controls}


def factories(robot):
    return wired(HelloThruster)
