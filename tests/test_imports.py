"""The packages of snr_sim: which may import which, which module imports each heavy package, and import times."""

import ast
import json
import re
import subprocess
import sys
from collections import defaultdict
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import snr_sim

KIT = Path(snr_sim.__file__).parent

# ARCHITECTURE section 1: a package imports from packages with a lower number, and from itself. Modules in
# snr_sim itself have numbers too. Public packages may name everything: see `modules`.
FLOOR = {
    "prelude": 0,
    "lazy": 1,
    "core": 1,
    "std_mods": 2,
    "links": 2,
    "devices": 2,
    "plants": 2,
    "recording": 2,
    "behaviors": 2,
    "console": 3,
    "view": 3,
    "supervision": 3,
    "teleop": 3,
    "testing": 3,
    "web": 4,
    "processes": 4,
    "schemas": 5,
    "scenario": 5,
    "thesis": 5,
    "learning": 6,
    "grading": 7,
    "cli": 8,
    "notebook": 8,
    "__main__": 9,
}
HEAVY = {
    "mujoco",
    "pygame",
    "pymunk",
    "gymnasium",
    "rerun",
    "rerun_cli",
    "serial",
    "smbus2",
    "can",
    "PIL",
    "prompt_toolkit",
    "pyarrow",
    "scipy",
    "matplotlib",
    "zenoh",
    "distributed",
    "starlette",
    "uvicorn",
    "websockets",
}


@cache
def all_modules() -> dict[str, ast.Module]:
    """All modules of the kit by dotted name, without the content that a wheel ships."""
    found = {}
    for path in sorted(KIT.rglob("*.py")):
        parts = path.relative_to(KIT).with_suffix("").parts
        if parts[0] != "shipped":
            found[".".join(parts)] = ast.parse(path.read_text(encoding="utf-8"))
    return found


@cache
def public_packages() -> dict[str, ast.Module]:
    """The public packages: modules with a table of public names."""
    return {name: tree for name, tree in all_modules().items() if "snr_sim.lazy.lazy_names" in imports(tree)}


def modules() -> dict[str, ast.Module]:
    """All modules except the public packages.

    A public package imports nothing, it only knows where each public name is. So it may name rooms above its own, and
    closes no import cycle, as long as no module of the kit imports a public name from it; a test below sees to that.
    """
    return {name: tree for name, tree in all_modules().items() if name not in public_packages()}


@cache
def imports(tree: ast.AST) -> set[str]:
    """Every module an import names, also inside functions and under TYPE_CHECKING."""
    names: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"line {node.lineno}: the kit imports by full name"
            names.add(node.module or "")
            names.update(f"{node.module}.{alias.name}" for alias in node.names)
    return names


def rooms_of(names: set[str]) -> set[str]:
    return {name.split(".")[1] for name in names if name.startswith("snr_sim.")} & set(FLOOR)


def test_every_module_belongs_to_a_room() -> None:
    assert {name.split(".")[0] for name in modules()} <= set(FLOOR)


def test_rooms_import_from_rooms_below_only_and_never_sideways() -> None:
    wrong = []
    for name, tree in modules().items():
        own = name.split(".")[0]
        wrong += [
            f"{name} imports {room}" for room in rooms_of(imports(tree)) if room != own and FLOOR[room] >= FLOOR[own]
        ]
    assert wrong == []


def test_rooms_import_each_other_directly_not_through_snr_sim() -> None:
    allowed = {f"snr_sim.{room}" for room in FLOOR} | {"snr_sim.__version__"}
    wrong = [
        f"{name} imports {part}"
        for name, tree in modules().items()
        for part in imports(tree)
        if part.startswith("snr_sim.") and ".".join(part.split(".")[:2]) not in allowed
    ]
    assert wrong == []


def test_rooms_import_no_public_name_from_a_public_package() -> None:
    packages = {name.removesuffix(".__init__") for name in all_modules()}
    public = {f"snr_sim.{name}".removesuffix(".__init__") for name in public_packages()}
    wrong = [
        f"{name} imports {part}"
        for name, tree in modules().items()
        for part in imports(tree)
        if part.rpartition(".")[0] in public and part.removeprefix("snr_sim.") not in {*packages, "__version__"}
    ]
    assert wrong == []


def test_public_packages_import_for_type_checkers_only() -> None:
    for name, tree in public_packages().items():
        top = {part for node in tree.body if not isinstance(node, ast.If) for part in imports(node)}
        assert {part for part in top if part.startswith("snr_sim")} == {"snr_sim.lazy", "snr_sim.lazy.lazy_names"}, name


def test_no_modules_import_each_other() -> None:
    """Imports in functions and under TYPE_CHECKING count: they are what hides a circle."""
    arrows = {
        f"snr_sim.{name.removesuffix('.__init__')}": {part for part in imports(tree) if part.startswith("snr_sim.")}
        for name, tree in modules().items()
    }
    order = TopologicalSorter({name: parts & arrows.keys() - {name} for name, parts in arrows.items()})
    order.prepare()  # raises CycleError, which names a circle


