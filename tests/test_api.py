"""The public interface: the names of the public packages, with their signatures, and who imports anything else.

`python tests/test_api.py --write` writes tests/api.txt again, after a change of public names or signatures.
"""

from __future__ import annotations

import ast
import enum
import inspect
import json
import re
import subprocess
import sys
from collections.abc import Iterator
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import Any, ForwardRef, get_origin, is_typeddict

import pytest

ROOT = Path(__file__).parents[1]
API = Path(__file__).with_name("api.txt")
PACKAGES = [
    "snr_sim",
    "snr_sim.behaviors",
    "snr_sim.behaviors.flow",
    "snr_sim.behaviors.processes",
    "snr_sim.console",
    "snr_sim.devices",
    "snr_sim.devices.emulated",
    "snr_sim.devices.wire",
    "snr_sim.errors",
    "snr_sim.grading",
    "snr_sim.learning",
    "snr_sim.links",
    "snr_sim.notebook",
    "snr_sim.plants",
    "snr_sim.processes",
    "snr_sim.recording",
    "snr_sim.scenario",
    "snr_sim.signals",
    "snr_sim.std_mods",
    "snr_sim.supervision",
    "snr_sim.teleop",
    "snr_sim.testing",
    "snr_sim.web",
]
# What robots, scenarios, labs and pages import that is not public. This list may only shrink.
# Grading's parts in labs 8 to 12 belong to these labs, and constants of a module are internal.
NOT_PUBLIC: dict[str, set[str]] = {
    "assignments/05_mission_state_machine/checks.py": {
        "snr_sim.scenario.library",
    },
    "assignments/06_perception_drop_in/checks.py": {
        "snr_sim.scenario.library",
    },
    "assignments/06_perception_drop_in/starter/look.py": {
        "snr_sim.prelude.values.decode_value",
        "snr_sim.recording.folder.trace_path",
        "snr_sim.recording.reader.read_trace",
        "snr_sim.recording.records.PageRecord",
    },
    "assignments/08_sim_to_pi/checks.py": {
        "snr_sim.grading.remote.parsers.MAX_PARSED_BYTES",
        "snr_sim.plants.urov.t200.MAX_PULSE_US",
        "snr_sim.plants.urov.t200.MIN_PULSE_US",
        "snr_sim.plants.urov.t200.STOP_US",
    },
    "assignments/09_debug_by_replay/checks.py": {
        "snr_sim.grading.remote.parsers.toml_in",
        "snr_sim.recording.trace.FILE_NAME",
    },
    "assignments/09_debug_by_replay/starter/repairs.py": {
        "snr_sim.prelude.errors.ConfigError",
    },
    "assignments/10_lunar_lander_q/checks.py": {
        "snr_sim.learning.batch_training.ENVIRONMENT",
    },
    "assignments/10_lunar_lander_q/grader/evidence.py": {
        "snr_sim.learning.vertical_batch.Floats",
    },
    "assignments/10_lunar_lander_q/grader/learning.py": {
        "snr_sim.learning.batch_training.CEILING_M",
        "snr_sim.learning.batch_training.MAX_STEPS",
        "snr_sim.learning.batch_training.STEP_S",
        "snr_sim.learning.lander_envs.LanderVertical",
        "snr_sim.learning.vertical_batch.Floats",
        "snr_sim.learning.vertical_batch.Landers",
        "snr_sim.learning.vertical_batch.step",
        "snr_sim.prelude.task.ensure_type_info",
    },
    "assignments/10_lunar_lander_q/starter/learn.py": {
        "snr_sim.grading.lab.lab.find_lab",
        "snr_sim.prelude.errors.SnrError",
        "snr_sim.scenario.library.load_program",
    },
    "assignments/11_write_the_queue/checks.py": {
        "snr_sim.grading.lab.submission.MAX_SOURCE_BYTES",
    },
    "assignments/11_write_the_queue/grader/queue_bench.py": {
        "snr_sim.core.lockstep.run_node",
        "snr_sim.core.machine.EventMachine",
    },
    "assignments/11_write_the_queue/starter/try_it.py": {
        "snr_sim.grading.lab.lab.find_lab",
        "snr_sim.prelude.errors.SnrError",
        "snr_sim.scenario.library.load_program",
    },
    "assignments/12_live_programming/checks.py": {
        "snr_sim.grading.remote.parsers.toml_in",
        "snr_sim.scenario.machine_edits.TABLE",
        "snr_sim.scenario.machine_edits.digest_of_changes",
    },
    "assignments/12_live_programming/grader/reading.py": {
        "snr_sim.behaviors.explore.explore",
        "snr_sim.behaviors.imports.files_named",
    },
    "assignments/15_supervision/grader/bench.py": {
        "snr_sim.supervision.tree.Order",
        "snr_sim.supervision.tree.Tree",
    },
    "docs/coming_from_the_thesis.md": {
        "snr_sim.core.*",
        "snr_sim.prelude.*",
    },
    "notebooks/02_underwater.ipynb": {
        "snr_sim.scenario.library",
    },
    "robots/lander/controllers/optimal.py": {
        "snr_sim.plants.lander.descent.find_root",
    },
    "robots/lander/controllers/pad.py": {
        "snr_sim.plants.lander.module_shapes.PADS_BELOW_M",
    },
    "robots/lander/evaluation.py": {
        "snr_sim.plants.lander.module_shapes.PADS_BELOW_M",
    },
    "robots/lander/parameters.py": {
        "snr_sim.plants.lander.module_shapes.JETS_OUT_M",
    },
    "robots/lander/robot.py": {
        "snr_sim.devices.pwm.engine_pwm.CHANNELS",
        "snr_sim.scenario.library",
    },
    "robots/urov/autopilot.py": {
        "snr_sim.core.datastore.page_age_s",
        "snr_sim.plants.urov.t200.curve",
    },
    "robots/urov/controllers/holds.py": {
        "snr_sim.core.config.AnyFactory",
    },
    "robots/urov/evaluation.py": {
        "snr_sim.plants.urov.t200.STOP_US",
    },
    "robots/urov/parameters.py": {
        "snr_sim.plants.urov.t200.MAX_VOLTAGE_V",
        "snr_sim.plants.urov.t200.MIN_VOLTAGE_V",
    },
    "robots/urov/readings.py": {
        "snr_sim.devices.commands.command_of",
        "snr_sim.prelude.task.ensure_type_info",
    },
    "robots/urov/robot.py": {
        "snr_sim.devices.wire.mcu_messages.BAUD",
        "snr_sim.plants.urov.t200.MAX_PULSE_US",
        "snr_sim.plants.urov.t200.MIN_PULSE_US",
    },
}


