"""Walks through the library: which functions a piece of data passes, in order. Makes docs/tour.md.

python tests/tour.py --write     writes the page; tests/test_tour.py fails if the page is another one
"""

from __future__ import annotations

import inspect
import shutil
import sys
import tempfile
from collections.abc import Callable, Mapping
from contextlib import chdir, redirect_stderr, redirect_stdout, suppress
from functools import cache
from io import StringIO
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import snr_sim
from snr_sim import Config, Endpoint, EndpointFactory, Node, SimClock, TaskType, tasks
from snr_sim.cli.check import check
from snr_sim.core.node_life import NodeLife
from snr_sim.grading.grade import _Grading
from snr_sim.grading.lab.lab import find_lab
from snr_sim.links.simulated import SimulatedPeer
from snr_sim.prelude.values import no_garbage_collection
from snr_sim.recording.trace import TraceWriter
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import SimulationRun

ROOT = Path(snr_sim.__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "tour.md"
ROOMS = tuple(f"{ROOT / name}/" for name in ("snr_sim", "robots", "assignments"))
LAB, REFERENCE = ROOT / "assignments/01_hello_thruster", ROOT / "tests/assignments/hello_thruster/reference"
HEAD = """# A tour of the library

Four walks through the code. Three follow one piece of data; read the functions in this order: each row is a function
that the data pass, listed where it is entered for the first time, with the first line of its docstring. The tables are
made by running the code (`python tests/tour.py --write`); `tests/test_tour.py` fails when they are out of date.
"""


Starts = Mapping[CodeType, Callable[[dict[str, Any]], bool | None]]


class Walk:
    """The functions that are entered while the walk is on.

    Args:
        starts: functions in which a part of the walk begins or is left out, each with a function of its arguments:
            True, False, or None for as before. All else is left out. By default nothing is.

    Attributes:
        steps: file, function and first line of its docstring, by the function's code, in order.
    """

    def __init__(self, starts: Starts | None = None) -> None:
        self.is_on: Callable[[], bool] = lambda: False
        self.steps: dict[Any, tuple[str, str, str]] = {}
        self._codes = list(starts or ())  # kept, so that no other code gets the identity of one of them
        self._starts = {id(code): start for code, start in (starts or {}).items()}
        self._is_inside = [starts is None]  # for each of these functions that has not returned

    def follow(self, run: Callable[[], object]) -> None:
        """Run something, and note what is entered meanwhile, without finalizers, which run at any time."""
        with no_garbage_collection():
            sys.setprofile(self._on_call)
            try:
                run()
            finally:
                sys.setprofile(None)

    def _on_call(self, frame: FrameType, event: str, value: Any) -> None:
        if event not in ("call", "return"):
            return
        code = frame.f_code
        start = self._starts.get(id(code))  # by identity: most calls are outside, and to hash their code takes long
        if event == "return":
            if start is not None:
                self._is_inside.pop()
            return
        if start is not None:
            answer = start(frame.f_locals)
            self._is_inside.append(self._is_inside[-1] if answer is None else answer)
        if not self._is_inside[-1] or not code.co_filename.startswith(ROOMS) or not self.is_on() or code in self.steps:
            return
        if code.co_name[0] == "<" or not code.co_flags & inspect.CO_NEWLOCALS:
            return  # comprehensions and lambdas are read with what they are in, and so are classes
        consts = code.co_consts
        doc = consts[0] if consts and isinstance(consts[0], str) else ""
        file = str(Path(code.co_filename).relative_to(ROOT))
        self.steps[code] = file, code.co_qualname, inspect.cleandoc(doc).partition("\n")[0]

    def table(self, are_files: bool = False) -> str:
        """Return the steps as Markdown: all, or the first in each file."""
        first = {step[0]: step for step in reversed(self.steps.values())}
        shown = [step for step in self.steps.values() if not are_files or first[step[0]] is step]
        rows = [f"| `{file}` | `{name}` | {doc.replace('|', ' ')} |" for file, name, doc in shown]
        count = f"{len(first)} files." if are_files else f"{len(rows)} functions in {len(first)} files."
        return "\n".join([count, "", "| File | Function | |", "|---|---|---|", *rows])


@cache
def stored_page() -> Walk:
    """Follow a page from the handler that stores it to the handler that processes it."""
    walk, states = Walk(), iter(("warm", "on", "off"))
    state = ""

    class Pilot(Endpoint):
        def __init__(self, factory: EndpointFactory, parent: Node) -> None:
            super().__init__(factory, parent, "pilot")
            self.task_handlers = {
                (TaskType.event, "go"): self.on_go,
                (TaskType.process_data, "thrust"): self.on_thrust,
            }

        def begin(self) -> None:
            self.schedule(tasks.event("go"))

        def on_go(self, task: Any, task_id: Any) -> None:
            nonlocal state
            state = next(states)
            self.store_data("thrust", 0.5)

        def on_thrust(self, task: Any, task_id: Any) -> Any:
            nonlocal state
            if state == "on":
                state = "off"
                return tasks.terminate("done")
            return tasks.event("go")

    class PilotFactory(EndpointFactory):
        def get(self, parent: Any) -> Endpoint:
            return Pilot(self, parent)

    walk.is_on = lambda: state == "on"
    walk.follow(Node("robot", Config(factories={"robot": [PilotFactory()]}), clock=SimClock()).loop)
    return walk


def simulated(request: Request, from_s: float, until_s: float, starts: Starts | None = None) -> Walk:
    """Follow what happens in a recorded run between two moments."""
    walk, simulation = Walk(starts), prepare(request)
    plant = simulation.plant()
    config = simulation.config(plant)
    with tempfile.TemporaryDirectory() as folder:
        recorder = TraceWriter(Path(folder) / "trace.jsonl", simulation.header(plant, config), simulation.trace_info())
        flight = SimulationRun(simulation, plant, config, recorder)
        clock = flight.nodes[0].clock
        walk.is_on = lambda: from_s <= clock.now_s() < until_s

        def end() -> None:
            for node in flight.nodes:
                node.enqueue_input(tasks.terminate("end of the walk"), "tour")

        clock.call_at(until_s, end)
        walk.follow(flight.run)
        recorder.close()
    return walk


@cache
def radar_reading() -> Walk:
    """Follow a radar reading from the plant to the engine and into the trace."""
    return simulated(Request("lander_vertical"), 1.0, 1.0 + 1e-6)


@cache
def stick() -> Walk:
    """Follow the pilot's sticks of one moment to the vehicle, and the pulses of its answer into the trace."""
    starts: Starts = {
        NodeLife.call_loop.__code__: lambda names: names["loop"].name == "pilot" or None,
        Node.run_ready.__code__: lambda names: (
            any(source in ("pilot", "link_tether") for _, source in names["self"].inbox.waiting) or None
        ),
        SimulatedPeer._deliver.__code__: lambda names: True,
    }
    controller = str(ROOT / "robots" / "urov" / "controller_template.py")
    return simulated(Request("urov_sticks", controller=controller), 4.0, 4.015, starts)


@cache
def check_of_a_lab() -> Walk:
    """Follow `snr check` of a solution of lab 1 in the grader's own process, but for the dive, which is a run."""
    starts: Starts = {
        check.__code__: lambda names: True,
        _Grading._case.__code__: lambda names: names["check"].name != "dives",
    }
    walk = Walk(starts)
    walk.is_on = lambda: True
    find_lab("hello_thruster")  # imports what the lab needs: not a part of the walk
    output, ending = StringIO(), suppress(SystemExit)  # on a terminal it would show its status, in other functions
    with (
        tempfile.TemporaryDirectory() as folder,
        chdir(folder),
        redirect_stdout(output),
        redirect_stderr(output),
        ending,
    ):
        shutil.copytree(LAB / "starter", folder, dirs_exist_ok=True)
        shutil.copytree(REFERENCE, folder, dirs_exist_ok=True)
        walk.follow(lambda: check("hello_thruster", Path(folder)))
    return walk


def page_of_data() -> str:
    """Return the part of the page that needs no process: the walks along data."""
    return "\n".join(
        [
            HEAD,
            "## A page: from the handler that stores it to the handler that processes it\n",
            "In lock step, not recorded; the handlers have been looked up before.\n",
            stored_page().table(),
            "\n## A radar reading: from the plant to the engine and into the trace\n",
            "`snr run lander_vertical`, what happens at t = 1 s.\n",
            radar_reading().table(),
            "\n## A pilot's stick: from the surface through the tether to the pulses of the thrusters\n",
            "`snr run urov_sticks --controller robots/urov/controller_template.py`, from t = 4 s on, and only what the",
            "pilot's sticks and the pages that follow from them pass.\n",
            stick().table(),
            "",
        ]
    )


def page() -> str:
    """Return the page."""
    return "\n".join(
        [
            page_of_data(),
            "## A lab: from `snr check` to the points\n",
            "`snr check hello_thruster` of a solution with all points: what the grader's own process does, but for the",
            "dive of the last check, which is a run as above. Of each file the function that is entered first.\n",
            check_of_a_lab().table(are_files=True),
            "",
        ]
    )


if __name__ == "__main__":
    if sys.argv[1:] != ["--write"]:
        sys.exit(__doc__)
    PAGE.write_text(page(), encoding="utf-8")