def test_the_kit_imports_no_robot_no_scenario_and_no_test() -> None:
    content = {"robots", "scenarios", "assignments", "tests"}
    wrong = {name for name, tree in modules().items() if {part.split(".")[0] for part in imports(tree)} & content}
    assert wrong == set()


def test_no_module_names_a_lab() -> None:
    """A lab brings what grades it in its own folder."""
    folders = [folder.name for folder in (KIT.parent / "assignments").glob("[0-9]*")]
    assert folders
    names = re.compile(r"\blabs? \d|" + "|".join(map(re.escape, folders)), re.IGNORECASE)
    assert not [path for path in KIT.rglob("*.py") if "shipped" not in path.parts and names.search(path.read_text())]


def test_no_module_takes_all_names_of_another() -> None:
    for name, tree in modules().items():
        stars = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.names[0].name == "*"]
        assert stars == [], name


def test_each_heavy_package_is_imported_by_one_module() -> None:
    importers = defaultdict(set)
    for name, tree in modules().items():
        for package in {imported.split(".")[0] for imported in imports(tree)} & HEAVY:
            importers[package].add(name)
    assert {package: names for package, names in importers.items() if len(names) > 1} == {}


def loaded_by(statement: str) -> set[str]:
    code = f"{statement}\nimport json, sys\nprint(json.dumps(sorted(sys.modules)))"
    printed = subprocess.check_output([sys.executable, "-c", code], text=True, cwd=KIT.parent)
    return set(json.loads(printed))


@pytest.mark.slow
@pytest.mark.parametrize(
    "statement",
    [
        "import snr_sim",
        "import snr_sim as snr; snr.Node; snr.Endpoint; snr.Loop; snr.SimRunner; snr.tasks",
        "from snr_sim import *",
        "import snr_sim.devices.readings, snr_sim.recording.trace, snr_sim.scenario.library",
        "from snr_sim.plants import Engine, Explorer, Leg, LunarModule, Throttle",  # numbers of the lander, of dora
    ],
)
def test_importing_the_kit_loads_neither_numpy_nor_anything_heavy(statement: str) -> None:
    loaded = {name.split(".")[0] for name in loaded_by(statement)}
    assert loaded & (HEAVY | {"numpy", "typer", "rich", "hypothesis", "pytest"}) == set()


@pytest.mark.slow
def test_only_drawing_loads_matplotlib() -> None:
    drawing = "snr_sim.learning.rendering, snr_sim.view.picture, snr_sim.grading.batch.class_run"
    loaded = {name.split(".")[0] for name in loaded_by(f"import snr_sim.learning, {drawing}")}
    assert loaded & {"matplotlib", "PIL"} == set()


@pytest.mark.slow
def test_importing_the_kit_alone_loads_none_of_its_rooms() -> None:
    assert {name for name in loaded_by("import snr_sim") if name.startswith("snr_sim.")} == {"snr_sim.lazy"}


def test_a_star_import_gives_exactly_the_public_names() -> None:
    names: dict[str, object] = {}
    exec("from snr_sim import *", names)
    assert set(names) - {"__builtins__"} == set(snr_sim.__all__)
    assert len(snr_sim.__all__) == len(set(snr_sim.__all__))
    assert set(snr_sim.__all__) <= set(dir(snr_sim))


def test_a_name_that_is_not_there_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="'snr_sim' has no attribute 'Nod'"):
        _ = snr_sim.Nod
    with pytest.raises(ImportError):
        exec("from snr_sim import Nod")


@pytest.mark.parametrize(
    "names",
    [
        "Task TaskType TaskId SomeTasks TaskHandlerMap Page tasks Config Mode Node Endpoint EndpointFactory",
        "Loop ThreadLoop LoopFactory SynchronousRunner CliRunner TestRunner SimRunner MultiProcRunner",
        "SNRTestCase Expector OrderedExpector ExpectorEndpointFactory ListReplayerFactory",
        "MovingAvgFilter MovingAvgFilterFactory PrinterEndpointFactory TimeoutLoopFactory StopwatchEndpointFactory",
    ],
)
def test_the_names_of_the_thesis_are_there(names: str) -> None:
    assert set(names.split()) <= set(snr_sim.__all__)


@pytest.mark.slow
def test_device_modules_import_without_numpy() -> None:
    """A student's own robot runs on the base install: only what is simulated draws, casts rays, and keeps arrays."""
    simulated = ("camera", "lidar", "ray_casting", "ray_marching", "stereo")
    package = KIT / "devices"
    parts = [path.relative_to(KIT.parent).with_suffix("") for path in sorted(package.rglob("*.py"))]
    modules = [".".join(part.parts) for part in parts if part.name not in ("__init__", *simulated)]
    assert len(modules) > 15
    code = f"import sys, importlib; sys.modules['numpy'] = None; [importlib.import_module(one) for one in {modules}]"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
