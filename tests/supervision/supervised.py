"""A program with two roles, each in a process: `python supervised.py WHAT_B_DOES [ends_all]`. Prints what happens."""

import ctypes
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any

from snr_sim import Config, Loop, LoopFactory, MultiProcRunner, Node, TimeoutLoopFactory, tasks
from snr_sim.testing.function_components import FunctionEndpointFactory


def nothing(*args: Any) -> None:
    pass


def end(part: Any) -> None:
    part.schedule(tasks.terminate("done"))


def fail(part: Any) -> None:
    raise ValueError("no echo")


def leave(part: Any) -> None:
    sys.exit(3)


def leave_at_once(part: Any) -> None:
    print("bus voltage 9.1 V", file=sys.stderr)
    os._exit(3)


def kill(part: Any) -> None:
    print("the last words", file=sys.stderr)
    os.kill(os.getpid(), signal.SIGKILL)


def doze(*args: Any) -> None:
    time.sleep(60)


def stubborn(*args: Any) -> None:
    """Holds the interpreter's lock in C, deaf to signals."""
    signal.pthread_sigmask(signal.SIG_BLOCK, signal.valid_signals())
    print("stuck")
    ctypes.PyDLL(None).sleep(60)


def print_lines(part: Any) -> None:
    print("one line")
    os.write(1, b"another one\n")
    print("a complaint", file=sys.stderr)
    end(part)


def leave_child(part: Any) -> None:
    subprocess.Popen([sys.executable, "-c", "import time; time.sleep(40)"])
    end(part)


def begun(part: Any) -> None:
    print(f"begun {os.getpid()}")


def halted(part: Any) -> None:
    print("halted")


class Heavy(Loop):
    executor = "process"

    def setup(self) -> None:
        begun(self)

    def loop(self) -> None:
        pass

    def halt(self) -> None:
        halted(self)


class HeavyFactory(LoopFactory):
    def get(self, parent: Node) -> Loop:
        return Heavy(self, parent, "heavy", 10)


KINDS: dict[str, Callable[..., Any]] = {
    function.__name__: function
    for function in (nothing, end, fail, leave, leave_at_once, kill, doze, stubborn, print_lines, leave_child)
}


def role(part: FunctionEndpointFactory) -> list[Any]:
    motor = FunctionEndpointFactory(name="motor", begin=begun, halt=halted)
    return [motor, TimeoutLoopFactory(seconds=60), part]


def main(kind: str, *options: str) -> None:
    roles = {"a": role(FunctionEndpointFactory()), "b": role(FunctionEndpointFactory(name="b_part", begin=KINDS[kind]))}
    if "heavy" in options:
        roles["a"].append(HeavyFactory())
    try:
        MultiProcRunner(Config(factories=roles), ends_all=["b"] if "ends_all" in options else []).run()
    finally:
        print("over", flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
