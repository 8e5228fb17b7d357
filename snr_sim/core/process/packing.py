"""Factories on their way into another process: packed here, unpacked there, and said in words where that cannot be.

Only this way: a process gets objects from who started it, and sends back nothing but plain values. Code goes as the
source of its files: also of those that were loaded by path, such as a robot's, of the student's files around them that
are loaded too, and of the program itself. So the process runs what its node runs, as exactly as `source_of` knows it.
An open socket or pipe goes as its descriptor, which the process must be given when it is started (`Spawned`).
"""

from __future__ import annotations

import importlib
import importlib.util
import io
import linecache
import os
import pickle
import socket
import sys
from collections.abc import Iterator, Mapping, Sequence
from importlib.abc import MetaPathFinder, SourceLoader
from importlib.machinery import ModuleSpec
from multiprocessing.connection import Connection
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

from snr_sim.core.blame import is_student_file, short_path
from snr_sim.core.process import spawned
from snr_sim.core.reload.sources import file_of, source_of
from snr_sim.prelude.errors import ConfigError, SnrError

_MAIN = "__main__"
_MAIN_THERE = "__main_of_parent__"  # not "__main__", so that what stands under `if __name__ == ...` does not run
# Of the files around those that are needed: far more than a course's robots have, and sent in a few milliseconds.
_NEIGHBOURS_MAX_BYTES = 4_000_000


def pack(thing: Any, name: str, user: str) -> dict[str, Any]:
    """Returns plain values that `unpack` makes the same object of, in another process.

    That process has to be started with the file descriptors in "descriptors", under the same numbers.

    Args:
        thing: a factory, or several.
        name: its name in words, such as "VisionFactory".
        user: who needs it, such as "loop 'vision'".

    Raises:
        ConfigError: it cannot go there; names the attribute, and what to do.
    """
    try:
        packer = _dump(thing)
    except SnrError as error:  # it refuses by itself
        raise ConfigError(f"{user} runs in a process of its own. {error.message}", fix=error.fix) from error
    except Exception as error:  # a student's __reduce__ may raise anything
        where, what = _culprit(thing, error)
        raise ConfigError(
            f"{user} runs in a process of its own, and {name}{where} cannot be sent there: {what}.",
            fix=_fix(what),
        ) from error
    main, modules = sys.modules[_MAIN], list(packer.modules)
    if _MAIN in modules and not getattr(main, "__file__", None):
        raise ConfigError(
            f"{user} runs in a process of its own, and {name} is defined where no file is: at a prompt, in a notebook.",
            fix="put its class into a file, and import it from there.",
        )
    return {
        "pickle": packer.data.getvalue(),
        "descriptors": packer.descriptors,
        "modules": _neighbours(modules) | {module: place for name in modules for module, place in _places(name)},
        "main": [getattr(main.__spec__, "name", None), *_file_and_source(main)] if _MAIN in modules else None,
        "argv": sys.argv,
    }


def unpack(packed: Mapping[str, Any]) -> Any:
    """Returns the object that was packed.

    Raises:
        Exception: whatever the files it comes from raise when they are read here.
    """
    sys.argv[:] = packed["argv"]
    sys.meta_path.insert(0, _PackedFinder(packed["modules"]))
    if packed["main"] is not None:
        _read_main(*packed["main"])
    return _Unpacker(io.BytesIO(packed["pickle"])).load()


class _Packer(pickle.Pickler):
    """Sends modules by name, and takes down whose classes and functions, and which descriptors, are needed."""

    def __init__(self) -> None:
        self.data = io.BytesIO()
        super().__init__(self.data)
        self.modules: dict[str, None] = {}
        self.descriptors: list[int] = []

    def persistent_id(self, obj: Any) -> tuple[Any, ...] | None:
        """Returns how `_Unpacker` finds a module, a socket or a pipe; None for all else."""
        if isinstance(obj, ModuleType):
            self.modules[obj.__name__] = None
            return "module", obj.__name__
        if type(obj) is socket.socket:
            self.descriptors.append(obj.fileno())
            return "socket", obj.fileno()
        if isinstance(obj, Connection):  # pickle would send the bare number, which means another file there
            self.descriptors.append(obj.fileno())
            return "pipe", obj.fileno(), obj.readable, obj.writable
        return None

    def reducer_override(self, obj: Any) -> Any:
        """Takes down the module of a class or function."""
        if isinstance(obj, (type, FunctionType)) and isinstance(obj.__module__, str):
            self.modules[obj.__module__] = None
        return NotImplemented


class _Unpacker(pickle.Unpickler):
    def persistent_load(self, pid: Any) -> ModuleType | socket.socket | Connection:
        """Returns the module of that name, or the socket or pipe of that descriptor."""
        kind, name, *flags = pid
        if kind == "module":
            return importlib.import_module(name)
        os.set_inheritable(name, False)
        return socket.socket(fileno=name) if kind == "socket" else Connection(name, *flags)


def _dump(thing: Any) -> _Packer:
    packer = _Packer()
    packer.dump(thing)
    return packer


def _places(name: str) -> Iterator[tuple[str, list[Any]]]:
    """Yields a module and the packages it is in, each with its file and the folders of its submodules."""
    parts = name.split(".")
    if parts[0] in ("snr_sim", _MAIN) or parts[0] in sys.stdlib_module_names:
        return
    for end in range(1, len(parts) + 1):
        part = ".".join(parts[:end])
        module = sys.modules.get(part)
        file, folders = getattr(module, "__file__", None), getattr(module, "__path__", None)
        if module is not None and (folders is not None if file is None else file.endswith(".py")):
            yield part, [*_file_and_source(module), None if folders is None else list(folders)]


