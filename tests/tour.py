"""Walks through the library: which functions a piece of data passes, in order. Makes docs/tour.md.

python tests/tour.py --write     writes the page; tests/test_tour.py fails if the page is another one
"""

from __future__ import annotations

import inspect
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Any

import snr_sim
from snr_sim import Config, Endpoint, EndpointFactory, Node, SimClock, TaskType, tasks
from snr_sim.recording.trace import TraceWriter
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import SimulationRun

ROOT = Path(snr_sim.__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "tour.md"
ROOMS = (f"{ROOT / 'snr_sim'}/", f"{ROOT / 'robots'}/")
HEAD = """# A tour of the library

Two walks through the code, each along one piece of data. Read the functions in this order: each row is a function that
the data pass, listed where it is entered for the first time, with the first line of its docstring. The tables are made
by running the code (`python tests/tour.py --write`); `tests/test_tour.py` fails when they are out of date.
"""


class Walk:
    """The functions that are entered while the walk is on.

    Attributes:
        steps: file, function and first line of its docstring, by the function's code, in order.
    """

    def __init__(self) -> None:
        self.is_on: Callable[[], bool] = lambda: False
        self.steps: dict[Any, tuple[str, str, str]] = {}

    def follow(self, run: Callable[[], object]) -> None:
        """Run something, and note what is entered meanwhile."""
        sys.setprofile(self._on_call)
        try:
            run()
        finally:
            sys.setprofile(None)

    def _on_call(self, frame: FrameType, event: str, value: Any) -> None:
        code = frame.f_code
        if event != "call" or code in self.steps or not code.co_filename.startswith(ROOMS) or not self.is_on():
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


def simulated(scenario: str, from_s: float, until_s: float) -> Walk:
    """Follow what happens in a recorded run of a scenario, seed 0, between two moments."""
    walk, simulation = Walk(), prepare(Request(scenario, 0))
    plant = simulation.plant()
    config = simulation.config(plant)
    with tempfile.TemporaryDirectory() as folder:
        recorder = TraceWriter(Path(folder) / "trace.jsonl", simulation.header(plant, config), simulation.trace_info())
        flight = SimulationRun(simulation, plant, config, recorder)
        clock = flight.nodes[0].clock
        walk.is_on = lambda: from_s <= clock.now_s() < until_s
        walk.follow(flight.run)
        recorder.close()
    return walk


def page() -> str:
    """Return the page."""
    radar = simulated("lander_vertical", 1.0, 1.0 + 1e-6)
    return "\n".join(
        [
            HEAD,
            "## A page: from the handler that stores it to the handler that processes it\n",
            "In lock step, not recorded; the handlers have been looked up before.\n",
            stored_page().table(),
            "\n## A radar reading: from the plant to the engine and into the trace\n",
            "`snr run lander_vertical`, what happens at t = 1 s.\n",
            radar.table(),
            "",
        ]
    )


if __name__ == "__main__":
    if sys.argv[1:] != ["--write"]:
        sys.exit(__doc__)
    PAGE.write_text(page(), encoding="utf-8")
