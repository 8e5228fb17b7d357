"""Pickling of factories for another process: packed here, unpacked there, with an error that names what cannot be sent.

Objects go in one direction only: from the parent process to the child, which sends back plain values. Definitions of
the program itself, in a file, a notebook or at a prompt, are sent as code by cloudpickle. The student's other files are
sent as the source that was loaded, with the files around them. So the process runs the same code as its node, as
exactly as `source_of` knows it. An open socket or pipe is sent as its descriptor, which the process has to inherit
when it is started.

A student's other files are not sent by value: an import inside a function would find no module.
"""

from __future__ import annotations

import importlib.abc
import importlib.util
import inspect
import io
import linecache
import os
import pickle
import socket
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from importlib.machinery import ModuleSpec
from multiprocessing.connection import Connection
from types import CodeType, FunctionType, ModuleType
from typing import Any

import cloudpickle
import msgspec

from snr_sim.core.process import spawned
from snr_sim.core.reload.sources import file_of, source_of
from snr_sim.core.source_location import is_student_file
from snr_sim.prelude.errors import ConfigError, SnrError

_MAIN = "__main__"
_PARTS_OF_STRUCT = ("__module__", "__qualname__", "__doc__", "__annotations__", "__post_init__")
# Limit for the files around the needed ones: far more than a course's robots have, and sent in a few milliseconds.
_MAX_NEIGHBOURS_BYTES = 4_000_000


def pickle_factory(thing: Any, name: str, user: str) -> dict[str, Any]:
    """Return plain values from which `unpickle_factory` creates the same object in another process.

    That process has to be started with the file descriptors in "descriptors", under the same numbers.

    Args:
        thing: a factory, or several.
        name: its name in messages, such as "VisionFactory".
        user: the component or role that needs it, such as "Loop 'vision'".

    Raises:
        ConfigError: it cannot be sent; the message names the attribute and a fix.
    """
    try:
        pickler = _Pickler(thing)
    except SnrError as error:  # the object itself raises it
        raise ConfigError(f"{user} runs in a process of its own. {error.message}", fix=error.fix) from error
    except Exception as error:  # a student's __reduce__ may raise anything
        where, what = _find_unpicklable(thing, error)
        raise ConfigError(
            f"{user} runs in a process of its own, and {name}{where} cannot be sent there: {what}.",
            fix="open files, ports and cameras in the loop's setup(): that runs in the process. Keep their names here.",
        ) from error
    return {
        "pickle": pickler.data.getvalue(),
        "descriptors": pickler.descriptors,
        "modules": _sources(pickler.modules),
        "lines": {file: linecache.getlines(file) for file in pickler.files},
        "argv": sys.argv,
    }


def unpickle_factory(packed: Mapping[str, Any]) -> Any:
    """Return the object that was packed.

    Raises:
        Exception: any exception of its files when they are imported here.
    """
    sys.argv[:] = packed["argv"]
    sys.meta_path.insert(0, _SentModules(packed["modules"]))
    for file, lines in packed["lines"].items():
        _show(file, lines)
    spawned.is_reading_program = True
    try:
        return pickle.loads(packed["pickle"])
    finally:
        spawned.is_reading_program = False


