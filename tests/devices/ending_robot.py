"""A robot that pushes with all it has, ends in the way that is asked for, and says what its outputs made, and when.

`python ending_robot.py HOW`: a line for each write, "NANOSECONDS HELD_UP_NANOSECONDS WORD". WORD is "pushing", "still",
or "now" when the end begins. Held up is how long its threads have stood in line for a core so far.
"""

from __future__ import annotations

import gc
import os
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

from snr_sim import Config, Mode, SynchronousRunner, TaskType
from snr_sim.devices.pwm.pwm_backend import PwmBackend
from snr_sim.devices.pwm.pwm_loop import PwmLoopFactory
from snr_sim.testing.parts import PartFactory, TickerFactory

FAST, STILL = [1900.0, 1900.0], [1500.0, 1500.0]
PUSHES = 60  # commands before it ends by itself
ARMS_AFTER = 20  # of them
HELD_UP_NS: dict[str, int] = {}  # of each thread, also of those that have ended


def held_up_ns() -> int:
    """Returns how long this program's threads have stood in line for a core; 0 where the system does not tell."""
    for thread in Path("/proc/self/task").glob("*/schedstat"):
        with suppress(OSError, IndexError):  # one that has just ended
            HELD_UP_NS[thread.parent.name] = int(thread.read_text().split()[1])
    return sum(HELD_UP_NS.values())


def say(word: str) -> None:
    os.write(1, f"{time.monotonic_ns()} {held_up_ns()} {word}\n".encode())


class SpokenPwm(PwmBackend):
    """Outputs that say what they make."""

    title = "The outputs that speak"
    fails_safe_alone = True

    def __init__(self) -> None:
        super().__init__(time.monotonic, 2)

    def put(self, pulses_us: list[float], stamp_s: float, lease_s: float, why: list[str]) -> list[float]:
        say("pushing" if pulses_us == FAST else "still")
        return pulses_us

    def on_deactivate(self, reason: str) -> None:
        say("still")


def ends(how: str) -> Any:
    """Returns a handler that ends it after some commands."""
    counted = [0]

    def on_pwm(task: Any, task_id: Any) -> None:
        counted[0] += 1
        if counted[0] < PUSHES or how == "signal":
            return
        if counted[0] == PUSHES:
            say("now")
        if how == "raise":
            raise ValueError("as a student's handler does")
        if how == "exit":
            sys.exit(3)
        while True:  # "hang"
            time.sleep(0.001)

    return on_pwm


def robot(how: str) -> None:
    """Runs a node with outputs behind it."""
    outputs: list[SpokenPwm] = []

    def opened() -> SpokenPwm:
        outputs.append(SpokenPwm())
        outputs[0].now_s = clock.now_s
        return outputs[0]

    said = [0]

    def push(loop: Any) -> None:
        said[0] += 1  # it is armed by saying so after it has said that it is not
        loop.store_data("pwm", {"pulses_us": FAST, "is_armed": said[0] > ARMS_AFTER})

    pusher = TickerFactory(push, "pusher", rate_hz=100.0)
    handler = PartFactory({(TaskType.process_data, "pwm"): ends(how)})
    config = Config(Mode.TEST, {"robot": [pusher, handler, PwmLoopFactory("pwm", opened, 50.0, timeout_s=0.2)]})
    runner = SynchronousRunner("robot", config)
    clock = runner.node.clock
    runner.run()


def alone(how: str) -> SpokenPwm | None:
    """Pushes without a node; drops its outputs, or leaves them to the end of the program."""
    out = SpokenPwm()
    out.configure()
    out.activate()
    out.write_us(FAST, time.monotonic())
    say("now")
    if how == "leave":
        return out
    if how == "cycle":  # outputs that something in them refers to, so that only the collector finds them
        out.me = out  # type: ignore[attr-defined]
    del out
    gc.collect()
    time.sleep(10.0)  # it is not the end of the program that lets go of them
    return None


if __name__ == "__main__":
    wanted = sys.argv[1]
    left = alone(wanted) if wanted in ("drop", "cycle", "leave") else robot(wanted)
