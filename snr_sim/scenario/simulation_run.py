"""One run of a simulation (`SimulationRun`), from its start to its verdict, recorded if a recorder is given.

`snr run`, `snr resim`, learning and grading all run the result of `simulation.prepare`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from snr_sim.core.clocks import SimClock
from snr_sim.core.config import Config
from snr_sim.core.node import Node
from snr_sim.core.output_recording import record_output
from snr_sim.core.runners import SimRunner
from snr_sim.core.source_location import describe_error, find_student_location, short_path
from snr_sim.plants.stepping import Stepper
from snr_sim.prelude.errors import SnrError
from snr_sim.prelude.plant import Plant
from snr_sim.prelude.scenario import Verdict
from snr_sim.prelude.task import Task
from snr_sim.recording.folder import RESULT_SCHEMA
from snr_sim.recording.trace import TraceWriter
from snr_sim.scenario.simulation import Request, Simulation
from snr_sim.scenario.student_calls import Referee, TruthLog, call_student

AFTER_LOOPS = 1_000_000  # under a SimClock, later than the ticks of all loops that are due at the same time


@dataclass
class RunResult:
    """Result of a run, as written to result.json."""

    outcome: str
    success: bool
    metrics: dict[str, Any]
    sim_time_s: float
    wall_time_s: float
    tasks: int
    pages: int
    notes: list[str]
    error: str = ""
    signal: str = ""

    def fields(self, request: Request, digest: str, folder: Path) -> dict[str, Any]:
        """Return the fields of result.json and --json."""
        return {
            "schema": RESULT_SCHEMA,
            "scenario": request.scenario,
            "seed": request.seed,
            "engine": request.engine,
            "controller": request.controller,
            "success": self.success,
            "outcome": self.outcome,
            **self.metrics,
            "sim_time_s": self.sim_time_s,
            "wall_time_s": self.wall_time_s,
            "tasks": self.tasks,
            "pages": self.pages,
            "notes": self.notes,
            "trace_digest": digest,
            "run_dir": str(folder),
            **({"error": self.error} if self.error else {}),
            **({"signal": self.signal} if self.signal else {}),
        }


class SimulationRun:
    """One run of a simulation. The constructor creates the nodes and everything around them, but starts nothing.

    Args:
        simulation: what runs.
        plant: from `simulation.plant()`, fresh.
        config: from `simulation.config(plant)`.
        recorder: writes the trace, if given; the caller closes it.
        pace: virtual seconds per wall second; None is as fast as possible. With devices that have clocks, 1.
        on_advance: called with the virtual time at each new instant.

    Raises:
        ConfigError: the components cannot be created.
    """

    def __init__(
        self,
        simulation: Simulation,
        plant: Plant,
        config: Config,
        recorder: TraceWriter | None = None,
        pace: float | None = None,
        on_advance: Callable[[float], None] | None = None,
    ) -> None:
        self._simulation = simulation
        self._plant = plant
        clock = self._clock = SimClock()
        self._runner = SimRunner(
            config,
            simulation.roles,
            clock=clock,
            recorder=recorder,
            seed=simulation.request.seed,
            pace=1.0 if simulation.is_real_time else pace,
            until_s=float(simulation.scenario.TIME_LIMIT_S),
            log_notes=False,  # the result contains them
        )
        self._truth = TruthLog(plant, recorder) if recorder is not None else None
        self._referee = Referee(simulation.judge, plant, self.nodes, self._truth)
        clock.follow(Stepper(plant).advance_to)
        clock.follow(self._referee.check)
        if on_advance is not None:
            clock.follow(on_advance)
        if self._truth is not None:
            clock.follow(self._truth.record_if_due)

    @property
    def nodes(self) -> list[Node]:
        """The nodes that run."""
        return list(self._runner.nodes.values())

    def bring(self, at_s: float, task: Task, source: str) -> None:
        """Bring a task to every node at a moment, after all else that is due then: what an operator did, or an editor.

        Args:
            at_s: when.
            task: such as an event.
            source: who brings it, for the trace.
        """
        for node in self.nodes:
            self._clock.call_at(at_s, partial(node.enqueue_input, task, source), AFTER_LOOPS)

    def run(self, signals: Sequence[str] = ()) -> RunResult:
        """Run until the scenario's verdict, its time limit, an error or a signal.

        Args:
            signals: names of signals received before the run; then it ends at once.
        """
        error, notes = "", []
        start_s = time.perf_counter()
        try:
            if self._truth is not None:
                self._truth.record_if_due(0.0)
            with record_output(self.nodes):
                self._runner.run()
        except SnrError as failure:
            error = str(failure)
        except KeyboardInterrupt as stop:
            self._runner.signals.append("SIGINT")
            notes.append(describe_error(stop, "when the run was to end").removeprefix("Interrupted: "))
        except Exception as failure:
            if find_student_location(failure.__traceback__) is None:
                raise
            error = describe_error(failure, "while the scenario was run")
        wall_time_s = time.perf_counter() - start_s
        signals = [*signals, *self._runner.signals]
        verdict = self._verdict(bool(signals))
        return result_of(self._simulation, self._plant, self.nodes, verdict, wall_time_s, signals, error, notes)

    def _verdict(self, is_interrupted: bool) -> Verdict:
        if self._referee.verdict is not None:
            return self._referee.verdict
        if is_interrupted:
            return Verdict("interrupted", False)
        ended = [node.exit_reason or "" for node in self.nodes if node.is_terminated]
        if ended:
            return Verdict("ended", False, next(filter(None, ended), ""))
        limit_s = float(self._simulation.scenario.TIME_LIMIT_S)
        return Verdict("timeout", False, f"the scenario had not come to an end by its TIME_LIMIT_S of {limit_s:g} s")


def run_recorded(simulation: Simulation, path: Path, inputs: Sequence[tuple[float, Task]] = ()) -> RunResult:
    """Run a simulation from its start to its end, and record it.

    Args:
        simulation: what runs, on a new plant.
        path: of the trace, which is written.
        inputs: tasks that come from outside, such as an edit, and when; see `SimulationRun.bring`.

    Raises:
        ConfigError: the components cannot be created.
    """
    plant = simulation.plant()
    config = simulation.config(plant)
    recorder = TraceWriter(path, simulation.header(plant, config), simulation.trace_info())
    try:
        run = SimulationRun(simulation, plant, config, recorder)
        for at_s, task in inputs:
            run.bring(at_s, task, "outside")
        return run.run()
    finally:
        recorder.close()


def result_of(
    simulation: Simulation,
    plant: Plant | None,
    nodes: Sequence[Node],
    verdict: Verdict,
    wall_time_s: float,
    signals: Sequence[str],
    error: str = "",
    notes: Sequence[str] = (),
) -> RunResult:
    """Return the result of a run that has ended, by a verdict or an error; a role without a plant has no metrics."""
    metrics: dict[str, Any] = {}
    if plant is not None:
        metrics, metrics_error = _metrics(simulation, plant)
        error = error or metrics_error
    if error:
        verdict = Verdict("error", False)
    reason = [f"{verdict.outcome}: {verdict.reason}."] if verdict.reason else []
    return RunResult(
        outcome=verdict.outcome,
        success=verdict.success,
        metrics=metrics,
        sim_time_s=wall_time_s if plant is None else plant.time_s,
        wall_time_s=wall_time_s,
        tasks=sum(node.machine.executed for node in nodes),
        pages=sum(node.datastore.stored for node in nodes),
        notes=[*simulation.notes, *notes, *reason, *(note for node in nodes for note in node.notes)],
        error=error,
        signal=signals[0] if signals else "",
    )


def _metrics(simulation: Simulation, plant: Plant) -> tuple[dict[str, Any], str]:
    """Return the scenario's metrics and an empty text, or no metrics and an error message."""
    try:
        metrics = call_student(simulation.judge.metrics, "metrics(plant, seed)", plant, simulation.request.seed)
    except SnrError as failure:
        return {}, str(failure)
    if isinstance(metrics, dict):
        return metrics, ""
    place = short_path(str(simulation.judge.__file__))
    return {}, f"{place}: metrics(plant, seed) returned {metrics!r}, which is not a dict."