class _Pickler(cloudpickle.Pickler):  # type: ignore[misc] # it has no types
    """Pickler of one object that also records the modules, code files and descriptors that the process needs."""

    def __init__(self, thing: Any) -> None:
        self.data: io.BytesIO = io.BytesIO()
        super().__init__(self.data)
        self.modules: dict[str, None] = {}
        self.files: dict[str, None] = {}
        self.descriptors: list[int] = []
        self.dump(thing)

    def reducer_override(self, obj: Any) -> Any:
        """Return the reduced form of an object, or NotImplemented if pickle handles it itself."""
        if isinstance(obj, ModuleType):
            self.modules[obj.__name__] = None
        elif isinstance(obj, (type, FunctionType)) and isinstance(obj.__module__, str):
            self.modules[obj.__module__] = None
            if isinstance(obj, FunctionType) and obj.__module__ == _MAIN:
                self.files[obj.__code__.co_filename] = None
            elif obj.__module__ == _MAIN and isinstance(obj, msgspec.StructMeta):
                return _reduce_struct(obj)
        elif isinstance(obj, CodeType):
            make, parts = self.dispatch_table[CodeType](obj)
            return _code, (obj.co_filename, make, parts)
        elif type(obj) is socket.socket:
            self.descriptors.append(obj.fileno())
            return _inherited, (obj.fileno(),)
        elif isinstance(obj, Connection):  # pickle would send the bare number, which is another file there
            self.descriptors.append(obj.fileno())
            return _inherited, (obj.fileno(), obj.readable, obj.writable)
        return super().reducer_override(obj)


def _code(file: str, make: Callable[..., CodeType], parts: tuple[Any, ...]) -> CodeType:
    """Return code with the file it was written in; cloudpickle 3.1.3 gives all code the same name."""
    return make(*parts).replace(co_filename=file)


def _inherited(descriptor: int, *directions: bool) -> socket.socket | Connection:
    """Return an open pipe, which can be read, written or both, or else a socket."""
    os.set_inheritable(descriptor, False)
    return Connection(descriptor, *directions) if directions else socket.socket(fileno=descriptor)


def _reduce_struct(kind: Any) -> tuple[Any, ...]:
    """Return the reduced form of a msgspec Struct; cloudpickle 3.1 recreates it without its fields."""
    config = kind.__struct_config__
    options = {name: getattr(config, name) for name in dir(config) if name[0] != "_"}
    own = [field for field in msgspec.structs.fields(kind) if field.name in kind.__annotations__]
    options["kw_only"] = any(field.name not in kind.__match_args__ for field in own)
    members = {
        name: value
        for name, value in vars(kind).items()
        if not (name == "__slots__" or inspect.ismemberdescriptor(value) or inspect.isgetsetdescriptor(value))
    }
    namespace = {name: members.pop(name) for name in _PARTS_OF_STRUCT if name in members}
    for field in own:
        given = {key: getattr(field, key) for key in ("default", "default_factory")}
        given["name"] = field.encode_name
        namespace[field.name] = partial(msgspec.field, **{k: v for k, v in given.items() if v is not msgspec.NODEFAULT})
    # msgspec resolves names in annotations in the class's module, which the process does not have.
    members["__annotations__"] = kind.__annotations__ | {field.name: field.type for field in own}
    made_of = (type(kind), kind.__name__, kind.__bases__, namespace, options)
    return _struct, made_of, members, None, None, _set_members


def _struct(meta: Any, name: str, bases: tuple[type, ...], namespace: dict[str, Any], options: dict[str, Any]) -> Any:
    made = {key: value() if isinstance(value, partial) else value for key, value in namespace.items()}
    return meta(name, bases, made, **options)


def _set_members(kind: type, members: dict[str, Any]) -> None:
    """Add methods to a class that exists already, as they may refer to it."""
    for name, value in members.items():
        setattr(kind, name, value)


def _sources(needed: Iterable[str]) -> dict[str, list[Any]]:
    """Return file, source and folders of submodules of each module that the process cannot read itself, by name.

    These are the needed modules except Python's and snr_sim's, and the student's loaded modules in the same folders and
    below: the needed ones may import those, and the process must not read a file while it is being written.
    """
    needed = [name for name in needed if name in sys.modules]
    folders = tuple({f"{folder}{os.sep}" for name in needed for folder in _folders(name)})
    found = {name: _source(name) for name in _with_packages(needed)}
    left_bytes = _MAX_NEIGHBOURS_BYTES
    for name, module in list(sys.modules.items()):
        file = file_of(module) if isinstance(module, ModuleType) else None
        if file is not None and str(file).startswith(folders) and is_student_file(str(file)):
            new = {part: _source(part) for part in _with_packages([name]) if part not in found}
            left_bytes -= sum(len(source or b"") for _, source, _ in new.values())
            if left_bytes < 0:
                break
            found |= new
    return found


