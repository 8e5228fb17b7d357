"""A robot that commands full thrust, ends in the requested way, and prints its applied pulses with their times.

`python ending_robot.py HOW`: a line for each write, "NANOSECONDS HELD_UP_NANOSECONDS WORD". WORD is "pushing", "still",
or "now" when the end begins. Held up is how long its threads have waited for a core so far.
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
from snr_sim.testing.function_components import FunctionEndpointFactory, FunctionLoopFactory

FAST, STILL = [1900.0, 1900.0], [1500.0, 1500.0]
PUSHES = 60  # commands before it ends
ARMS_AFTER = 20  # commands; `is_armed` is false in these
HELD_UP_NS: dict[str, int] = {}  # of each thread, also of those that have ended


def held_up_ns() -> int:
    """Return how long this program's threads have waited for a core; 0 where the system does not report it."""
    for thread in Path("/proc/self/task").glob("*/schedstat"):
        with suppress(OSError, IndexError):  # a thread that has just ended
            HELD_UP_NS[thread.parent.name] = int(thread.read_text().split()[1])
    return sum(HELD_UP_NS.values())


def print_word(word: str) -> None:
    os.write(1, f"{time.monotonic_ns()} {held_up_ns()} {word}\n".encode())


class PrintingPwm(PwmBackend):
    """Outputs that print the applied pulses."""

    title = "The outputs that speak"
    has_independent_failsafe = True

    def __init__(self) -> None:
        super().__init__(time.monotonic, 2)

    def put(self, pulses_us: list[float], stamp_s: float, lease_s: float, reasons: list[str]) -> list[float]:
        print_word("pushing" if pulses_us == FAST else "still")
        return pulses_us

    def on_deactivate(self, reason: str) -> None:
        print_word("still")


def ends(how: str) -> Any:
    """Return a handler that ends the robot after some commands."""
    counted = [0]

    def on_pwm(task: Any, task_id: Any) -> None:
        counted[0] += 1
        if counted[0] < PUSHES or how == "signal":
            return
        if counted[0] == PUSHES:
            print_word("now")
        if how == "raise":
            raise ValueError("as a student's handler does")
        if how == "exit":
            sys.exit(3)
        while True:  # "hang"
            time.sleep(0.001)

    return on_pwm


def robot(how: str) -> None:
    """Run a node with outputs."""
    outputs: list[PrintingPwm] = []

    def opened() -> PrintingPwm:
        outputs.append(PrintingPwm())
        outputs[0].now_s = clock.now_s
        return outputs[0]

    command_count = [0]

    def push(loop: Any) -> None:
        command_count[0] += 1  # it arms by true after false
        loop.store_data("pwm", {"pulses_us": FAST, "is_armed": command_count[0] > ARMS_AFTER})

    pusher = FunctionLoopFactory(push, "pusher", rate_hz=100.0)
    handler = FunctionEndpointFactory({(TaskType.process_data, "pwm"): ends(how)})
    config = Config(Mode.TEST, {"robot": [pusher, handler, PwmLoopFactory("pwm", opened, 50.0, timeout_s=0.2)]})
    runner = SynchronousRunner("robot", config)
    clock = runner.node.clock
    runner.run()


def alone(how: str) -> PrintingPwm | None:
    """Command thrust without a node; drop the outputs, or leave them to the end of the program."""
    out = PrintingPwm()
    out.configure()
    out.activate()
    out.write_us(FAST, time.monotonic())
    print_word("now")
    if how == "leave":
        return out
    if how == "cycle":  # a reference cycle, which only the garbage collector finds
        out.me = out  # type: ignore[attr-defined]
    del out
    gc.collect()
    time.sleep(10.0)  # the outputs must be released before the end of the program
    return None


if __name__ == "__main__":
    ending = sys.argv[1]
    left = alone(ending) if ending in ("drop", "cycle", "leave") else robot(ending)
