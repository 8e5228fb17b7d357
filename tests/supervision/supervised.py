"""A program with two roles, each in a process: `python supervised.py WHAT_B_DOES [ends_all]`. Prints what happens.

With `supervised RESTARTS HANG_S FOLDER` at the end, roles are started again.
"""

import ctypes
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any

from snr_sim import (
    Config,
    Loop,
    LoopFactory,
    MultiProcRunner,
    Node,
    SocketsPair,
    Task,
    TaskType,
    TimeoutLoopFactory,
    tasks,
)
from snr_sim.supervision import Child, Intensity, SupervisedRunner, Supervisor, Timeouts
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


def send_pid(part: Any) -> None:
    part.store_data("pid", os.getpid())


def print_received(task: Task, task_id: Any) -> None:
    print(f"received {task.page.data}")


def hang_later(part: Any) -> None:
    part.schedule(tasks.event("hang"))


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
    for function in (
        nothing,
        end,
        fail,
        leave,
        leave_at_once,
        kill,
        doze,
        stubborn,
        hang_later,
        send_pid,
        print_lines,
        leave_child,
    )
}


def role(part: FunctionEndpointFactory) -> list[Any]:
    motor = FunctionEndpointFactory(name="motor", begin=begun, halt=halted)
    return [motor, TimeoutLoopFactory(seconds=60), part]


def supervised(config: Config, restarts: str, hang_s: str, folder: str) -> SupervisedRunner:
    timeouts = Timeouts(setup_s=60.0, hang_s=float(hang_s), end_s=1.0)
    children = [Child(name, "on_failure", timeouts) for name in ("a", "b")]
    intensity = Intensity(int(restarts), within_s=600.0)  # a start takes seconds on a busy computer
    return SupervisedRunner(config, Supervisor("root", children, intensity=intensity), folder=folder)


def main(kind: str, *options: str) -> None:
    handlers = {(TaskType.event, "hang"): doze} if kind == "hang_later" else {}
    b_part = FunctionEndpointFactory(handlers, "b_part", begin=KINDS[kind])
    roles = {"a": role(FunctionEndpointFactory()), "b": role(b_part)}
    if "linked" in options:
        pair = SocketsPair(("127.0.0.1", 0), name="wire")
        listener = FunctionEndpointFactory({(TaskType.process_data, "pid"): print_received}, "listener")
        roles["a"] += [listener, pair.client()]
        roles["b"].append(pair.server("pid"))
    if "heavy" in options:
        roles["a"].append(HeavyFactory())
    config = Config(factories=roles)
    try:
        if "supervised" in options:
            supervised(config, *options[-3:]).run()
        else:
            MultiProcRunner(config, ends_all=["b"] if "ends_all" in options else []).run()
    finally:
        print("over", flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
