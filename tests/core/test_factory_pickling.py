"""Pickling of factories for another process: also of those loaded by path, and errors for unpicklable ones."""

import importlib
import linecache
import os
import pickle
import subprocess
import sys
import threading
import types
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest

from snr_sim import Config, Loop, LoopFactory, Mode, Node, TimeoutLoopFactory
from snr_sim.core.process.factory_pickling import pickle_factory, unpickle_factory
from snr_sim.prelude.errors import ConfigError
from snr_sim.scenario import library

TOP = Path(__file__).parents[2]

ROBOT = """
from .eye import EyeFactory

ROLES = ("robot",)
IO = ("sim",)


def roles(*args):
    return {"robot": [EyeFactory()]}
"""
CAMERA_MODULE = """
from snr_sim import Loop, LoopFactory, tasks

from .lens import NAME


class Eye(Loop):
    executor = "process"

    def loop(self):
        self.store_data("lens", NAME)
        self.schedule(tasks.terminate("seen"))


class EyeFactory(LoopFactory):
    def get(self, parent):
        return Eye(self, parent, "eye", 10)
"""
PROGRAM = """
import sys

from snr_sim import Config, Loop, LoopFactory, Node, tasks


class Eye(Loop):
    executor = "process"

    def loop(self):
        self.store_data("name", __name__)
        self.schedule(tasks.terminate("seen"))


class EyeFactory(LoopFactory):
    def get(self, parent):
        return Eye(self, parent, "eye", 10)


def main():
    node = Node("r", Config(factories={"r": [EyeFactory()]}))
    node.loop()
    print(node.get_data("name"), sys.argv[1:])

"""


@pytest.fixture
def robot(tmp_path: Path) -> Any:
    folder = tmp_path / "robots" / "cyclops"
    folder.mkdir(parents=True)
    for name, text in {"robot": ROBOT, "eye": CAMERA_MODULE, "lens": "NAME = 'fisheye'\n"}.items():  # plain: blind
        (folder / f"{name}.py").write_text(text)
    return library.load_robot(library.FoundItem("robots", "cyclops", folder, "a test"))


def run_program(text: str, *words: str, folder: Path, how: tuple[str, ...] = ("robot.py",)) -> tuple[int, str, str]:
    (folder / "robot.py").write_text(text)
    done = subprocess.run(
        [sys.executable, *how, *words],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=60,
        env={**os.environ, "PYTHONPATH": str(TOP)},
    )
    return done.returncode, done.stdout, done.stderr


@pytest.mark.slow
def test_robot_loaded_by_path_is_sent_with_neighbouring_files(robot: Any) -> None:
    node = Node("robot", Config(Mode.TEST, {"robot": [*robot.roles()["robot"], TimeoutLoopFactory(seconds=60)]}))
    node.loop()
    assert node.exit_reason == "seen"
    assert node.get_data("lens") == "fisheye"


GUARDED = PROGRAM + 'print("read")\nif __name__ == "__main__":\n    main()\n'
UNGUARDED = PROGRAM + 'print("read")\nmain()\n'


@pytest.mark.slow
@pytest.mark.parametrize("text", [GUARDED, UNGUARDED])
@pytest.mark.parametrize("how", [("robot.py",), ("-m", "robot"), ("-c", None)])
def test_definitions_of_program_are_sent_without_rerunning_it(
    how: tuple[str | None, ...], text: str, tmp_path: Path
) -> None:
    status, out, err = run_program(text, "--fast", folder=tmp_path, how=tuple(word or text for word in how))
    assert (status, err) == (0, "")
    assert out.startswith("read\n__main__ ")
    assert out.endswith("['--fast']\n")


@pytest.mark.slow
def test_unguarded_process_start_raises_with_main_guard_fix(tmp_path: Path) -> None:
    (tmp_path / "boat.py").write_text(UNGUARDED)
    status, _, err = run_program("import boat\n", folder=tmp_path)
    assert status == 1
    assert "starts a process again while that process still reads the program" in err
    assert "if __name__ == '__main__':" in err


