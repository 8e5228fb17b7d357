"""Find and load robots, scenarios and controllers: ordinary files that snr_sim loads by path.

Search order, of which the match is reported: a path; `./robots/<name>` (or `./scenarios/<name>.py`) under the current
folder; the folders in SNR_SIM_PATH; the copy that ships with snr_sim.

Files are read again at every load and no bytecode is written: the code that runs is the file's present content, even
directly after an edit. Objects of these modules cannot be unpickled in another process: processes start by (robot path,
role, io).
"""

from __future__ import annotations

import importlib
import importlib.util
import os
import sys
from collections import defaultdict
from collections.abc import Iterator, Sequence, Set
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from importlib.machinery import ModuleSpec, SourceFileLoader
from pathlib import Path
from types import CodeType, ModuleType
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from snr_sim.core.reload.sources import source_files
from snr_sim.core.source_location import describe_error, is_student_file, short_path
from snr_sim.prelude.errors import ConfigError, MissingExtraError, SnrError, UnknownNameError, suggest

if TYPE_CHECKING:
    from snr_sim.behaviors.bridge import Bridge

Kind: TypeAlias = Literal["robots", "scenarios", "assignments"]

ROBOT_MODULE = "snr_sim_robot_"
_CONTROLLER_MODULE = "snr_sim_controller_"
LRP = ".lrp"  # suffix of a controller that is a state machine in text
_PROGRAM_MODULE = "snr_sim_program_"
SCENARIO_MODULE = "snr_sim_scenario_"
_KIT = Path(__file__).resolve().parents[1]


@dataclass(frozen=True)
class FoundItem:
    """A robot's folder or a scenario's file, and where it was found."""

    kind: Kind
    name: str
    path: Path
    place: str


def find(kind: Kind, name: str) -> FoundItem:
    """Return where the robot or scenario `name` is.

    Raises:
        UnknownNameError: not found; the message lists the searched folders and the known names.
    """
    files = source_files()
    with suppress(OSError, ValueError):  # not a possible file name
        given = Path(name)
        if given.suffix or os.sep in name or files.is_file(given) or files.is_dir(given):
            path = given.resolve()
            if _is_one(kind, path):
                return FoundItem(kind, path.stem if kind == "scenarios" else path.name, path, "the path given")
        for place, folder in _places(kind):
            path = _path_in(kind, folder, name)
            if name and _is_one(kind, path):
                return FoundItem(kind, name, path, place)
    looked = ", ".join(dict.fromkeys(short_path(str(folder)) for _, folder in _places(kind)))
    raise UnknownNameError(
        f"There is no {kind[:-1]} '{name}'. Looked in: {looked}.",
        fix=suggest(name, [found.name for found in list_available(kind)]),
    )


def find_lab(name: str) -> FoundItem:
    """Return where a lab is, by its folder's name, by that without its number, or by a path.

    Raises:
        UnknownNameError: not found.
    """
    matches = [one.name for one in list_available("assignments") if name and name == one.name.partition("_")[2]]
    return find("assignments", matches[0] if len(matches) == 1 else name)


def list_available(kind: Kind) -> list[FoundItem]:
    """Return all items that can be found by name; of two with the same name the first."""
    all_found: dict[str, FoundItem] = {}
    for place, folder in _places(kind):
        for path in sorted(folder.iterdir()) if folder.is_dir() else []:
            name = path.stem if kind == "scenarios" else path.name
            if _is_one(kind, path):
                all_found.setdefault(name, FoundItem(kind, name, path, place))
    return sorted(all_found.values(), key=lambda found: found.name)


def _places(kind: Kind) -> Iterator[tuple[str, Path]]:
    for recorded in source_files().recorded:
        place = recorded.parent if kind == "scenarios" else recorded.parent.parent
        if place.name == kind:
            yield "the run folder", place
    yield "the current folder", Path.cwd() / kind
    for folder in filter(None, os.environ.get("SNR_SIM_PATH", "").split(os.pathsep)):
        yield "SNR_SIM_PATH", Path(folder).resolve() / kind
    yield "the kit", _content(kind)


def _content(kind: Kind) -> Path:
    checkout = _KIT.parent / kind
    return checkout if (_KIT.parent / "pyproject.toml").is_file() else _KIT / "shipped" / kind


