"""Source files of a component, and how one is reloaded: compiled first, and undone if a later step fails."""

from __future__ import annotations

import ast
import hashlib
import linecache
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from importlib.machinery import ModuleSpec
from importlib.util import decode_source
from pathlib import Path
from types import FunctionType, ModuleType
from weakref import WeakKeyDictionary

from snr_sim.core.component import NodeComponent
from snr_sim.core.factory import ComponentFactory
from snr_sim.core.source_location import is_student_file
from snr_sim.prelude.errors import ConfigError

SUFFIXES = (".py", ".lrp")  # of programs: Python, and state machines in text


class SourceFiles:
    """Files on the disk; `reading_from` replaces them by others."""

    @property
    def recorded(self) -> Sequence[Path]:
        """Paths of files that are not read from the disk."""
        return ()

    def is_file(self, path: Path) -> bool:
        """Return whether the file exists."""
        return path.is_file()

    def is_dir(self, path: Path) -> bool:
        """Return whether the folder exists."""
        return path.is_dir()

    def in_folder(self, folder: Path) -> list[Path]:
        """Return the programs in a folder, in order; none if it does not exist."""
        return sorted(path for path in folder.glob("*") if path.suffix in SUFFIXES)

    def read(self, path: Path) -> bytes:
        """Return the content of a file; raise an OSError if it cannot be read."""
        return path.read_bytes()

    def check(self, path: Path, source: bytes) -> None:
        """Raise a SyntaxError that shows the line of this source; Python itself would show the line on the disk."""

    def begin_node(self) -> None:
        """Set the files to their content at the start of the run, if it was recorded."""

    def begin_task(self, seq: int) -> None:
        """Set the files to their content at a recorded task, if it was recorded."""

    def close(self) -> None:
        """Release resources needed only for reading files."""


_files = SourceFiles()  # per process, not per context: a student's threads import as well


def source_files() -> SourceFiles:
    """Return the present source of files."""
    return _files


@contextmanager
def reading_from(files: SourceFiles) -> Iterator[None]:
    """Read source files from `files` while active."""
    global _files
    before, _files = _files, files
    try:
        yield
    finally:
        _files = before
        files.close()


# Content of a module's file at the first request or the last reload: a process that begins later runs the code of its
# node, and not a file that is being edited. Stored with the module's spec: `importlib.reload`, as in a notebook, gives
# the module a new spec, and then its code is new too.
_sources: WeakKeyDictionary[ModuleType, tuple[ModuleSpec | None, bytes]] = WeakKeyDictionary()

# The file that is being reloaded: the execution of a robot's program must not start its node a second time.
reloading_file: ContextVar[str] = ContextVar("reloading_file", default="")


def modules_of(factory: ComponentFactory, component: NodeComponent) -> list[ModuleType]:
    """Return the modules to reload for a component, dependencies first.

    They are the factory's `reload_targets`; if it has none, the student's own files that define the classes of
    component and factory.

    Raises:
        ConfigError: a target is not a module, or is a module without a file.
    """
    if factory.reload_targets:
        for target in factory.reload_targets:
            _check_target(type(factory).__name__, target)
        return list(dict.fromkeys(factory.reload_targets))
    found: list[ModuleType] = []
    for kind in [*reversed(type(component).__mro__), *reversed(type(factory).__mro__)]:
        module = sys.modules.get(kind.__module__)
        if module is not None and module not in found and is_student_file(str(file_of(module) or "<none>")):
            found.append(module)
    return found


def file_of(module: ModuleType) -> Path | None:
    """Return the Python file of a module, or None if it has none; the file may have been deleted."""
    file = getattr(module, "__file__", None)
    return Path(file) if isinstance(file, str) and file.endswith(".py") else None


def source_of(module: ModuleType) -> bytes:
    """Return the source of a module's present code; the module must have a file.

    At the first call, and at the first call after Python has imported the module again, this is the file's present
    content, since Python does not keep the source. From then on it is the same text, until a reload reads another.

    Raises:
        OSError: the file does not exist any more.
    """
    spec, source = _sources.get(module, (None, None))
    if source is None or spec is not module.__spec__:
        path = module.__file__
        assert path is not None
        source = Path(path).read_bytes()
        _sources[module] = module.__spec__, source
    return source


def _check_target(factory: str, target: object) -> None:
    if not isinstance(target, ModuleType):
        raise ConfigError(
            f"The reload_targets of {factory} list {target!r}, which is not a module.",
            fix="import the module and list it itself: reload_targets=[mixer].",
        )
    path = file_of(target)
    if path is None or not source_files().is_file(path):
        where = f": there is no file {path}" if path is not None else ", as it was not read from a Python file"
        raise ConfigError(
            f"The reload target '{target.__name__}' of {factory} cannot be read again{where}.",
            fix="list modules of your own, whose files are still where they were imported from.",
        )