STRUCT = '''
from __future__ import annotations

import enum

import msgspec


class Kind(enum.Enum):
    water = "w"


FACTOR = 2.0


class Depth(msgspec.Struct, frozen=True, tag="deep"):
    """Of the water."""

    m: float
    names: list[str] = []
    kinds: list[Kind] = []
    above: Depth | None = None

    def twice(self) -> Depth:
        return Depth(self.m * FACTOR)

    @property
    def cm(self) -> float:
        return self.m * 100


class KeyDepth(Depth, kw_only=True):
    key: str = msgspec.field(name="k")
'''


def test_struct_of_program_is_sent_with_fields_and_methods(monkeypatch: pytest.MonkeyPatch) -> None:
    program = types.ModuleType("__main__")
    monkeypatch.setitem(sys.modules, "__main__", program)
    exec(STRUCT, program.__dict__)
    Depth, KeyDepth = unpack_again([program.Depth, program.KeyDepth])  # noqa: N806
    assert Depth is not program.Depth
    assert (Depth(2.0).twice().cm, Depth(1.0).names, Depth.__doc__) == (400.0, [], "Of the water.")
    assert msgspec.json.encode(Depth(1.0)) == b'{"type":"deep","m":1.0,"names":[],"kinds":[],"above":null}'
    back = msgspec.json.decode(b'{"type":"deep","m":1,"kinds":["w"],"above":{"type":"deep","m":2}}', type=Depth)
    assert (back.kinds[0].name, back.above) == ("water", Depth(2.0))
    assert KeyDepth(1.0, key="a") == msgspec.json.decode(b'{"type":"deep","m":1,"k":"a"}', type=KeyDepth)
    with pytest.raises(AttributeError):
        Depth(1.0).m = 2.0


def test_notebook_source_lines_are_sent(monkeypatch: pytest.MonkeyPatch) -> None:
    program = types.ModuleType("__main__")
    monkeypatch.setitem(sys.modules, "__main__", program)
    cell = ["def look():\n", "    raise ValueError\n"]
    monkeypatch.setitem(linecache.cache, "/cell.py", (1, None, cell, "/cell.py"))
    exec(compile("".join(cell), "/cell.py", "exec"), program.__dict__)
    assert pickle_factory(program.look, "look", "Loop 'eye'")["lines"] == {"/cell.py": cell}


def test_sent_code_keeps_its_file_also_within_functions(monkeypatch: pytest.MonkeyPatch) -> None:
    program = types.ModuleType("__main__")
    monkeypatch.setitem(sys.modules, "__main__", program)
    exec(
        compile("def look():\n    def inner():\n        pass\n    return inner\n", "/cell.py", "exec"), program.__dict__
    )
    look = unpack_again(program.look)
    assert look is not program.look
    assert [code.co_filename for code in (look.__code__, look().__code__)] == ["/cell.py"] * 2


FACTORY = """
from snr_sim import LoopFactory
WORD = "first"


class EyeFactory(LoopFactory):
    pass
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder that Python imports from, without bytecode: files are written twice within a second here."""
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    known = set(sys.modules)
    yield tmp_path
    for name in set(sys.modules) - known:
        del sys.modules[name]


def packed_source(factory: Any, module: str) -> str:
    source = pickle_factory(factory, type(factory).__name__, "Loop 'eye'")["modules"][module][1]
    assert isinstance(source, bytes)
    return source.decode()


def test_process_gets_running_source_after_importlib_reload(folder: Path) -> None:
    path = folder / "packed_eye.py"
    path.write_text(FACTORY)
    module = importlib.import_module("packed_eye")
    assert packed_source(module.EyeFactory(), "packed_eye") == FACTORY
    edited = FACTORY.replace("first", "second, edited")
    path.write_text(edited)
    assert packed_source(module.EyeFactory(), "packed_eye") == FACTORY
    importlib.reload(module)
    assert module.WORD == "second, edited"
    assert packed_source(module.EyeFactory(), "packed_eye") == edited