def is_of_kit(path: Path) -> bool:
    """Return whether a file belongs to snr_sim: to its package, or to the robots, scenarios and labs it ships with."""
    kinds: tuple[Kind, ...] = ("robots", "scenarios", "assignments")
    path = Path(os.path.normpath(path))  # without ".."
    return any(path.is_relative_to(folder) for folder in (_KIT, *map(_content, kinds)))


def is_own(path: Path) -> bool:
    """Return whether a file is a user's own: not one of snr_sim, Python or an installed package."""
    return is_student_file(str(path)) and not is_of_kit(path.resolve())


def find_in_kit(kind: Kind, name: str) -> FoundItem | None:
    """Return the item that ships with snr_sim under this name, or None; paths are not accepted."""
    path = _path_in(kind, _content(kind), name)
    is_name = Path(name).name == name and name != ".."
    return FoundItem(kind, name, path, "the kit") if is_name and _is_one(kind, path) else None


def _path_in(kind: Kind, folder: Path, name: str) -> Path:
    return folder / f"{name}.py" if kind == "scenarios" else folder / name


def _is_one(kind: Kind, path: Path) -> bool:
    if kind == "robots":
        return source_files().is_file(path / "robot.py")
    if kind == "scenarios":
        return source_files().is_file(path) and path.suffix == ".py" and not path.name.startswith("_")
    return (path / "README.md").is_file()


def load_robot(found: FoundItem) -> ModuleType:
    """Load a robot's folder as the package `snr_sim_robot_<name>`, so that `from .mixer import mix` works in it.

    Raises:
        ConfigError: it cannot be loaded, or does not implement the robot interface (`prelude/scenario.py`).
    """
    name = _begin_robot(found.name)
    robot = _load(name, found.path / "robot.py", f"the robot '{found.name}'", package=found.path)
    _require(robot, found.path / "robot.py", ("ROLES", "IO", "roles"), "a robot")
    _require_names(robot, found.path / "robot.py", ("ROLES", "IO"))
    return robot


def name_robot(name: str, folder: Path) -> None:
    """Make a robot's folder importable as a package; its robot.py is executed at the first access to its content."""
    known = sys.modules.get(ROBOT_MODULE + name)
    if known is None or list(known.__path__) != [str(folder)]:
        sys.modules[_begin_robot(name)] = _LazyRobotModule(name, folder)


def _begin_robot(name: str) -> str:
    """Forget the modules of a robot of this name; return the name of its package."""
    package = ROBOT_MODULE + name
    _robots.begin(package)
    for loaded in [module for module in sys.modules if module == package or module.startswith(f"{package}.")]:
        del sys.modules[loaded]
    return package


class _LazyRobotModule(ModuleType):
    """A robot's package before its robot.py was executed."""

    def __init__(self, name: str, folder: Path) -> None:
        super().__init__(ROBOT_MODULE + name)
        self.__path__ = [str(folder)]
        self._found = FoundItem("robots", name, folder, "the path given")

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(load_robot(self._found), name)


def bridge_of_robot(name: str) -> Bridge:
    """Return the parts of a robot that LRP programs may name.

    Raises:
        UnknownNameError: there is no such robot.
        ConfigError: it has no parts for programs.
    """
    from snr_sim.scenario.machine_controller import bridge_of  # as below: few runs need it

    found = find("robots", name)
    name_robot(found.name, found.path)
    return bridge_of(ROBOT_MODULE + found.name)


def load_scenario(found: FoundItem) -> ModuleType:
    """Load a scenario's file; its robot must have been loaded before.

    Raises:
        ConfigError: it cannot be loaded, or does not implement the scenario interface (`prelude/scenario.py`).
    """
    scenario = _load(SCENARIO_MODULE + found.name, found.path, f"the scenario '{found.name}'")
    _require(
        scenario,
        found.path,
        ("ROBOT", "ENGINES", "CONTROLLER", "TIME_LIMIT_S", "parameters", "plant", "verdict", "metrics"),
        "a scenario",
    )
    _require_names(scenario, found.path, ("ENGINES",))
    limit_s = scenario.TIME_LIMIT_S
    if isinstance(limit_s, bool) or not isinstance(limit_s, (int, float)) or not limit_s > 0:
        raise ConfigError(
            f"{short_path(str(found.path))}: TIME_LIMIT_S is {limit_s!r}, not a number of seconds.",
            fix="TIME_LIMIT_S = 240.0.",
        )
    return scenario


