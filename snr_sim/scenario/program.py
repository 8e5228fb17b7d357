"""A program of nodes without a scenario, such as a robot in the pool, recorded so that it can be replayed."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from functools import partial
from itertools import count
from pathlib import Path

from snr_sim.core.clocks import SimClock
from snr_sim.core.config import Config
from snr_sim.core.interrupts import graceful_shutdown
from snr_sim.core.lockstep import LockStep
from snr_sim.core.node import Node
from snr_sim.core.output_recording import record_output
from snr_sim.core.standard_streams import print_line
from snr_sim.prelude.clock import Clock
from snr_sim.prelude.component import RoleName
from snr_sim.prelude.errors import ConfigError
from snr_sim.recording.folder import discard, header_of_program, new_run_folder
from snr_sim.recording.records import Header, TraceInfo
from snr_sim.recording.sources import keep_copies, program_files
from snr_sim.recording.trace import FILE_NAME, TraceWriter
from snr_sim.scenario import library
from snr_sim.scenario.simulation import commands_of
from snr_sim.supervision.multi_proc import MultiProcRunner
from snr_sim.supervision.plan import Supervisor
from snr_sim.supervision.supervised_runner import SupervisedRunner


def record_program(
    role: RoleName,
    config: Config,
    program: str | Path,
    out: str | Path = "runs",
    *,
    clock: Clock | None = None,
    seed: int = 0,
    until_s: float | None = None,
) -> Path:
    """Run one role until it ends, and return its run folder: `snr replay FOLDER` replays it.

    Args:
        role: its name.
        config: of the robot.
        program: the file that has this config under the name `config`: `__file__`.
        out: folder that run folders go into.
        clock: the wall clock if not given.
        seed: of the run.
        until_s: the longest virtual time, under a `SimClock`.

    Raises:
        ComponentFailedError: a handler or a loop raised; the run is recorded up to the failure.
        TraceError: the recording cannot be written.
    """
    folder = new_run_folder(Path(out), Path(program).stem, seed)
    _record(folder, program, role, config, seed, clock=clock, until_s=until_s)
    return folder


def record_roles(
    config: Config,
    program: str | Path,
    roles: Sequence[RoleName] | None = None,
    out: str | Path = "runs",
    *,
    seed: int = 0,
    ends_all: Sequence[RoleName] = (),
    plan: Supervisor | None = None,
) -> Path:
    """Run several roles, each in a process, and return their run folder.

    The run folder has a folder for each role, with that role's trace: `snr replay FOLDER/ROLE` replays it. A role that
    is started again has a further one, `ROLE.2` and so on, with a trace of its own.

    Args:
        config: of the robot.
        program: the file that has this config under the name `config`: `__file__`.
        roles: all of the config's if not given.
        out: folder that run folders go into.
        seed: of the run.
        ends_all: roles that end all others when they end.
        plan: how roles are started again, by a `SupervisedRunner`; its children are the roles, in place of the two
            above. If not given, a `MultiProcRunner` ends all when one fails.

    Raises:
        ConfigError: an object cannot be sent to a process, so none was started.
        ComponentFailedError: a role failed; all roles are recorded up to the failure.
        SupervisionError: roles failed more often than the plan allows.
    """
    if plan is not None and (roles is not None or ends_all):
        raise ConfigError("A plan names the roles, and which one ends all.", fix="Child(role, ends_all=True).")
    folder = new_run_folder(Path(out), Path(program).stem, seed).resolve()
    try:
        run = partial(_record_one_of_several, folder, Path(program).resolve())
        if plan is None:
            MultiProcRunner(config, roles, seed=seed, ends_all=ends_all, run=run).run()
        else:
            SupervisedRunner(config, plan, seed=seed, folder=folder, run=run).run()
    except ConfigError:
        discard(folder)
        raise
    return folder


def _record(
    folder: Path,
    program: str | Path,
    role: RoleName,
    config: Config,
    seed: int,
    has_node: Callable[[Node], None] | None = None,
    *,
    clock: Clock | None = None,
    until_s: float | None = None,
) -> None:
    """Run one role and record it; `has_node` gets its node before it begins."""
    header = program_header([role], config, program, clock, seed)
    recorder = TraceWriter(folder / FILE_NAME, header, TraceInfo.now("", str(Path(program).resolve())))
    try:
        node = Node(role, config, clock=clock, recorder=recorder, seed=seed)
    except BaseException:
        recorder.close()
        discard(folder)  # nothing has begun
        raise
    if not isinstance(clock, SimClock):
        recorder.fail_softly([node])
    if has_node is not None:
        has_node(node)
    try:
        with (
            keep_copies(folder, program_files(Path(program).resolve()), library.is_own),
            graceful_shutdown([node]),
            record_output([node]),
        ):
            if isinstance(clock, SimClock):
                LockStep([node], clock, until_s=until_s).run()
            else:
                node.loop()
    finally:
        recorder.close()
        if recorder.loss:
            print_line(sys.stderr, f"note: {recorder.loss}")


def _record_one_of_several(
    folder: Path, program: Path, role: RoleName, config: Config, seed: int, has_node: Callable[[Node], None]
) -> None:
    own = folder / role
    for start in count(2):
        try:
            own.mkdir()
            break
        except FileExistsError:  # of the process before
            own = folder / f"{role}.{start}"
    _record(own, program, role, config, seed, has_node)


def program_header(
    roles: Sequence[RoleName], config: Config, program: str | Path, clock: Clock | None = None, seed: int = 0
) -> Header:
    """Return the second line of the trace of a program; arguments as above."""
    name = "sim" if isinstance(clock, SimClock) else "wall"
    return header_of_program(roles, commands_of(roles, config), Path(program).resolve(), name, seed)