def _neighbours(names: Sequence[str]) -> dict[str, list[Any]]:
    """Returns the places of a student's loaded modules in the folders of those that are needed, and beneath them.

    The ones that are needed may import them, and the process is not to read a file that is just being written.
    """
    folders = tuple({f"{folder}{os.sep}" for name in names for folder in _folders(name)})
    found: dict[str, list[Any]] = {}
    left_bytes = _NEIGHBOURS_MAX_BYTES
    for name, module in list(sys.modules.items()):
        file = file_of(module) if isinstance(module, ModuleType) else None
        if file is None or not str(file).startswith(folders) or not is_student_file(str(file)):
            continue
        new = {part: place for part, place in _places(name) if part not in found}
        left_bytes -= sum(len(source or b"") for _, source, _ in new.values())
        if left_bytes < 0:
            break
        found |= new
    return found


def _folders(name: str) -> Iterator[Path]:
    """Yields the folders that a student's module, and the packages it is in, stand in; of any other module none."""
    parts = name.split(".")
    module = sys.modules.get(name)
    file = None if module is None else file_of(module)
    if file is None or not is_student_file(str(file)):
        return
    yield file.parent
    for end in range(1, len(parts)):
        yield from map(Path, getattr(sys.modules.get(".".join(parts[:end])), "__path__", ()))


def _file_and_source(module: ModuleType) -> tuple[str | None, bytes | None]:
    file = getattr(module, "__file__", None)
    try:
        return file, None if file is None else source_of(module)
    except OSError:  # it is gone, and was never read by us: the process says so
        return file, None


class _PackedLoader(SourceLoader):
    """Loads a module from source that came along."""

    def __init__(self, file: str, source: bytes) -> None:
        self._file = file
        self._source = source

    def get_filename(self, fullname: str) -> str:
        """Returns the file's path."""
        return self._file

    def get_data(self, path: str) -> bytes:
        """Returns the source; there is nothing else."""
        if path != self._file:
            raise OSError(f"{path} did not come along")
        return self._source

    def exec_module(self, module: ModuleType) -> None:
        """Executes the module; a message about it shows the line that came along, not what stands in the file now."""
        lines = importlib.util.decode_source(self._source).splitlines(keepends=True)
        linecache.cache[self._file] = (len(self._source), None, lines, self._file)
        super().exec_module(module)


class _PackedFinder(MetaPathFinder):
    """Finds each module where the other process has it from, whatever else may have its name."""

    def __init__(self, places: Mapping[str, Sequence[Any]]) -> None:
        self._places = places

    def find_spec(self, fullname: str, path: Any, target: Any = None) -> ModuleSpec | None:
        """Returns the spec of a module that was packed."""
        if fullname not in self._places:
            return None
        file, source, folders = self._places[fullname]
        if file is not None:
            return _spec_of(fullname, file, source, folders)
        spec = ModuleSpec(fullname, None, is_package=True)
        spec.submodule_search_locations = folders
        return spec


def _spec_of(name: str, file: str, source: bytes | None, folders: Any = None) -> ModuleSpec | None:
    loader = None if source is None else _PackedLoader(file, source)
    return importlib.util.spec_from_file_location(name, file, loader=loader, submodule_search_locations=folders)


def _read_main(name: str | None, file: str, source: bytes | None) -> None:
    """Reads the program that the other process is running, without what stands under `if __name__ == "__main__"`."""
    spawned.is_reading_main = True
    try:
        if name is not None:  # python -m name
            sys.modules[_MAIN] = importlib.import_module(name)
            return
        spec = _spec_of(_MAIN_THERE, file, source)
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        sys.modules[_MAIN] = sys.modules[_MAIN_THERE] = module
        spec.loader.exec_module(module)
    finally:
        spawned.is_reading_main = False


def _culprit(thing: Any, error: Exception) -> tuple[str, str]:
    """Returns the way to the innermost part that cannot be sent, such as "'s attribute `on_tick`", and what it is."""
    way, seen = "", {id(thing)}
    while True:
        for step, part in _parts(thing):
            if id(part) in seen:  # it refers to what it is part of
                continue
            try:
                _dump(part)
            except Exception as its_error:
                way, thing, error = way + step, part, its_error
                seen.add(id(part))
                break
        else:
            return (f"'s attribute `{way.lstrip('.')}`" if way else ""), _description(thing, error)


def _parts(thing: Any) -> Iterator[tuple[str, Any]]:
    if isinstance(thing, dict):
        yield from ((f"[{key!r}]", value) for key, value in thing.items())
    elif isinstance(thing, (list, tuple, set, frozenset)):
        yield from ((f"[{place}]", value) for place, value in enumerate(thing))
    elif not isinstance(thing, (type, FunctionType, ModuleType)):
        yield from ((f".{name}", value) for name, value in getattr(thing, "__dict__", {}).items())


def _description(thing: Any, error: Exception) -> str:
    if isinstance(thing, FunctionType):
        place = f"{short_path(thing.__code__.co_filename)}, line {thing.__code__.co_firstlineno}"
        return f"a lambda ({place})" if thing.__name__ == "<lambda>" else f"a function inside another one ({place})"
    if "<locals>" in type(thing).__qualname__:
        return f"its class {type(thing).__name__} is defined inside a function"
    return f"{type(thing).__name__} ({error})"


def _fix(what: str) -> str:
    if "inside" in what or "lambda" in what:
        return "define it with def or class at the top level of a file: a process finds code by its name."
    return "open files, ports and cameras in the loop's setup(): that runs in the process. Keep their names here."