class ModuleReload:
    """A module's file, read again. The module is unchanged until `execute`, and `undo` restores it.

    Raises:
        ConfigError: the file does not exist any more.
    """

    def __init__(self, module: ModuleType) -> None:
        path = file_of(module)
        assert path is not None
        try:
            source = source_files().read(path)
        except OSError as error:
            raise ConfigError(f"The file {path} cannot be read again: {error.strerror}.") from error
        _show(path, source)  # tracebacks of the new code show the new line
        self.module: ModuleType = module
        self._source = source
        self._source_before = _sources.get(module)
        self.name: str = "/".join(path.parts[-2:])  # the same for every folder in which a replay is started
        self.sha256: str = hashlib.sha256(source).hexdigest()
        self._before: dict[str, object] | None = None  # once it is executed

    def execute(self) -> None:
        """Execute the new code in the module, as Python does at the first import; if it raises, undo that and raise."""
        path = str(self.module.__file__)
        source_files().check(Path(path), self._source)
        tree = ast.parse(decode_source(self._source), path)
        kept: set[str] = set()
        if self.module.__name__ == "__main__":
            kept = _defined_by_program(tree)
            tree = ast.fix_missing_locations(_NotMain().visit(tree))
        code = compile(tree, path, "exec", dont_inherit=True)
        namespace = vars(self.module)
        before = self._before = dict(namespace)
        _sources[self.module] = self.module.__spec__, self._source
        token = reloading_file.set(self.name)
        try:
            exec(code, namespace)
        except BaseException:
            self.undo()
            raise
        finally:
            reloading_file.reset(token)
        self._delete_removed({name: value for name, value in before.items() if name not in kept})

    def _delete_removed(self, before: dict[str, object]) -> None:
        """Delete functions and classes that the new code does not define any more, so that calls of them fail."""
        namespace = vars(self.module)
        for name, value in before.items():
            is_ours = isinstance(value, (FunctionType, type)) and value.__module__ == self.module.__name__
            if is_ours and namespace.get(name) is value:
                del namespace[name]

    def undo(self) -> None:
        """Restore the module. A thread may be executing its code, so each name exists at all times."""
        if self._before is None:
            return
        if self._source_before is not None:
            _sources[self.module] = self._source_before
        else:
            _sources.pop(self.module, None)  # the source that was undone is not the running one
        namespace = vars(self.module)
        for name in [name for name in namespace if name not in self._before]:
            del namespace[name]
        namespace.update(self._before)


def show_source_in_use(module: ModuleType) -> None:
    """Make tracebacks show the lines of a module's present code, not of its file; no lines if unknown."""
    _, source = _sources.get(module, (None, b""))
    _show(Path(str(module.__file__)), source)


def _show(path: Path, source: bytes) -> None:
    """Make tracebacks show the lines of this source until the file changes; no lines if it is unknown."""
    lines: list[str] = []
    with suppress(SyntaxError, UnicodeDecodeError):  # reported when the source is compiled
        lines = decode_source(source).splitlines(keepends=True)
    size, time_s = len(source), None
    with suppress(OSError):  # in a replay the file need not exist
        size, time_s = path.stat().st_size, path.stat().st_mtime
    linecache.cache[str(path)] = size, time_s, lines, str(path)


def _is_main(node: ast.AST) -> bool:
    """Return whether an expression compares `__name__` with "__main__"."""
    match node:
        case ast.Compare(ast.Name("__name__"), [ast.Eq()], [ast.Constant("__main__")]) | ast.Compare(
            ast.Constant("__main__"), [ast.Eq()], [ast.Name("__name__")]
        ):
            return True
    return False


def _defined_by_program(tree: ast.Module) -> set[str]:
    """Return the functions and classes that only a start as a program defines."""
    below = [one for one in tree.body if isinstance(one, ast.If) and any(map(_is_main, ast.walk(one.test)))]
    kinds = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)
    return {node.name for one in below for node in ast.walk(one) if isinstance(node, kinds)}


class _NotMain(ast.NodeTransformer):
    """Transformer that makes `__name__ == "__main__"` false, so that a reload does not start the program again."""

    def visit_Compare(self, node: ast.Compare) -> ast.expr:
        return ast.copy_location(ast.Constant(False), node) if _is_main(node) else node
