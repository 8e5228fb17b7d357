"""A program of the standard library alone, written from docs/formats.md, reads what the kit records."""

import hashlib
import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from snr_sim import Config, SimClock, SimRunner
from snr_sim.prelude.task import KINDS
from snr_sim.prelude.values import decode_value, encode_value
from snr_sim.recording.reader import Trace, read_trace
from snr_sim.recording.records import PageRecord
from snr_sim.recording.trace import FILE_NAME, TraceWriter
from snr_sim.scenario.program import program_header
from snr_sim.testing.function_components import FunctionEndpointFactory

CLIENT = Path(__file__).parent / "plain_client.py"
FORMATS = Path(__file__).parents[2] / "docs" / "formats.md"
BARE = [sys.executable, "-I", "-S"]  # without the kit, and all else that is installed


def run(*words: Any) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*BARE, CLIENT, *map(str, words)], capture_output=True, text=True, timeout=60)


@pytest.mark.slow
def test_reader_has_130_lines_at_most_and_does_not_import_snr_sim() -> None:
    assert len(CLIENT.read_text().splitlines()) <= 130
    for package in ("snr_sim", "msgspec"):
        assert subprocess.run([*BARE, "-c", f"import {package}"], capture_output=True).returncode == 1


@pytest.mark.slow
def test_reader_reads_a_run_of_a_scenario(record_scenario: Callable[..., Trace]) -> None:
    trace = record_scenario("lander_low_gate", "optimal")
    done = run("trace", trace.path, "engine")
    assert done.returncode == 0, done.stderr
    digest, state, *history = done.stdout.splitlines()
    assert digest == f"digest {trace.digest}"
    assert state == f"whole {len(trace.records)}"
    pages = [one for one in trace.records if isinstance(one, PageRecord) and one.name == "engine"]
    assert len(pages) > 5
    for one, line in zip(pages, history, strict=True):
        page = decode_value(bytes(one.values), KINDS)[0]
        assert line == f"{one.t} {page.created_at_s} {page.data!r}"


VALUES: list[Any] = [
    float("nan"), [float("inf"), -0.0, 1e16], 2**70, -(2**63) - 1, (1, {"a": (2.5,)}), b"\x00\xff",
    {3: "three", "$": None}, "Grüße\u2028\n$", True,
]  # fmt: skip


@pytest.fixture
def unusual(tmp_path: Path) -> Trace:
    """A trace of pages with values that JSON alone would lose."""

    def begin(part: Any) -> None:
        for value in [*VALUES, np.arange(300, dtype=np.int16), np.float32([[0.5]]), {5}]:
            part.store_data("x", value)

    config = Config(factories={"r": [FunctionEndpointFactory(begin=begin)]})
    writer = TraceWriter(tmp_path / FILE_NAME, program_header(["r"], config, __file__, SimClock()))
    SimRunner(config, clock=SimClock(), recorder=writer, until_s=0.1).run()
    writer.close()
    return read_trace(writer.path)


@pytest.mark.slow
def test_reader_returns_marked_values(unusual: Trace) -> None:
    done = run("trace", unusual.path, "x")
    assert done.returncode == 0, done.stderr
    values = [line.split(" ", 2)[2] for line in done.stdout.splitlines()[2:]]
    assert values[: len(VALUES)] == [repr(value) for value in VALUES]
    numbers, matrix, other = values[len(VALUES) :]
    assert numbers == repr({"shape": [300], "flat": tuple(range(300))})
    assert matrix == "[[0.5]]"
    assert other == repr({"$": "object", "type": "builtins.set", "fields": {"items": [5]}})


@pytest.mark.slow
def test_reader_rejects_keys_that_were_computed_to_have_one_hash(unusual: Trace) -> None:
    lines = unusual.path.read_bytes().splitlines(keepends=True)
    pairs = ",".join(f'[{{"$":"int","v":"{hex(5 + k * sys.hash_info.modulus)}"}},0]' for k in range(10, 75))
    lines.append(b'{"seq":%d,"kind":"input","values":[{"$":"dict","v":[%s]}]}\n' % (len(lines) - 1, pairs.encode()))
    unusual.path.write_bytes(b"".join(lines))
    assert "more than 64 keys of a dict have the same hash" in run("trace", unusual.path).stderr


@pytest.mark.slow
def test_reader_ignores_a_truncated_tail_and_rejects_a_moved_line(unusual: Trace) -> None:
    data = unusual.path.read_bytes()
    unusual.path.write_bytes(data[:-5])
    cut = read_trace(unusual.path)
    assert run("trace", unusual.path).stdout.split() == ["digest", cut.digest, "cut", str(len(cut.records))]
    unusual.path.write_bytes(unusual.path.read_bytes() + bytes(4096) + b"\n{}\n")  # as after a loss of power
    assert run("trace", unusual.path).stdout.split() == ["digest", cut.digest, "cut", str(len(cut.records))]
    assert read_trace(unusual.path).digest == cut.digest
    lines = data.splitlines(keepends=True)
    unusual.path.write_bytes(b"".join([*lines[:5], lines[6], lines[5], *lines[7:]]))
    assert "missing or moved" in run("trace", unusual.path).stderr


# The examples of the page itself


def test_digest_of_the_example_equals_the_documented_one(tmp_path: Path) -> None:
    text = FORMATS.read_text(encoding="utf-8")
    data = b'{"kind":"trace"}\n{"kind":"header"}\n{"seq":1}\n{"se'
    for line in data.decode().splitlines()[:3]:
        assert f"\n    {line}\n" in text
    digest = hashlib.blake2b(data[data.index(b"\n") + 1 : data.rindex(b"\n") + 1], digest_size=32).hexdigest()
    assert f"\n    {digest}\n" in text


@pytest.mark.slow
def test_digest_equals_that_computed_by_a_shell(record_scenario: Callable[..., Trace]) -> None:
    trace = record_scenario("lander_low_gate", "optimal")
    command = f"tail -n +2 '{trace.path}' | b2sum -l 256"
    assert command.replace(f"'{trace.path}'", "trace.jsonl") in FORMATS.read_text(encoding="utf-8")
    if missing := [tool for tool in ("bash", "b2sum") if shutil.which(tool) is None]:
        pytest.skip(f"not on this system: {', '.join(missing)}")
    done = subprocess.run(["bash", "-c", f"set -o pipefail; {command}"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split()[0] == trace.digest


def test_documented_values_equal_written_ones(validator: Any) -> None:
    shown = {
        '{"$":"float","v":"nan"}': float("nan"),
        '{"$":"int","v":"0x10000000000000000"}': 2**64,  # marked among marked ones
        '{"$":"bytes","v":"AP8="}': b"\x00\xff",
        '{"$":"tuple","v":[1,2.5]}': (1, 2.5),
        '{"$":"dict","v":[[3,"three"]]}': {3: "three"},
        '{"$":"array","dtype":"float64","shape":[2],"data":[0.5,1.0]}': np.array([0.5, 1.0]),
    }
    text = FORMATS.read_text(encoding="utf-8")
    for example, value in shown.items():
        assert f"`{example}`" in text
        assert encode_value([value, ()]).decode() == f'[{example},{{"$":"tuple","v":[]}}]'
        assert validator("value")(json.loads(example))
