"""A student's node with a fake depth sensor and outputs that read back commands: the same on every computer.

    python student.py TRACE     runs 20 s in lock step, writes TRACE and prints how its records hash

Physics is left out on purpose: MuJoCo rounds differently on x86-64 and aarch64. Plus, minus, times and divided by do
not, so what the handlers do is the same to the last bit, and so is the trace but for the lines that say where it ran.
"""

from __future__ import annotations

import hashlib
import sys
from pathlib import Path

from snr_sim import Config, Endpoint, EndpointFactory, Mode, SimClock, TaskType
from snr_sim.devices.pwm.pwm_backend import LoopbackPwm
from snr_sim.devices.pwm.pwm_loop import PwmLoopFactory
from snr_sim.devices.readings import SensorLoopFactory
from snr_sim.prelude.signals import DepthReading
from snr_sim.scenario.program import record_program
from snr_sim.testing.fakes import FakeSensor

UNTIL_S, RATE_HZ = 20.0, 50.0


class HoldFactory(EndpointFactory):
    def get(self, parent):
        return Hold(self, parent, "hold")


class Hold(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.error_sum = 0.0
        self.task_handlers = {(TaskType.process_data, "depth"): self.on_depth}

    def on_depth(self, task, task_id):
        error_m = 3.0 - self.get_data("depth")["depth_m"]
        self.error_sum += error_m / RATE_HZ
        push_us = 160.0 * error_m + 40.0 * self.error_sum
        pulses_us = [1500.0 - push_us, 1500.0 + push_us]
        return self.store_data_task("pwm", {"pulses_us": pulses_us, "is_armed": self.get_time_s() > 1.0})


def dive():
    """Returns the readings of a dive: nearer to 3 m by a fortieth each time."""
    depth_m, readings = 1.0, []
    for i in range(round(UNTIL_S * RATE_HZ) + 1):
        depth_m += (3.0 - depth_m) / 40.0
        readings.append(DepthReading(depth_m, 101325.0 + 9806.65 * depth_m, 19.81, i / RATE_HZ))
    return readings


clock = SimClock()
config = Config(
    Mode.TEST,
    {
        "sub": [
            SensorLoopFactory("depth", lambda: FakeSensor(dive()), RATE_HZ),
            HoldFactory(),
            PwmLoopFactory("pwm", lambda: LoopbackPwm(clock.now_s, 2), RATE_HZ),
        ]
    },
)


def digest_of(trace: Path) -> str:
    """Returns the sha256 of all records: all lines but the opening and the header, which say where and with what."""
    return hashlib.sha256(b"".join(trace.read_bytes().splitlines(keepends=True)[2:])).hexdigest()


if __name__ == "__main__":
    folder = record_program("sub", config, __file__, sys.argv[1], clock=clock, until_s=UNTIL_S)
    print(digest_of(folder / "trace.jsonl"))
