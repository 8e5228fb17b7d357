"""`snr processes FILE [NAMES]`: runs RoverProcesses, each in a process or all in one lock step."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from snr_sim.cli.arguments import AsJson, Out, address_of
from snr_sim.cli.output import capture_output, print_json, print_text
from snr_sim.core.standard_streams import print_line
from snr_sim.prelude.errors import ComponentFailedError, ConfigError, ParameterError, RecordingError, SupervisionError

if TYPE_CHECKING:
    from snr_sim.processes.runner import ProcessRunner


def processes(
    file: Annotated[Path, typer.Argument(help="A Python file, or a folder with a file for each name.")],
    names: Annotated[list[str] | None, typer.Argument(help="Which classes; all of the file if not given.")] = None,
    sim_s: Annotated[float, typer.Option("--sim", metavar="S", help="Simulate so many seconds in lock step.")] = 0.0,
    seed: Annotated[int, typer.Option(help="Of the run.")] = 0,
    health_at: Annotated[str, typer.Option(metavar="HOST:PORT", help="Answer snr health here.")] = "",
    out: Out = Path("runs"),
    as_json: AsJson = False,
) -> None:
    """Run RoverProcesses: each in a process, or all in one lock step.

    Processes run until Ctrl-C, or until one of them calls terminate_state(); one that fails is started again. Their
    logs are in the run folder, and snr health RUN prints what they do. A simulation is recorded there, too: snr replay
    RUN executes it again.

    Exit status: 0 all ended in order, 1 a process failed, or more often than it may; 2 nothing was started.
    """
    if not 0.0 <= sim_s < float("inf"):
        raise ParameterError(f"--sim is {sim_s:g}.", fix="seconds, such as --sim 60.")
    from snr_sim.recording.folder import new_run_folder

    runner = runner_of(file, names or [], seed)
    if health_at:
        runner.health_at = _health_address(health_at, sim_s)
    error, folder = "", None if sim_s else new_run_folder(out, file.stem, seed)
    with capture_output(as_json):
        try:
            if folder is None:
                folder = runner.simulate(sim_s, out)
            else:
                runner.run(folder.resolve())
                error = _failures(folder)
        except (ComponentFailedError, SupervisionError) as failure:
            error = str(failure)
    if as_json:
        run = None if folder is None else str(folder)
        print_json({"run_dir": run, "processes": [spec.name for spec in runner.specs], "error": error})
    elif error:
        print_line(sys.stderr, error)
    else:
        print_text(folder)
    sys.exit(1 if error else 0)


def _health_address(text: str, sim_s: float) -> tuple[str, int]:
    from snr_sim.links.security import is_loopback

    address = address_of(text, "an address")
    if sim_s:
        raise ParameterError("--health-at is for processes; a simulation has none.", fix="leave out --sim or it.")
    if not is_loopback(address[0]):
        raise ParameterError(
            f"--health-at {text}: health is answered on this computer only.", fix=f"--health-at 127.0.0.1:{address[1]}"
        )
    return address


def _failures(folder: Path) -> str:
    """Return what failed in a run that has ended, and was not started again, such as a cleanup."""
    from snr_sim.supervision.health import read_health

    try:
        parts = read_health(folder).tree[1:]
    except RecordingError:  # it could not be written, which the run has reported
        return ""
    return "\n".join(f"{part.name} failed: {part.why}" for part in parts if part.state == "failed")


def runner_of(file: Path, names: list[str], seed: int) -> ProcessRunner:
    """Return a runner of the processes in a file, or of those that have files in a folder.

    Raises:
        ConfigError: there is no such file or class, or no process in it.
    """
    from snr_sim.processes.enabled import class_in, load_file
    from snr_sim.processes.rover_process import RoverProcess
    from snr_sim.processes.runner import ProcessRunner

    if file.is_dir() and not names:
        raise ConfigError(f"{file} is a folder: which of its modules?", fix=f"snr processes {file} Drive Gps")
    if file.is_dir():
        return ProcessRunner(names, folder=file, seed=seed)
    if not file.is_file():
        raise ConfigError(f"There is no file {file}.", fix="a Python file, or a folder of them.")
    found = load_file(file.resolve())
    if names:
        return ProcessRunner([class_in(found, name) for name in names], seed=seed)
    runners = [one for one in found.values() if isinstance(one, ProcessRunner)]
    if runners:
        runners[0].seed = seed or runners[0].seed
        return runners[0]
    kinds = [one for one in found.values() if isinstance(one, type) and issubclass(one, RoverProcess)]
    own = [one for one in kinds if one.__module__ == file.stem]
    if not own:
        raise ConfigError(f"{file} has no class of a RoverProcess.", fix="class Drive(RoverProcess): ...")
    return ProcessRunner(own, seed=seed)
