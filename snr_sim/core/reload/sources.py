"""The files that a component's code stands in, and how one is read anew: compiled first, and undone if need be."""

from __future__ import annotations

import ast
import hashlib
import linecache
import sys
from contextlib import suppress
from contextvars import ContextVar
from importlib.machinery import ModuleSpec
from importlib.util import decode_source
from pathlib import Path
from types import FunctionType, ModuleType
from weakref import WeakKeyDictionary

from snr_sim.core.blame import is_student_file
from snr_sim.core.component import ComponentFactory, NodeComponent
from snr_sim.core.reload.source_files import source_files
from snr_sim.prelude.errors import ConfigError

# What stood in a module's file when somebody first asked, or at its last reload: a process that begins later runs the
# code that its node runs, and not what somebody is just writing. Beside it the module's spec: `importlib.reload`, as
# in a notebook, gives the module another one, and then its code is another, too.
_sources: WeakKeyDictionary[ModuleType, tuple[ModuleSpec | None, bytes]] = WeakKeyDictionary()

# The file that is read anew at this moment: a robot's program must not start its node a second time from there.
being_read: ContextVar[str] = ContextVar("being_read", default="")


def modules_of(factory: ComponentFactory, component: NodeComponent) -> list[ModuleType]:
    """Return the modules to read anew for a component, those that others build on first.

    They are the factory's `reload_targets`; if it has none, the student's own files that define the classes of
    component and factory.

    Raises:
        ConfigError: a target is no module, or a module that has no file.
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
    """Return the Python file of a module, or None if it has none; it need not be there any more."""
    file = getattr(module, "__file__", None)
    return Path(file) if isinstance(file, str) and file.endswith(".py") else None


def source_of(module: ModuleType) -> bytes:
    """Return the source of the code that a module has; it has a file.

    At the first call, and at the first one after Python has imported the module again, that is what stands in the file
    now: Python does not keep what it has read. From then on it is the same text, until a reload has read another.

    Raises:
        OSError: the file is gone.
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


class Reading:
    """A module's file, read anew. Nothing has changed until `execute`, and `undo` takes that back.

    Args:
        module: has a file.

    Raises:
        ConfigError: the file is gone.
    """

    def __init__(self, module: ModuleType) -> None:
        path = file_of(module)
        assert path is not None
        try:
            source = source_files().read(path)
        except OSError as error:
            raise ConfigError(f"The file {path} cannot be read again: {error.strerror}.") from error
        _show(path, source)  # a message about the new code shows the new line
        self.module = module
        self._source = source
        self._source_before = _sources.get(module)
        self.name = "/".join(path.parts[-2:])  # the same from whatever folder a replay is started
        self.sha256 = hashlib.sha256(source).hexdigest()
        self._before: dict[str, object] | None = None  # once it is executed

    def execute(self) -> None:
        """Execute the new code in the module, as Python does at the first import. Raises what that raises."""
        path = str(self.module.__file__)
        source_files().check(Path(path), self._source)
        tree = ast.parse(self._source, path)
        if self.module.__name__ == "__main__":
            tree = ast.fix_missing_locations(_NotMain().visit(tree))
        code = compile(tree, path, "exec", dont_inherit=True)
        namespace = vars(self.module)
        before = self._before = dict(namespace)
        _sources[self.module] = self.module.__spec__, self._source
        token = being_read.set(self.name)
        try:
            exec(code, namespace)
        finally:
            being_read.reset(token)
        if self.module.__name__ != "__main__":
            self._forget_what_is_gone(before)

    def _forget_what_is_gone(self, before: dict[str, object]) -> None:
        """Take out functions and classes that the new code no longer defines, so that no call finds them by luck."""
        namespace = vars(self.module)
        for name, value in before.items():
            is_ours = isinstance(value, (FunctionType, type)) and value.__module__ == self.module.__name__
            if is_ours and namespace.get(name) is value:
                del namespace[name]

    def undo(self) -> None:
        """Put the module back as it was. A thread may be in its code: no name is missing in between."""
        if self._before is None:
            return
        if self._source_before is not None:
            _sources[self.module] = self._source_before
        else:
            _sources.pop(self.module, None)  # what was undone is not what runs
        namespace = vars(self.module)
        for name in [name for name in namespace if name not in self._before]:
            del namespace[name]
        namespace.update(self._before)


def show_source_in_use(module: ModuleType) -> None:
    """Have messages show the lines of the code that a module has, whatever stands in its file; none, if not known."""
    _, source = _sources.get(module, (None, b""))
    _show(Path(str(module.__file__)), source)


def _show(path: Path, source: bytes) -> None:
    """Have messages show the lines of this source, until the file changes; none, if it is not known."""
    lines: list[str] = []
    with suppress(SyntaxError, UnicodeDecodeError):  # whoever compiles it says so
        lines = decode_source(source).splitlines(keepends=True)
    size, time_s = len(source), None
    with suppress(OSError):  # in a replay there need not be a file
        size, time_s = path.stat().st_size, path.stat().st_mtime
    linecache.cache[str(path)] = size, time_s, lines, str(path)


class _NotMain(ast.NodeTransformer):
    """Has `__name__ == "__main__"` be false: the part of a program that starts it is not executed again."""

    def visit_Compare(self, node: ast.Compare) -> ast.expr:
        match node:
            case ast.Compare(ast.Name("__name__"), [ast.Eq()], [ast.Constant("__main__")]) | ast.Compare(
                ast.Constant("__main__"), [ast.Eq()], [ast.Name("__name__")]
            ):
                return ast.copy_location(ast.Constant(False), node)
        return node
