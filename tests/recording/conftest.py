"""Recorded runs to look at: each is flown once and shared by all tests of this folder."""

from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

from snr_sim.flight import Flight
from snr_sim.recording.reader import Trace, read_trace
from snr_sim.recording.trace import FILE_NAME, TraceWriter
from snr_sim.simulation import Request, prepare

Fly = Callable[..., Trace]


@pytest.fixture(scope="session")
def fly(tmp_path_factory: pytest.TempPathFactory) -> Fly:
    """Returns a function that flies (scenario, controller, seed) and returns the trace."""

    @cache
    def fly(scenario: str = "lander_vertical", controller: str | None = None, seed: int = 0) -> Trace:
        folder: Path = tmp_path_factory.mktemp("run")
        simulation = prepare(Request(scenario, seed, controller=controller))
        plant = simulation.plant()
        config = simulation.config(plant)
        recorder = TraceWriter(folder / FILE_NAME, simulation.header(plant, config), simulation.opening())
        result = Flight(simulation, plant, config, recorder).run()
        recorder.close()
        trace = read_trace(folder / FILE_NAME)
        assert trace.digest == recorder.digest
        assert sum(record.__struct_config__.tag in ("task", "page") for record in trace.records) == result.tasks
        return trace

    return fly