# Who imports what


def programs() -> Iterator[tuple[str, str]]:
    """Path and Python code of robots, scenarios, labs, notebooks, and the pages of README and docs."""
    for folder in ("robots", "scenarios", "assignments"):
        for path in sorted((ROOT / folder).rglob("*.py")):
            yield path.relative_to(ROOT).as_posix(), path.read_text(encoding="utf-8")
    for path in sorted((ROOT / "notebooks").glob("*.ipynb")):
        for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
            if cell["cell_type"] == "code":
                yield path.relative_to(ROOT).as_posix(), re.sub(r"^[%!].*", "pass", "".join(cell["source"]), flags=re.M)
    for page in [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")), *sorted((ROOT / "notebooks").glob("*.md"))]:
        for block in re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), flags=re.DOTALL):
            yield page.relative_to(ROOT).as_posix(), block


def names_imported(code: str) -> set[str]:
    """Names that the code imports from snr_sim, each with its module."""
    names = set()
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names if alias.name.split(".")[0] == "snr_sim"}
        elif isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "snr_sim":
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def is_public(name: str) -> bool:
    package, _, attribute = name.rpartition(".")
    return name in PACKAGES or (
        package in PACKAGES and (attribute == "*" or attribute in import_module(package).__all__)
    )


def test_programs_import_from_public_packages_only() -> None:
    found = {(path, name) for path, code in programs() for name in names_imported(code) if not is_public(name)}
    allowed = {(path, name) for path, names in NOT_PUBLIC.items() for name in names}
    assert sorted(found - allowed) == [], "import these from a public package, or make them public"
    assert sorted(allowed - found) == [], "these are no longer imported: remove them from NOT_PUBLIC"