def robot_of_scenario(found: FoundItem) -> str:
    """Return the name after `ROBOT =` in a scenario's file, without executing it: the robot is loaded first.

    Raises:
        ConfigError: the file has no such line.
    """
    try:
        source = source_files().read(found.path)
        source_files().check(found.path, source)
        robot, is_controller = _robot_in(source, str(found.path))
    except (SyntaxError, ValueError) as error:
        raise _load_failure(error, found.path, f"the scenario '{found.name}' was read") from error
    if robot is not None:
        return robot
    if is_controller:
        place = short_path(str(found.path))
        raise ConfigError(
            f"{place} is a controller, as it has factories(robot); a scenario's file says which robot it is for.",
            fix=f"name a scenario, and the controller by its option: snr run lander_vertical --controller ./{place}",
        )
    raise ConfigError(
        f"{short_path(str(found.path))} does not say which robot it is for.", fix="add: ROBOT = 'lander'."
    )


@lru_cache(maxsize=128)
def _robot_in(source: bytes, path: str) -> tuple[str | None, bool]:
    """Return the robot that a source names, if any, and whether it has a controller's `factories`."""
    import ast

    body = ast.parse(source, path).body
    for node in body:
        match node:
            case (
                ast.Assign(targets=[ast.Name(id="ROBOT")], value=ast.Constant(value=str(robot)))
                | ast.AnnAssign(target=ast.Name(id="ROBOT"), value=ast.Constant(value=str(robot)))
            ):
                return robot, False
    return None, any(isinstance(node, ast.FunctionDef) and node.name == "factories" for node in body)


def controllers(robot: FoundItem) -> list[str]:
    """Return the names of a robot's own controllers."""
    return sorted(path.stem for path in _controller_files(robot))


def _controller_files(robot: FoundItem) -> list[Path]:
    inside = source_files().in_folder(robot.path / "controllers")
    return [path for path in inside if path.stem[0] != "_"]


def controller_file(robot: FoundItem, name: str) -> Path:
    """Return the file of one of a robot's own controllers."""
    return next(path for path in _controller_files(robot) if path.stem == name)


def load_controller(robot: FoundItem, name: str) -> ModuleType:
    """Load a controller: one of the robot's own by name, or any file by path.

    Raises:
        UnknownNameError: there is no such controller.
        ConfigError: it cannot be loaded, or has no `factories`.
    """
    if name in controllers(robot):
        path = controller_file(robot, name)
        module = _load_one(f"{ROBOT_MODULE}{robot.name}.controllers.{name}", path, name, robot)
        _robots.loaded[ROBOT_MODULE + robot.name].add(path)
    else:
        path = Path(name).resolve()
        if not source_files().is_file(path):
            raise _no_controller(robot, name, path)
        _siblings.search_in(path.parent)
        module = _load_one(_CONTROLLER_MODULE + path.stem.replace("-", "_"), path, name, robot)
    _require(module, path, ("factories",), "a controller", "def factories(robot): return [MyEndpointFactory()].")
    if not callable(module.factories):
        raise ConfigError(
            f"{short_path(str(path))}: `factories` is {module.factories!r}, not a function.",
            fix="def factories(robot): return [MyEndpointFactory()].",
        )
    return module


def _load_one(module_name: str, path: Path, name: str, robot: FoundItem) -> ModuleType:
    """Load a controller's file: Python, or an LRP program."""
    if path.suffix != LRP:
        return _load(module_name, path, f"the controller '{name}'")
    from snr_sim.scenario.machine_controller import machine_controller  # few runs need it

    module = ModuleType(module_name)
    module.__file__ = str(path)
    machine_controller(module, ROBOT_MODULE + robot.name, load_program)
    sys.modules[module_name] = module
    return module


def _no_controller(robot: FoundItem, name: str, path: Path) -> UnknownNameError:
    """Return the error for a controller's name: it is unknown, a folder, or a file that does not exist."""
    its_own = f"by name, {suggest(name, controllers(robot))}"
    if path.is_dir():
        files = sorted(file.name for file in path.glob("*.py"))
        inside = f"a file in it: --controller {Path(name) / files[0]}. Or " if files else ""
        return UnknownNameError(f"The controller '{name}' is a folder, not a Python file.", fix=inside + its_own)
    if path.exists():
        return UnknownNameError(f"The controller '{name}' is not a file that can be read.", fix=its_own)
    if os.sep not in name and not path.suffix:
        return UnknownNameError(
            f"There is no controller '{name}': robot '{robot.name}' has none of that name.",
            fix=f"{suggest(name, controllers(robot))} Or a file: --controller ./mine.py.",
        )
    files = sorted(file.name for file in path.parent.glob("*.py")) if path.parent.is_dir() else []
    place = short_path(str(path.parent))
    elsewhere = "" if os.sep in name else f"name it with its folder: --controller FOLDER/{name}. Or "
    beside = f"{suggest(path.name, files, f'in {place} there are')} Or " if files else elsewhere
    missing = "" if path.parent.is_dir() else f", nor a folder {place}"
    return UnknownNameError(f"There is no file '{name}'{missing}.", fix=beside + its_own)