def _with_packages(names: Iterable[str]) -> Iterator[str]:
    """Yield modules and the packages that they are in, except those that every process has."""
    for name in names:
        parts = name.split(".")
        if parts[0] in ("snr_sim", _MAIN) or parts[0] in sys.stdlib_module_names:
            continue
        for end in range(1, len(parts) + 1):
            module = sys.modules.get(".".join(parts[:end]))
            file = getattr(module, "__file__", None)
            if hasattr(module, "__path__") if file is None else file.endswith(".py"):
                yield ".".join(parts[:end])


def _folders(name: str) -> list[str]:
    """Return the folders of a student's module and of its outermost package; none for any other module."""
    file = file_of(sys.modules[name])
    if file is None or not is_student_file(str(file)):
        return []
    return [str(file.parent), *getattr(sys.modules.get(name.partition(".")[0]), "__path__", ())]


def _source(name: str) -> list[Any]:
    module = sys.modules[name]
    file, folders = getattr(module, "__file__", None), getattr(module, "__path__", None)
    try:
        source = None if file is None else source_of(module)
    except OSError:  # it was deleted before this process read it: the other process reports it
        source = None
    return [file, source, None if folders is None else list(folders)]


class _SentModules(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Finder of the modules that `_sources` returned: they take precedence over others of the same name."""

    def __init__(self, modules: Mapping[str, Sequence[Any]]) -> None:
        self._modules = modules

    def find_spec(self, fullname: str, path: Any, target: Any = None) -> ModuleSpec | None:
        """Return the spec of a module that was sent."""
        if fullname not in self._modules:
            return None
        file, source, folders = self._modules[fullname]
        if file is None:
            spec = ModuleSpec(fullname, None, is_package=True)
            spec.submodule_search_locations = folders
            return spec
        loader = None if source is None else self
        return importlib.util.spec_from_file_location(fullname, file, loader=loader, submodule_search_locations=folders)

    def exec_module(self, module: ModuleType) -> None:
        """Execute a module; tracebacks show the source that was sent, not the file's present content."""
        file, source, _ = self._modules[module.__name__]
        _show(file, importlib.util.decode_source(source).splitlines(keepends=True))
        exec(compile(source, file, "exec", dont_inherit=True), module.__dict__)


def _show(file: str, lines: list[str]) -> None:
    linecache.cache[file] = (sum(map(len, lines)), None, lines, file)


def _find_unpicklable(thing: Any, error: Exception) -> tuple[str, str]:
    """Return the path to the innermost part that cannot be sent, such as "'s attribute `on_tick`", and its type."""
    path, seen = "", {id(thing)}
    while True:
        for step, part in _parts(thing):
            if id(part) in seen:  # a reference cycle
                continue
            try:
                _Pickler(part)
            except Exception as its_error:
                path, thing, error = path + step, part, its_error
                seen.add(id(part))
                break
        else:
            return (f"'s attribute `{path.lstrip('.')}`" if path else ""), f"{type(thing).__name__} ({error})"


def _parts(thing: Any) -> Iterator[tuple[str, Any]]:
    if isinstance(thing, dict):
        yield from ((f"[{key!r}]", value) for key, value in thing.items())
    elif isinstance(thing, (list, tuple, set, frozenset)):
        yield from ((f"[{index}]", value) for index, value in enumerate(thing))
    elif isinstance(thing, FunctionType):
        names = inspect.getclosurevars(thing)
        yield from ((f".{name}", value) for name, value in {**names.globals, **names.nonlocals}.items())
    elif not isinstance(thing, ModuleType):
        yield from ((f".{name}", value) for name, value in getattr(thing, "__dict__", {}).items())
        if not isinstance(thing, type):
            yield "", type(thing)
