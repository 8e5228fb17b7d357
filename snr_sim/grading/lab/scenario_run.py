"""Runs of a scenario with a student's controller: plant, clock, randomness and verdict here, components elsewhere."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from functools import lru_cache, partial
from pathlib import Path
from types import ModuleType
from typing import Any

from snr_sim.core.config import Config
from snr_sim.devices.readings import SensorLoopFactory
from snr_sim.grading.lab.stimulus import GIVEN, Stimulus
from snr_sim.grading.lab.submission import Submission
from snr_sim.grading.lab.verdicts import ENDED_EARLY, GraderError, InconclusiveError, SubmissionError
from snr_sim.grading.remote.protocol import SUBMISSION
from snr_sim.grading.remote.remote import Remote
from snr_sim.prelude.errors import SnrError
from snr_sim.prelude.plant import Plant
from snr_sim.prelude.task import Page, Task, TaskType
from snr_sim.prelude.values import decode_value
from snr_sim.recording.folder import write_result
from snr_sim.recording.reader import Trace, read_trace
from snr_sim.recording.records import ErrorRecord, PageRecord, TruthRecord
from snr_sim.recording.sources import keep_copies
from snr_sim.recording.trace import FILE_NAME, TraceWriter
from snr_sim.scenario import library
from snr_sim.scenario.options import check_options
from snr_sim.scenario.simulation import Request, Simulation, controlled_roles, prepare
from snr_sim.scenario.simulation_run import RunResult, SimulationRun


class ScenarioRun:
    """A completed run with its recorded trace, and the folder where that is kept, if it is."""

    def __init__(self, result: RunResult, trace: Trace, folder: Path | None) -> None:
        self.success: bool = result.success
        self.outcome: str = result.outcome
        self.metrics: dict[str, Any] = result.metrics
        self.sim_time_s: float = result.sim_time_s
        self.error: str = result.error
        self.notes: list[str] = result.notes
        self.folder: Path | None = folder
        self.trace: Trace = trace

    def pages(self, key: str) -> list[tuple[float, Any]]:
        """Return when a page was stored, in the grader's time, and its data; in order."""
        return [
            (record.t, decode_value(bytes(record.values), {"page": Page})[0].data)
            for record in self.trace.records
            if isinstance(record, PageRecord) and record.name == key
        ]

    def truth(self) -> list[tuple[float, dict[str, Any]]]:
        """Return the plant's true values, 20 times a second: `{"depth_m": 1.0, ...}`, and its poses under "poses"."""
        return [
            (record.t, {**record.values, "poses": record.poses})
            for record in self.trace.records
            if isinstance(record, TruthRecord)
        ]


def run_scenario(
    student: Submission,
    scenario: str,
    seed: int,
    controller: str,
    options: dict[str, str],
    io: str,
    may_fail: bool,
    inputs: Sequence[Stimulus] = (),
) -> ScenarioRun:
    """Run the scenario; the result is the same, to the last bit, as that of `snr run` with the same file.

    Args:
        controller: file of the submission; scenario, seed, options and io are as for `snr run`.
        may_fail: whether a run that the student's program ended, by itself or with an error, is returned, too.
        inputs: tasks that come from outside meanwhile, to every node, such as an edit of a state machine.

    Raises:
        SubmissionError: the student's program failed, or ended the run by itself.
        InconclusiveError: the scenario failed.
        GraderError: it could not be prepared.
    """
    robot = _robot_of(scenario)
    child = student.new_child(controller, [robot.path])
    try:
        remote = Remote(child, controller)
        request = Request(scenario, seed, None, str(student.folder / controller), None, io, options)
        simulation, plant, config = _prepared(request, remote, robot)
        if student.record_to is not None:
            folder = student.record_to / f"run-{student.run_count + 1}"
            folder.mkdir(parents=True)
            # What ran on this computer without a wall may be replayed here without a question.
            files = simulation.files().values() if student.isolation == "none" else ()
            with keep_copies(folder, files, library.is_own):
                run = _execute(simulation, plant, config, remote, inputs, folder, is_kept=True)
            student.run_folder = folder
        else:
            with tempfile.TemporaryDirectory(prefix="snr-grading-") as name:
                run = _execute(simulation, plant, config, remote, inputs, Path(name), is_kept=False)
        student.run_count += 1
    finally:
        student.close_child(child)
    return _check_run(run, remote, may_fail)


def _prepared(request: Request, remote: Remote, robot: library.FoundItem) -> tuple[Simulation, Plant, Config]:
    """Prepare the run: read the student's file, create its components; raise SubmissionError if these fail."""
    try:
        path = Path(str(request.controller))
        module = remote.controller(path, [(robot.name, robot.path)])
        base, standard = _base(request, getattr(module, "ROLES", None))
        _check_names(base, module, request.options)
        read = partial(_read_files, remote, path.parent, robot)
        simulation = base.with_controller(module, standard, request, read)
        plant = simulation.plant()
        config = simulation.config(plant)
    except SubmissionError:
        raise
    except SnrError as error:
        raise GraderError(f"The scenario could not be set up: {error}") from error
    for factories in config.factories.values():
        remote.task_filter.of_others |= {one.key for one in factories if isinstance(one, SensorLoopFactory)}
    return simulation, plant, config