def load_program(name: str, fix: str = "name the program that was recorded: --with robot.py.") -> ModuleType:
    """Load a student's own file, without executing the part under `if __name__ == "__main__"`.

    Args:
        name: path of the file.
        fix: what to try if there is none.

    Raises:
        UnknownNameError: there is no such file.
        ConfigError: it cannot be loaded.
    """
    path = Path(name).resolve()
    if not name or not source_files().is_file(path):
        raise UnknownNameError(f"There is no file '{name}'.", fix=fix)
    _siblings.search_in(path.parent)
    return _load(_PROGRAM_MODULE + path.stem.replace("-", "_"), path, f"the program '{name}'")


@dataclass(frozen=True)
class UsedSources:
    """The files of a scenario, robot or controller that are in use, by a label and their path below a folder."""

    label: str
    folder: Path
    file: Path
    imported: Set[Path] = frozenset()  # it grows until the module that imports it is loaded again


def used_sources(scenario: FoundItem, robot: FoundItem, controller: ModuleType) -> list[UsedSources]:
    """Return the files loaded for a simulation, with the robot and the controller last loaded under these names.

    Files that this process has loaded before or loads later, under another name or for another simulation, are not
    included: the same request gives the same files in every process.
    """
    file = Path(str(controller.__file__))
    beside = _siblings.loaded if controller.__name__.startswith(_CONTROLLER_MODULE) else frozenset()
    return [
        UsedSources("scenario", scenario.path.parent, scenario.path),
        UsedSources("robot", robot.path, robot.path / "robot.py", _robots.loaded[ROBOT_MODULE + robot.name]),
        UsedSources("controller", file.parent, file, beside),
    ]


OPTION_FILE = "option/"  # prefix of the key of an option that names a file


def files_in_use(used: Sequence[UsedSources]) -> dict[str, Path]:
    """Return every file in use, by `<label>/<path below its folder>`."""
    return {
        f"{one.label}/{path.relative_to(one.folder).as_posix()}": path
        for one in used
        for path in {one.file, *one.imported}
    }


def _require(module: ModuleType, path: Path, names: Sequence[str], what: str, fix: str = "") -> None:
    for name in names:
        if not hasattr(module, name):
            has = [known for known in vars(module) if not known.startswith("_")]
            close = suggest(name, has)
            lack = "is empty: it has" if not has and not source_files().read(path).strip() else "has"
            raise ConfigError(
                f"{short_path(str(path))} {lack} no `{name}`, which {what} needs.",
                fix=fix or (close if close.startswith("did") else f"see prelude/scenario.py for what {what} defines."),
            )


def _require_names(module: ModuleType, path: Path, lists: Sequence[str]) -> None:
    for name in lists:
        names = getattr(module, name)
        if not (isinstance(names, (tuple, list)) and names and all(isinstance(one, str) for one in names)):
            raise ConfigError(
                f"{short_path(str(path))}: {name} is {names!r}, not a tuple of names.",
                fix=f'{name} = ("one",), with the comma, or {name} = ("one", "two").',
            )


def _spec(name: str, path: Path, package: Path | None = None) -> ModuleSpec:
    """Return the spec of a file as a module, or of one that is the package of a folder."""
    where = [str(package)] if package else None
    loader = _FreshLoader(name, str(path))
    spec = importlib.util.spec_from_file_location(name, path, loader=loader, submodule_search_locations=where)
    assert spec is not None
    return spec


def _load(name: str, path: Path, what: str, package: Path | None = None) -> ModuleType:
    spec = _spec(name, path, package)
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except MissingExtraError:
        raise
    except (Exception, SystemExit) as error:
        del sys.modules[name]
        raise _load_failure(error, path, f"{what} was read") from error
    return module


