"""Walks through the library: which functions a piece of data passes, in order. Makes docs/tour.md.

python tests/tour.py --write     writes the page; tests/test_tour.py fails if the page is another one
"""

from __future__ import annotations

import inspect
import sys
import tempfile
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import snr_sim
from snr_sim import Config, Endpoint, EndpointFactory, Node, SimClock, TaskType, tasks
from snr_sim.core.node_life import NodeLife
from snr_sim.links.simulated import SimulatedPeer
from snr_sim.recording.trace import TraceWriter
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import SimulationRun

ROOT = Path(snr_sim.__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "tour.md"
ROOMS = (f"{ROOT / 'snr_sim'}/", f"{ROOT / 'robots'}/")
HEAD = """# A tour of the library

Three walks through the code, each along one piece of data. Read the functions in this order: each row is a function
that the data pass, listed where it is entered for the first time, with the first line of its docstring. The tables are
made by running the code (`python tests/tour.py --write`); `tests/test_tour.py` fails when they are out of date.
"""


Starts = Mapping[CodeType, Callable[[dict[str, Any]], bool]]


class Walk:
    """The functions that are entered while the walk is on.

    Args:
        starts: functions in which a part of the walk begins, each with a condition on its arguments; the rest of the
            program is left out. By default nothing is left out.

    Attributes:
        steps: file, function and first line of its docstring, by the function's code, in order.
    """

    def __init__(self, starts: Starts | None = None) -> None:
        self.is_on: Callable[[], bool] = lambda: False
        self.steps: dict[Any, tuple[str, str, str]] = {}
        self._starts = starts or {}
        self._is_inside = [starts is None]  # for each of these functions that has not returned

    def follow(self, run: Callable[[], object]) -> None:
        """Run something, and note what is entered meanwhile."""
        sys.setprofile(self._on_call)
        try:
            run()
        finally:
            sys.setprofile(None)

    def _on_call(self, frame: FrameType, event: str, value: Any) -> None:
        code = frame.f_code
        if code in self._starts and event == "call":
            self._is_inside.append(self._is_inside[-1] or self._starts[code](frame.f_locals))
        is_inside = self._is_inside[-1]
        if code in self._starts and event == "return":
            self._is_inside.pop()
        if event != "call" or not is_inside or code in self.steps or not code.co_filename.startswith(ROOMS):
            return
        if not self.is_on():
            return
        if code.co_name[0] == "<":  # comprehensions and lambdas are read with what they are in
            return
        consts = code.co_consts
        doc = consts[0] if consts and isinstance(consts[0], str) else ""
        file = str(Path(code.co_filename).relative_to(ROOT))
        self.steps[code] = file, code.co_qualname, inspect.cleandoc(doc).partition("\n")[0]

    def table(self) -> str:
        """Return the steps as Markdown."""
        rows = [f"| `{file}` | `{name}` | {doc.replace('|', ' ')} |" for file, name, doc in self.steps.values()]
        files = len({file for file, _, _ in self.steps.values()})
        return "\n".join(
            [f"{len(rows)} functions in {files} files.", "", "| File | Function | |", "|---|---|---|", *rows]
        )


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
        NodeLife.call_loop.__code__: lambda names: names["loop"].name == "pilot",
        Node.run_ready.__code__: lambda names: any(
            source in ("pilot", "link_tether") for _, source in names["self"].inbox.waiting
        ),
        SimulatedPeer._deliver.__code__: lambda names: True,
    }
    controller = str(ROOT / "robots" / "urov" / "controller_template.py")
    return simulated(Request("urov_sticks", controller=controller), 4.0, 4.015, starts)


def page() -> str:
    """Return the page."""
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


if __name__ == "__main__":
    if sys.argv[1:] != ["--write"]:
        sys.exit(__doc__)
    PAGE.write_text(page(), encoding="utf-8")
