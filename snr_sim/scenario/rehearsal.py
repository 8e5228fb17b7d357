"""An edit tried before it is made: a simulated run is run again with it, and some seconds further.

    trace --> inputs up to a moment --> run again, twice: without and with the edit at that moment --> changes of state

Recorded readings do not answer another program, as `snr machine try FILE RUN` has to state. Here the plant does.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from snr_sim.behaviors.imports import files_named, why_not
from snr_sim.behaviors.interpreter import NS_PER_S
from snr_sim.prelude import tasks
from snr_sim.prelude.errors import ParameterError, UnknownNameError, suggest
from snr_sim.prelude.task import Page, Task
from snr_sim.prelude.values import decode_value
from snr_sim.recording.reader import Trace, read_trace
from snr_sim.recording.records import Executed, InputRecord, LogLineRecord, Record
from snr_sim.recording.trace import FILE_NAME, TraceWriter
from snr_sim.scenario.library import LRP
from snr_sim.scenario.machine_edits import changes_of, edits_of, key_of_change
from snr_sim.scenario.simulation import Request, prepare, request_of
from snr_sim.scenario.simulation_run import SimulationRun

AHEAD_S = 10.0
_SOURCE = "rehearsal"  # of the edit, and of the end

Change = dict[str, Any]


@dataclass(frozen=True)
class Course:
    """What machines do after a moment: changes of state, and the scenario's verdict if it has ended; empty if not."""

    changes: list[Change]
    end: str


@dataclass(frozen=True)
class Rehearsal:
    """What machines do from a moment to another one, with the run's program and with the other one."""

    at_s: float
    until_s: float
    unchanged: Course
    edited: Course


def rehearse(
    trace: Trace, text: str, files: Mapping[str, str], at_s: float, name: str = "", ahead_s: float = AHEAD_S
) -> Rehearsal:
    """Run a simulated run again up to a moment, and from there on with its program and with another one.

    Args:
        trace: of the run, which may continue meanwhile.
        text: of the other program.
        files: texts that it imports, by the names of their files.
        at_s: the moment; the newest recorded one, if it is later.
        name: of the machine's component; empty if there is one only.
        ahead_s: how long from then on.

    Raises:
        ParameterError: the run was not simulated, does not repeat, or the text has mistakes; or the moment is invalid.
        UnknownNameError: it has no such machine.
    """
    if not at_s >= 0.0:
        raise ParameterError(f"A run has no moment {at_s:g} s.", fix="--at 12.")
    request = request_of(trace.trace_info, trace.header)
    if trace.header.clock != "sim":
        raise ParameterError(
            "This run has real devices or several processes, so it cannot be run again.", fix="try it on a simulation."
        )
    name = name or edits_of(trace).name
    nodes = {one.component: one.node for one in trace.records if isinstance(one, LogLineRecord) and _is_text(one)}
    if name not in nodes:
        raise UnknownNameError(f"This run has no machine '{name}'.", fix=suggest(name, nodes))
    at_s = min(at_s, max((one.t for one in trace.records if isinstance(one, Executed | InputRecord)), default=0.0))
    until_s = at_s + ahead_s
    with TemporaryDirectory(prefix="snr-rehearsal-") as folder:
        first = replace(request, controller=_first_program(trace, name, Path(folder)) or request.controller)
        edit = tasks.event(f"{name}.edit", [text, "", dict(files)])
        (unchanged, end), (edited, end_of_edited) = (
            _run(trace, first, nodes[name], at_s, until_s, brought, Path(folder)) for brought in ((), (edit,))
        )
    at_ns = round(at_s * NS_PER_S)
    then, again = (
        [key_of_change(one) for one in changes_of(records) if one["t_ns"] < at_ns]
        for records in (trace.records, unchanged)
    )
    if then != again:
        raise ParameterError(
            "Run again, this run has other changes of state.", fix="a file of it has changed: start it again."
        )
    _check_answer(edited, name, at_s)
    courses = (Course(_after(unchanged, at_ns), end), Course(_after(edited, at_ns), end_of_edited))
    return Rehearsal(at_s, until_s, *courses)


def _first_program(trace: Trace, name: str, folder: Path) -> str:
    """Write the program with which a run began, as its file may have been saved since; return where, or an empty text
    if its controller is not a file in LRP."""
    controller = Path(trace.trace_info.controller)
    if controller.suffix != LRP:
        return ""
    texts: dict[str, list[str]] = {}
    for one in trace.records:
        if isinstance(one, LogLineRecord) and _is_text(one) and f"{one.component} ".startswith(f"{name} "):
            texts.setdefault(one.component.removeprefix(name).lstrip() or controller.name, []).append(one.text)
    for file, lines in texts.items():
        if why_not(file, LRP):  # a trace may be of another user
            continue
        text = "\n".join([*lines, ""])
        _write(folder / file, text.encode())
        for actions in files_named(text)[1]:
            if (controller.parent / actions).is_file():
                _write(folder / actions, (controller.parent / actions).read_bytes())
    return str(folder / controller.name)


def _is_text(line: LogLineRecord) -> bool:
    return line.level == "PROGRAM"


def _write(path: Path, data: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)


def _run(
    trace: Trace, request: Request, node: str, at_s: float, until_s: float, edits: Sequence[Task], folder: Path
) -> tuple[list[Record], str]:
    """Run with the inputs of a recorded run up to a moment, and then edits; return the records and the verdict."""
    simulation = prepare(request)
    plant = simulation.plant()
    config = simulation.config(plant)
    path = folder / FILE_NAME
    recorder = TraceWriter(path, simulation.header(plant, config), simulation.trace_info())
    try:
        run = SimulationRun(simulation, plant, config, recorder)
        again = {component for node in run.nodes for component in node.components}  # which bring their inputs again
        for one in trace.records:
            if not isinstance(one, InputRecord) or one.t > at_s or one.type != "event":
                continue
            if one.node == node and one.source not in again:
                run.bring(one.t, tasks.event(one.name, list(decode_value(bytes(one.values)))), one.source)
        for edit in edits:
            run.bring(at_s, edit, _SOURCE)
        run.bring(until_s, tasks.terminate("the rehearsal is over"), _SOURCE)
        result = run.run()
    finally:
        recorder.close()
    if result.error:
        raise ParameterError(f"The rehearsal failed: {result.error}")
    records = read_trace(path).records
    path.unlink()
    has_verdict = result.outcome != "ended"
    return records, f"{result.outcome} after {result.sim_time_s:g} s" if has_verdict else ""


def _after(records: Sequence[Record], at_ns: int) -> list[Change]:
    """Return the changes after a moment, and those that an edit then has caused."""
    return [
        one
        for one in changes_of(records)
        if one["t_ns"] > at_ns or (one["t_ns"] == at_ns and one["kind"] in ("edit", "stop"))
    ]


def _check_answer(records: Sequence[Record], name: str, at_s: float) -> None:
    """Raise ParameterError if the edit was refused."""
    for one in records:
        if isinstance(one, Executed) and one.t >= at_s and (one.type, one.name) == ("store_page", f"{name}.edited"):
            (page,) = decode_value(bytes(one.values), {"page": Page})
            if not page.data["ok"]:
                problem = page.data["problems"][0]
                raise ParameterError(f"Line {problem['line']}: {problem['message']}", fix=problem["fix"])