def _load_failure(error: BaseException, path: Path, while_doing: str) -> SnrError:
    if isinstance(error, (SyntaxError, ValueError)) and (found := _not_text(path)):
        return ConfigError(
            f"{found}\n  while {while_doing}", fix="name a Python file; an editor that saves UTF-8 text makes one."
        )
    return ConfigError(describe_error(error, f"while {while_doing}"))


def _not_text(path: Path) -> str:
    """Return a message on bytes in a file that are not valid in Python source; empty if there are none."""
    raw = source_files().read(path)
    place = raw.find(b"\0")
    try:
        importlib.util.decode_source(raw)  # uses the encoding that the file declares
    except (UnicodeDecodeError, SyntaxError):
        try:
            raw.decode()
        except UnicodeDecodeError as error:
            place = error.start
    if place < 0:
        return ""
    line = raw.count(b"\n", 0, place) + 1
    return f"{short_path(str(path))}, line {line}: this is not Python source: byte 0x{raw[place]:02x} is not text."


@lru_cache(maxsize=128)
def _compiled(source: bytes, path: str) -> CodeType:
    """Return the code of a source, compiled once: an environment or a dive in the same process loads it again."""
    return compile(source, path, "exec", dont_inherit=True)


class _FreshLoader(SourceFileLoader):
    """Loader that reads the source every time: cached bytecode may be older than an edit within the same second."""

    def get_data(self, path: str) -> bytes:
        """Return the source, from the disk or as it was recorded."""
        return source_files().read(Path(path))

    def source_to_code(self, data: Any, path: Any, **options: Any) -> Any:  # type: ignore[override]
        """Return the code of a source."""
        source_files().check(Path(path), data)
        importlib.util.decode_source(data)  # as Python itself requires; to compile bytes does not look at comments
        return _compiled(bytes(data), str(path))

    def path_stats(self, path: Any) -> Any:
        """Raise, so that no bytecode is used."""
        raise OSError


class _RobotFinder:
    """Finder of the modules in a robot's folder, which needs no `__init__.py`."""

    def __init__(self) -> None:
        self.loaded: defaultdict[str, set[Path]] = defaultdict(set)  # by the robot's module, since its last load

    def begin(self, robot: str) -> None:
        """Clear the list of a robot's files, since the robot is loaded again."""
        self.loaded[robot] = set()
        if self not in sys.meta_path:
            sys.meta_path.insert(0, self)

    def find_spec(self, fullname: str, path: Any, target: Any = None) -> ModuleSpec | None:
        """Return the spec of `snr_sim_robot_<name>.<module>`."""
        if not fullname.startswith(ROBOT_MODULE) or not path:
            return None
        base = Path(next(iter(path))) / fullname.rpartition(".")[2]
        file = base.with_suffix(".py")
        if source_files().is_file(file):
            self.loaded[fullname.partition(".")[0]].add(file)
            return _spec(fullname, file)
        if source_files().is_dir(base):
            spec = ModuleSpec(fullname, None, is_package=True)
            spec.submodule_search_locations = [str(base)]
            return spec
        return None


class _SiblingFinder:
    """Finder of modules next to the last loaded file, as for a script; Python's own modules take precedence."""

    def __init__(self) -> None:
        self.loaded: set[Path] = set()
        self._folder: Path | None = None

    def search_in(self, folder: Path) -> None:
        """Search this folder from now on, and drop modules of the previous folder and old versions from this one."""
        for name, module in list(sys.modules.items()) if self.loaded else ():
            if Path(getattr(module, "__file__", None) or "") in self.loaded:
                del sys.modules[name]
        self.loaded = set()  # not cleared in place: a simulation may still refer to the old set
        self._folder = folder
        if self not in sys.meta_path:
            sys.meta_path.insert(0, self)

    def find_spec(self, fullname: str, path: Any, target: Any = None) -> ModuleSpec | None:
        """Return the spec of `<folder>/<name>.py`, or of a package with an `__init__.py`."""
        top, _, below = fullname.partition(".")
        if self._folder is None or top in sys.stdlib_module_names or top.startswith("snr_sim"):
            return None
        base = self._folder.joinpath(top, *below.split(".")) if below else self._folder / top
        for file in (base / "__init__.py", base.with_name(base.name + ".py")):
            if source_files().is_file(file):
                self.loaded.add(file)
                return _spec(fullname, file, base if file.name == "__init__.py" else None)
        return None


_robots = _RobotFinder()
_siblings = _SiblingFinder()
