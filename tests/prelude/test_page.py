import ast
import dataclasses
import subprocess
import sys
from pathlib import Path
from typing import Any

import msgspec
import pytest

import snr_sim
from snr_sim.prelude.task import ensure_type_info

KIT = Path(snr_sim.__file__).parent
PLAIN = {"int", "float", "str", "bool", "bytes", "Any"}  # types of which there is nothing to learn

TWO_THREADS_AT_ONCE = """
import sys
from threading import Barrier, Thread
import msgspec
from snr_sim.devices.commands import command_of
from snr_sim.devices.replayed import ReplayedSensor
from snr_sim.prelude.task import Page
from snr_sim.prelude.task import ensure_type_info

def read(data, kind):
    return ReplayedSensor("imu", [Page("imu", data, "node", 0.0)], kind, lambda: 1.0).read()

make = {{
    "ensure_type_info": lambda data, kind: msgspec.convert(data, ensure_type_info(kind)),
    "command": lambda data, kind: command_of(data, kind, {{}}),
    "replayed": read,
}}["{way}"]
sys.setswitchinterval(1e-6)
inner = {{"a": 1.0, "b": [1], "c": {{"d": 0.5}}}}
for i in range({types}):
    part = msgspec.defstruct(f"Part{{i}}", [("a", float), ("b", list[int]), ("c", dict[str, float])])
    whole = msgspec.defstruct(f"Whole{{i}}", [(f"x{{j}}", part) for j in range(20)])
    data = {{f"x{{j}}": inner for j in range(20)}}
    gate, made = Barrier(2), []

    def run():
        gate.wait()
        made.append(make(data, whole))

    threads = [Thread(target=run) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(made) == 2 and made[0] == made[1] and made[0].x19.c == {{"d": 0.5}}
"""


@pytest.mark.slow
@pytest.mark.parametrize("way", ["ensure_type_info", "command", "replayed"])
def test_first_use_of_a_type_in_two_threads_is_safe(way: str) -> None:
    program = TWO_THREADS_AT_ONCE.format(way=way, types=150)
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=300)
    assert (run.returncode, run.stderr) == (0, "")


def test_ensure_type_info_returns_the_type() -> None:
    @dataclasses.dataclass
    class Depth:
        depth_m: float

    assert ensure_type_info(Depth) is Depth
    assert msgspec.convert({"depth_m": 1.5}, ensure_type_info(Depth)) == Depth(1.5)
    assert msgspec.convert([1, 2.5], ensure_type_info(list[float])) == [1.0, 2.5]


def test_unsupported_type_raises_at_once() -> None:
    with pytest.raises(TypeError, match="union"):
        ensure_type_info(dict[str, int] | dict[str, float])


def test_every_decoded_type_is_initialised_at_import_or_ensured() -> None:
    """Functions do not create decoders, and they decode or convert only types passed to `ensure_type_info`."""
    content = [KIT.parent / folder for folder in ("robots", "scenarios", "assignments")]
    files = [path for folder in (KIT, *content) for path in folder.rglob("*.py")]
    texts = {path: path.read_text(encoding="utf-8") for path in files}
    decoding = {path: text for path, text in texts.items() if "convert(" in text or "ecode" in text}  # saves a second
    wrong = [f"{path}:{line}" for path, text in decoding.items() for line in _learns_late(ast.parse(text))]
    assert wrong == []


def test_late_type_initialisation_is_found() -> None:
    late = (
        "def f(raw):\n    msgspec.convert(raw, Depth)\n    decode(raw, type=Depth)\n    msgspec.json.Decoder(Depth)\n"
    )
    assert sorted(_learns_late(ast.parse(late))) == [2, 3, 4]
    fine = "d = Decoder(Depth)\ndef f(raw):\n    convert(raw, ensure_type_info(Depth))\n    decode(raw, type=int)\n"
    assert list(_learns_late(ast.parse(fine))) == []


def _learns_late(tree: ast.Module) -> set[int]:
    functions = [node for node in ast.walk(tree) if isinstance(node, (ast.FunctionDef, ast.Lambda))]
    functions = [one for one in functions if getattr(one, "name", "") != "_build_decoder"]  # that of ensure_type_info
    calls = [node for function in functions for node in ast.walk(function) if isinstance(node, ast.Call)]
    return {call.lineno for call in calls for kind in _kinds(call) if not _is_known(kind)}


def _kinds(call: ast.Call) -> list[Any]:
    """The types that a call gives to msgspec."""
    name = getattr(call.func, "attr", getattr(call.func, "id", ""))
    named = [word.value for word in call.keywords if word.arg == "type"]
    return {"convert": [*call.args[1:], *named], "Decoder": [*call.args, *named], "decode": named}.get(name, [])


def _is_known(kind: ast.expr) -> bool:
    if isinstance(kind, ast.Call):
        return getattr(kind.func, "id", "") == "ensure_type_info"
    return isinstance(kind, ast.Name) and kind.id in PLAIN
