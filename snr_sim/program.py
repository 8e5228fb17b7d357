"""A program of nodes without a scenario, such as a robot in the pool, recorded so that it can be replayed."""

from __future__ import annotations

import platform
from collections.abc import Sequence
from pathlib import Path

from snr_sim import __version__, library
from snr_sim.core.clocks import SimClock
from snr_sim.core.config import Config
from snr_sim.core.interrupts import orderly
from snr_sim.core.lockstep import LockStep
from snr_sim.core.node import Node
from snr_sim.prelude.clock import Clock
from snr_sim.prelude.component import RoleName
from snr_sim.recording.folder import discard, new_run_folder
from snr_sim.recording.records import Header, Opening, name_of
from snr_sim.recording.trace import FILE_NAME, TraceWriter
from snr_sim.simulation import command_keys


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
    """Runs one role until it ends, and returns its run folder: `snr replay FOLDER` replays it.

    Args:
        role: which.
        config: of the robot.
        program: the file that has this config under the name `config`: `__file__`.
        out: folder that run folders go into.
        clock: the wall clock if not given.
        seed: of the run.
        until_s: the longest virtual time, under a `SimClock`.

    Raises:
        ComponentFailed: a handler or a loop raised; it was recorded up to there.
        TraceError: the recording cannot be written.
    """
    folder = new_run_folder(Path(out), Path(program).stem, seed)
    recorder = TraceWriter(
        folder / FILE_NAME, program_header([role], config, program, clock, seed), program_opening(program)
    )
    try:
        node = Node(role, config, clock=clock, recorder=recorder, seed=seed)
    except BaseException:
        recorder.close()
        discard(folder)  # nothing has begun
        raise
    try:
        with orderly([node]):
            if isinstance(clock, SimClock):
                LockStep([node], clock, until_s=until_s).run()
            else:
                node.loop()
    finally:
        recorder.close()
    return folder


def program_header(
    roles: Sequence[RoleName], config: Config, program: str | Path, clock: Clock | None = None, seed: int = 0
) -> Header:
    """Returns the second line of the trace of a program; arguments as above."""
    path = Path(program).resolve()
    return Header(
        kit=__version__,
        python=platform.python_version(),
        platform=platform.platform(),
        packages=library.package_versions(),
        scenario="",
        robot="",
        controller=name_of(str(path)),
        roles=list(roles),
        engine="",
        io="",
        seed=seed,
        options={},
        nodes=[f"{role}_node" for role in roles],
        clock="sim" if isinstance(clock, SimClock) else "wall",
        commands={f"{role}_node": command_keys(config.get(role)) for role in roles},
        sources=library.hashes_of_files([("program", path)]),
        scene={},
    )


def program_opening(program: str | Path) -> Opening:
    """Returns the first line of the trace of a program."""
    return Opening.now("", str(Path(program).resolve()))
