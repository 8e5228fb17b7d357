"""The rooms of the house: who may meet whom, which door each heavy package has, and what an import costs."""

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

# ARCHITECTURE section 3: a room imports from rooms with a lower number, and from itself. Modules that stand in
# snr_sim itself are rooms too. `snr_sim/__init__.py` may name everything: it only says where things are.
FLOOR = {
    "prelude": 0,
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
    "schemas": 4,
    "scenario": 4,
    "thesis": 4,
    "learning": 5,
    "grading": 6,
    "web": 6,
    "cli": 7,
    "__main__": 8,
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
    "PIL",
    "prompt_toolkit",
    "pyarrow",
    "scipy",
    "matplotlib",
    "zenoh",
    "distributed",
}


@cache
def modules() -> dict[str, ast.Module]:
    """All modules of the kit by dotted name, without the content that a wheel ships."""
    found = {}
    for path in sorted(KIT.rglob("*.py")):
        parts = path.relative_to(KIT).with_suffix("").parts
        if parts[0] != "shipped" and parts != ("__init__",):
            found[".".join(parts)] = ast.parse(path.read_text(encoding="utf-8"))
    return found


@cache
def imports(tree: ast.Module) -> set[str]:
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


def test_every_module_stands_in_a_room() -> None:
    assert {name.split(".")[0] for name in modules()} <= set(FLOOR)


def test_rooms_import_from_rooms_below_only_and_never_sideways() -> None:
    wrong = []
    for name, tree in modules().items():
        own = name.split(".")[0]
        wrong += [
            f"{name} imports {room}" for room in rooms_of(imports(tree)) if room != own and FLOOR[room] >= FLOOR[own]
        ]
    assert wrong == []


def test_rooms_name_each_other_and_do_not_go_through_the_front_door() -> None:
    allowed = {f"snr_sim.{room}" for room in FLOOR} | {"snr_sim.__version__"}
    wrong = [
        f"{name} imports {part}"
        for name, tree in modules().items()
        for part in imports(tree)
        if part.startswith("snr_sim.") and ".".join(part.split(".")[:2]) not in allowed
    ]
    assert wrong == []


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


def test_each_heavy_package_has_one_door() -> None:
    doors = defaultdict(set)
    for name, tree in modules().items():
        for package in {imported.split(".")[0] for imported in imports(tree)} & HEAVY:
            doors[package].add(name)
    assert {package: names for package, names in doors.items() if len(names) > 1} == {}


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
        "import snr_sim.devices.loops, snr_sim.recording.trace, snr_sim.scenario.library",
    ],
)
def test_importing_the_kit_loads_neither_numpy_nor_anything_heavy(statement: str) -> None:
    loaded = {name.split(".")[0] for name in loaded_by(statement)}
    assert loaded & (HEAVY | {"numpy", "typer", "rich", "hypothesis", "pytest"}) == set()


@pytest.mark.slow
def test_only_drawing_loads_matplotlib() -> None:
    drawing = "snr_sim.learning.rendering, snr_sim.view.picture, snr_sim.grading.batch.class_files"
    loaded = {name.split(".")[0] for name in loaded_by(f"import snr_sim.learning, {drawing}")}
    assert loaded & {"matplotlib", "PIL"} == set()


@pytest.mark.slow
def test_importing_the_kit_alone_loads_none_of_its_rooms() -> None:
    assert {name for name in loaded_by("import snr_sim") if name.startswith("snr_sim.")} == set()


def test_a_star_import_gives_exactly_the_public_names() -> None:
    names: dict[str, object] = {}
    exec("from snr_sim import *", names)
    assert set(names) - {"__builtins__"} == set(snr_sim.__all__)
    assert len(snr_sim.__all__) == len(set(snr_sim.__all__))
    assert set(snr_sim.__all__) <= set(dir(snr_sim))


def test_what_type_checkers_see_is_what_is_there() -> None:
    tree = ast.parse((KIT / "__init__.py").read_text(encoding="utf-8"))
    (block,) = [node for node in tree.body if isinstance(node, ast.If)]
    seen = {alias.name: node.module for node in block.body if isinstance(node, ast.ImportFrom) for alias in node.names}
    places = {name: module for module, names in snr_sim._PLACES.items() for name in names}
    assert seen == {**places, "tasks": "snr_sim.prelude"}


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
def test_what_has_a_wire_needs_no_numpy() -> None:
    """A student's own robot runs on the base install: only what is simulated draws, and keeps arrays."""
    package = KIT / "devices"
    parts = [path.relative_to(KIT.parent).with_suffix("") for path in sorted(package.rglob("*.py"))]
    modules = [".".join(part.parts) for part in parts if part.name not in ("__init__", "camera", "ray_casting")]
    assert len(modules) > 15
    code = f"import sys, importlib; sys.modules['numpy'] = None; [importlib.import_module(one) for one in {modules}]"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
