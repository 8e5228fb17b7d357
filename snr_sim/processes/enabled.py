"""Enabled modules: classes of processes by the names of their files."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

from snr_sim.core.source_location import describe_error, short_path
from snr_sim.prelude.errors import ConfigError, suggest
from snr_sim.processes.rover_process import RoverProcess


def load_enabled(name: str, folder: Path) -> type[RoverProcess]:
    """Return the class with the name of its module, from a folder; the module can import others from there.

    Raises:
        ConfigError: there is no such module or class, or importing it raises.
    """
    path = folder.resolve() / f"{name}.py"
    if not path.is_file():
        known = [one.stem for one in folder.glob("*.py")]
        raise ConfigError(f"There is no module {name} in {short_path(str(folder))}.", fix=suggest(name, known))
    return class_in(load_file(path), name)


def load_file(path: Path) -> dict[str, object]:
    """Return the names in a Python file, which is imported by the name of the file.

    Raises:
        ConfigError: it is not a Python file, or importing it raises.
    """
    name, folder = path.stem, str(path.parent)
    if folder not in sys.path:
        sys.path.insert(0, folder)
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise ConfigError(f"{short_path(str(path))} is not a Python file.", fix="a file whose name ends with .py.")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # first, as a class looks up its module
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        del sys.modules[name]
        raise ConfigError(describe_error(error, f"while {short_path(str(path))} was imported")) from error
    return vars(module)


def class_in(names: dict[str, object], name: str) -> type[RoverProcess]:
    """Return the class of a process by its name.

    Raises:
        ConfigError: there is none of that name.
    """
    found = names.get(name)
    if isinstance(found, type) and issubclass(found, RoverProcess):
        return found
    known = [one.__name__ for one in names.values() if isinstance(one, type) and issubclass(one, RoverProcess)]
    what = "no class" if found is None else "no RoverProcess"
    raise ConfigError(
        f"{short_path(str(names['__file__']))} has {what} named {name}.",
        fix=suggest(name, [one for one in known if one != RoverProcess.__name__]),
    )