def _check_names(base: Simulation, module: ModuleType, options: dict[str, str]) -> None:
    """Check the student's ROLES, and OPTIONS against the requested ones; raise SubmissionError if they are wrong."""
    try:
        roles = controlled_roles(module, base.robot_file)
        check_options(options, base.robot_file, module)
    except SnrError as error:
        raise SubmissionError(str(error), "Look at ROLES and OPTIONS of your file.") from error
    if len(set(roles)) < len(roles):
        raise SubmissionError(f"ROLES is not valid: {roles!r}.", "Name each role once in ROLES.")


def _read_files(remote: Remote, submission: Path, robot: library.FoundItem) -> dict[str, Path]:
    """Return the existing ones of the files that the student's process reports as read."""
    folders = {SUBMISSION: ("controller", submission), robot.name: ("robot", robot.path)}
    read = {}
    for name, below in remote.files:
        label, folder = folders.get(name, ("", submission))
        with suppress(OSError, ValueError):  # skip invalid paths
            file = (folder / below).resolve()
            if label and file.is_relative_to(folder) and file.is_file():
                read[f"{label}/{below}"] = file
    return read


def _execute(
    simulation: Simulation,
    plant: Plant,
    config: Config,
    remote: Remote,
    inputs: Sequence[Stimulus],
    folder: Path,
    is_kept: bool,
) -> ScenarioRun:
    recorder = TraceWriter(folder / FILE_NAME, simulation.header(plant, config), simulation.trace_info())
    try:
        try:
            flight = SimulationRun(simulation, plant, config, recorder)
        except SubmissionError:
            raise
        except SnrError as error:  # a component could not be made
            hint = "Your components could not be made: look at the line named."
            raise remote.submission_error or SubmissionError(str(error), hint) from error
        for one in inputs:
            assert one.task is not None  # a page would be one of a sensor's
            kind, name, values = one.task
            flight.bring(one.at_s, Task(TaskType(kind), name, list(values)), GIVEN)
        result = flight.run()
    finally:
        recorder.close()
    if result.signal:
        raise KeyboardInterrupt
    trace = read_trace(folder / FILE_NAME)
    if is_kept:
        fields = result.fields(simulation.request, trace.digest, folder)
        del fields["wall_time_s"]  # a graded run is the same each time
        write_result(folder, fields)
    return ScenarioRun(result, trace, folder if is_kept else None)


def _check_run(run: ScenarioRun, remote: Remote, may_fail: bool) -> ScenarioRun:
    """Return a run that has not failed; raise an error that names the cause otherwise."""
    if remote.submission_error is not None:
        raise remote.submission_error
    if run.outcome == "ended" and not may_fail:
        raise SubmissionError(f"Your program ended the run at {run.sim_time_s:.2f} s.", ENDED_EARLY, "a whole run")
    if not run.error or may_fail:
        return run
    if any(isinstance(record, ErrorRecord) for record in run.trace.records):
        raise SubmissionError(run.error, "Your program ended the run with an error: look at the line named.")
    raise InconclusiveError(f"The run ended with an error that no line of the submission raised: {run.error}")


def _robot_of(scenario: str) -> library.FoundItem:
    """Return the robot of a scenario; raise GraderError if there is none."""
    try:
        return library.find("robots", library.robot_of_scenario(library.find("scenarios", scenario)))
    except SnrError as error:
        raise GraderError(f"The scenario '{scenario}' cannot be run: {error}") from error


def _base(request: Request, roles: Any) -> tuple[Simulation, ModuleType | None]:
    """Return a scenario with its robot, loaded once for many runs, and the controller of the other roles."""
    named = tuple(map(str, roles)) if isinstance(roles, list) else None
    what = (request.scenario, request.io, named)
    base, standard = _loaded(*what)
    if sys.modules.get(base.robot_file.__name__) is not base.robot_file:  # another one was loaded since
        _loaded.cache_clear()
        base, standard = _loaded(*what)
    return base, standard


@lru_cache(maxsize=1)
def _loaded(scenario: str, io: str, roles: tuple[str, ...] | None) -> tuple[Simulation, ModuleType | None]:
    try:
        base = prepare(Request(scenario, io=io), _empty_controller)
        if roles is None or base.robot_file.ROLES[0] in roles:
            return base, None
        return base, library.load_controller(_robot_of(scenario), base.scenario.CONTROLLER)
    except SnrError as error:
        raise GraderError(f"The scenario '{scenario}' cannot be run: {error}") from error


def _empty_controller(_robot: library.FoundItem, name: str) -> ModuleType:
    """Return a controller without components: the student's replaces it."""
    module = ModuleType("empty_controller")
    module.__file__ = name
    return module