# Names and signatures


def annotation_text(annotation: Any) -> str:
    if isinstance(annotation, str):  # as in the source, since modules postpone annotations
        return annotation
    if isinstance(annotation, ForwardRef):
        return annotation.__forward_arg__
    if isinstance(annotation, type) and get_origin(annotation) is None:
        return annotation.__name__ if annotation is not type(None) else "None"
    return re.sub(r"\b[a-z_]\w*\.(?=\w)", "", str(annotation))  # without modules


def default_text(value: Any) -> str:
    if isinstance(value, enum.Enum):
        return f"{type(value).__name__}.{value.name}"
    if value is None or isinstance(value, (bool, int, float, str, bytes)):
        return repr(value)
    if isinstance(value, tuple) and type(value) is tuple:
        return "(" + ", ".join(map(default_text, value)) + ("," if len(value) == 1 else "") + ")"
    if inspect.isclass(value) or inspect.isroutine(value):
        return "..." if "<" in value.__qualname__ else value.__qualname__
    return "..."


def signature_text(function: Any) -> str:
    """Parameters and result, as in the source."""
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):
        return "(...)"
    parts, is_star_due = [], True
    parameters = [one for one in signature.parameters.values() if one.name not in ("self", "cls")]
    for one in parameters:
        text = {one.VAR_POSITIONAL: "*", one.VAR_KEYWORD: "**"}.get(one.kind, "") + one.name
        if one.kind is one.VAR_POSITIONAL:
            is_star_due = False
        if one.kind is one.KEYWORD_ONLY and is_star_due:
            parts.append("*")
            is_star_due = False
        if one.annotation is not one.empty:
            text += f": {annotation_text(one.annotation)}"
        if one.default is not one.empty:
            text += f" = {default_text(one.default)}"
        parts.append(text)
    result = signature.return_annotation
    arrow = "" if result is signature.empty or inspect.isclass(function) else f" -> {annotation_text(result)}"
    return f"({', '.join(parts)}){arrow}"


def member_lines(name: str, kind: type) -> Iterator[str]:
    """The public members of a class that classes of snr_sim define; nearer ones hide those of their bases."""
    members: dict[str, Any] = {}
    for base in reversed(kind.__mro__):
        if base.__module__.split(".")[0] == "snr_sim":
            members |= {key: value for key, value in vars(base).items() if not key.startswith("_")}
    for key, value in members.items():
        if issubclass(kind, enum.Enum) and key in kind.__members__:
            yield f"{name}.{key} = {value.value!r}"
        elif isinstance(value, (classmethod, staticmethod)):
            yield f"{name}.{key}{signature_text(value.__func__)}"
        elif isinstance(value, (property, cached_property)):
            getter = value.fget if isinstance(value, property) else value.func
            yield f"{name}.{key} -> {signature_text(getter).partition(' -> ')[2] or 'Any'}"
        elif inspect.isfunction(value):
            yield f"{name}.{key}{signature_text(value)}"


def lines_of(name: str, value: Any) -> Iterator[str]:
    if inspect.ismodule(value):
        for key in sorted(vars(value)):
            if inspect.isfunction(vars(value)[key]) and vars(value)[key].__module__ == value.__name__ and key[0] != "_":
                yield f"{name}.{key}{signature_text(vars(value)[key])}"
    elif inspect.isclass(value) and get_origin(value) is None:
        if issubclass(value, enum.Enum) or getattr(value, "_is_protocol", False) or is_typeddict(value):
            yield name
        else:
            yield f"{name}{signature_text(value)}"
        yield from member_lines(name, value)
    elif inspect.isroutine(value):
        yield f"{name}{signature_text(value)}"
    elif isinstance(value, (bool, int, float, str)):
        yield f"{name} = {value!r}"
    else:
        yield name


