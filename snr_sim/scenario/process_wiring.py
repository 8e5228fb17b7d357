"""Wiring of a recorded program of RoverProcesses: from its ProcessRunner, or from the classes named like its roles."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from types import ModuleType

from snr_sim.core.config import Config
from snr_sim.core.reload.sources import source_files
from snr_sim.processes.enabled import class_in
from snr_sim.processes.message import BROKER
from snr_sim.processes.rover_process import RoverProcess
from snr_sim.processes.runner import ProcessRunner
from snr_sim.scenario import library


def wiring_of_processes(module: ModuleType, roles: Sequence[str]) -> Config | None:
    """Return the wiring of a run with these roles; None if they are not those of processes.

    Raises:
        ConfigError: a role has no class.
    """
    if BROKER not in roles:
        return None
    runner = next((one for one in vars(module).values() if isinstance(one, ProcessRunner)), None)
    if runner is None:
        runner = ProcessRunner([_class_of(module, role) for role in roles if role != BROKER])
    return runner.config()


def _class_of(module: ModuleType, name: str) -> type[RoverProcess]:
    """Return the class of a process: in the program's file, or in the file of its name next to it."""
    file = Path(str(module.__file__)).with_name(f"{name}.py")
    has_own_file = not hasattr(module, name) and source_files().is_file(file)
    return class_in(vars(library.load_program(str(file)) if has_own_file else module), name)