def test_loaded_helpers_of_package_are_sent_and_other_modules_are_not(
    folder: Path,
) -> None:
    for name in ("packed_boat", "packed_boat/eyes"):
        (folder / name).mkdir()
        (folder / name / "__init__.py").write_text("")
    (folder / "packed_boat" / "lens.py").write_text("WORD = 'lens'\n")
    (folder / "packed_outside.py").write_text("")
    (folder / "packed_boat" / "eyes" / "eye.py").write_text(
        "from ..lens import WORD\nimport packed_outside\n" + FACTORY
    )
    factory = importlib.import_module("packed_boat.eyes.eye").EyeFactory()
    assert packed_source(factory, "packed_boat.lens") == "WORD = 'lens'\n"
    (folder / "packed_boat" / "lens.py").write_text("WORD = 'half typ")
    modules = pickle_factory(factory, "EyeFactory", "Loop 'eye'")["modules"]
    assert modules["packed_boat.lens"][1] == b"WORD = 'lens'\n"
    assert sorted(modules) == ["packed_boat", "packed_boat.eyes", "packed_boat.eyes.eye", "packed_boat.lens"]


class Inner:
    def __init__(self, value: Any) -> None:
        self.value = value


class KeepingFactory(LoopFactory):
    def __init__(self, *kept: Any, **named: Any) -> None:
        super().__init__(os)
        self.kept, self.named = list(kept), named

    def get(self, parent: Node) -> Loop:
        return Loop(self, parent, "keeper")


def locked() -> Any:
    lock = threading.Lock()

    def inside() -> bool:
        return lock.locked()

    return inside


def unpack_again(thing: Any) -> Any:
    before = sys.argv[:], sys.meta_path[:]
    try:
        return unpickle_factory(pickle_factory(thing, "KeepingFactory", "Loop 'eye'"))
    finally:
        sys.argv[:], sys.meta_path[:] = before


class Unwilling:
    def __reduce__(self) -> Any:
        raise RuntimeError("not me")


@pytest.mark.parametrize(
    ("factory", "message", "fix"),
    [
        (KeepingFactory(act=locked()), "`named['act'].lock` cannot be sent there: lock", "setup()"),
        (
            KeepingFactory(Inner({"a": [threading.Lock()]})),
            "`kept[0].value['a'][0]` cannot be sent there: lock",
            "setup()",
        ),
        (KeepingFactory(Unwilling()), "`kept[0]` cannot be sent there: Unwilling (not me)", "setup()"),
    ],
)
def test_unpicklable_object_is_named_with_its_path(factory: Any, message: str, fix: str) -> None:
    with pytest.raises(ConfigError) as caught:
        pickle_factory(factory, "KeepingFactory", "Loop 'eye'")
    assert str(caught.value).startswith("Loop 'eye' runs in a process of its own, and KeepingFactory's attribute ")
    assert message in str(caught.value)
    assert fix in caught.value.fix


def test_open_file_raises_with_setup_fix(tmp_path: Path) -> None:
    with open(tmp_path / "x", "w") as file, pytest.raises(ConfigError, match=r"`kept\[0\]` .*TextIOWrapper") as caught:
        pickle_factory(KeepingFactory(file), "KeepingFactory", "Loop 'eye'")
    assert "setup()" in caught.value.fix


def test_local_definitions_are_sent() -> None:
    class LocalFactory(KeepingFactory):
        def sum(self) -> int:
            return sum(act(2) for act in self.kept)

    three = 3
    assert unpack_again(LocalFactory(lambda x: x * three, lambda x: x + three)).sum() == 11


def test_self_reference_is_sent_and_restored() -> None:
    factory = KeepingFactory(Inner(1), key={"a": (1, 2)})
    factory.kept.append(factory)
    back = unpack_again(factory)
    assert back.kept[1] is back
    assert back.reload_targets == [os]
    assert back.named == factory.named
    assert pickle.loads(pickle.dumps(back.kept[0].value)) == 1


def test_unpicklable_self_reference_is_named() -> None:
    factory = KeepingFactory()
    factory.kept += [factory, threading.Lock()]
    with pytest.raises(ConfigError, match=r"`kept\[1\]` cannot be sent there: lock"):
        pickle_factory(factory, "KeepingFactory", "Loop 'eye'")