def api_text() -> str:
    lines, written = [], {}
    for package in [
        *PACKAGES[1:],
        PACKAGES[0],
    ]:  # a name that `snr_sim` has as well is described where its own package is
        public = [(name, getattr(import_module(package), name)) for name in import_module(package).__all__]
        for name, value in sorted(public, key=lambda one: (one[0] != getattr(one[1], "__name__", one[0]), one[0])):
            if inspect.isclass(value) and id(value) in written:
                lines.append(f"{package}.{name} is {written[id(value)]}")
                continue
            lines += [f"{package}.{line}" for line in lines_of(name, value)]
            written[id(value)] = f"{package}.{name}"
    return "\n".join(sorted(lines)) + "\n"


def test_public_names_equal_api_txt() -> None:
    found, expected = api_text().splitlines(), API.read_text(encoding="utf-8").splitlines()
    added = [f"+ {line}" for line in found if line not in expected]
    removed = [f"- {line}" for line in expected if line not in found]
    assert not removed + added, "\n".join(
        [*removed, *added, "If that is intended: python tests/test_api.py --write, and a line in CHANGELOG.md."]
    )
    assert found == expected


@pytest.mark.parametrize("package", PACKAGES)
def test_type_checking_imports_equal_public_names(package: str) -> None:
    """Type checkers find each name where the program finds it."""
    module = import_module(package)
    (block,) = [
        node
        for node in ast.parse(Path(str(module.__file__)).read_text(encoding="utf-8")).body
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
    ]
    seen = {
        (alias.asname or "").lstrip("_"): (node.module, alias.name)
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    if package == "snr_sim.grading":
        seen["Verdict"] = seen.pop("CheckVerdict")
    own = {name for name in module.__all__ if getattr(module, name, None).__class__.__name__ == "function"} - set(seen)
    assert set(seen) | own == set(module.__all__)
    assert own == ({"snr"} if package == "snr_sim.notebook" else set())
    assert len(module.__all__) == len(set(module.__all__))
    for name, (home, attribute) in seen.items():
        value = getattr(import_module(str(home)), attribute)
        assert getattr(module, name) is value


def test_each_name_has_one_public_package_besides_snr_sim() -> None:
    places: dict[int, list[str]] = {}
    for package in PACKAGES[1:]:
        module = import_module(package)
        for name in module.__all__:
            if inspect.isclass(value := getattr(module, name)) or inspect.isfunction(value):
                places.setdefault(id(value), []).append(f"{package}.{name}")
    assert [names for names in places.values() if len(names) > 1] == []


def test_no_public_name_is_a_submodule_of_its_public_package() -> None:
    """Python replaces a package's attribute when it imports a submodule of that name."""
    for package in PACKAGES:
        module = import_module(package)
        folders = [Path(folder) for folder in getattr(module, "__path__", [])]
        taken = {path.stem for folder in folders for path in folder.iterdir() if path.suffix in ("", ".py")}
        assert taken & set(module.__all__) == set(), package


# What an import costs


@pytest.mark.slow
def test_importing_public_packages_loads_nothing_else() -> None:
    code = f"import {', '.join(PACKAGES)}\nimport json, sys\nprint(json.dumps(sorted(sys.modules)))"
    loaded = json.loads(subprocess.check_output([sys.executable, "-c", code], text=True, cwd=ROOT))
    ours = {name for name in loaded if name.split(".")[0] == "snr_sim"}
    assert ours - set(PACKAGES) == {"snr_sim.lazy", "snr_sim.learning.late_registration"}
    bare = subprocess.check_output([sys.executable, "-c", "import json, sys; print(json.dumps(sorted(sys.modules)))"])
    others = {name.split(".")[0] for name in set(loaded) - set(json.loads(bare))} - {"snr_sim"}
    assert others <= sys.stdlib_module_names


if __name__ == "__main__":
    if sys.argv[1:] != ["--write"]:
        sys.exit("usage: python tests/test_api.py --write")
    API.write_text(api_text(), encoding="utf-8")
