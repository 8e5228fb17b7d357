"""Turns the pilot's two sticks into pulses for eight thrusters.

page "controls": is_armed (True or False), heave and surge (-1.0 to 1.0, 0.0 is a stick at rest)
page "pwm":      is_armed, and pulses_us: eight pulses in microseconds, 1500 stops a thruster
"""

from wiring import wired

from snr_sim import Endpoint, handles

STOP_US = 1500.0  # a thruster stands still
FULL_US = 400.0  # 1500 + 400 is full ahead, 1500 - 400 is full astern
REST = 0.05  # a stick that is nearer to 0 than this is at rest

# What each thruster does for a stick: +1 runs ahead, -1 runs astern, 0 is not for this stick.
HEAVE = [0, 0, 0, 0, +1, -1, -1, +1]
SURGE = [+1, +1, -1, -1, 0, 0, 0, 0]


def counted(stick):
    """Return how far a stick counts: 0.0 at rest, and never beyond -1.0 or 1.0."""
    # Step 4: so far every movement of the hand counts, as it is.
    return stick


def pulses_us(heave, surge):
    """Return the list of eight pulses for two sticks."""
    # Step 3: so far, whatever the sticks say, all eight thrusters stand still.
    pulses = []
    for channel in range(8):
        pulses.append(STOP_US)
    return pulses


class HelloThruster(Endpoint):
    @handles("controls")
    def on_controls(self, controls):
        pulses = pulses_us(controls["heave"], controls["surge"])
        # Step 5: what if the pilot has not armed the vehicle?
        return self.store_data_task("pwm", {"pulses_us": pulses, "is_armed": controls["is_armed"]})


def factories(robot):
    return wired(HelloThruster)


if __name__ == "__main__":  # to try pulses_us without a vehicle: python3 hello_thruster.py
    print("at rest:   ", pulses_us(0.0, 0.0))
    print("half down: ", pulses_us(-0.5, 0.0))
    print("full ahead:", pulses_us(0.0, 1.0))
    print("too far:   ", pulses_us(1.2, 0.0))
