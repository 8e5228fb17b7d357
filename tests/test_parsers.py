"""Random and mutated input to every parser of bytes from outside; see fuzz_parsers.py."""

from __future__ import annotations

import base64
import zlib
from collections.abc import Callable
from itertools import islice
from pathlib import Path

import pytest

from snr_sim.prelude.errors import TraceError
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import run_recorded
from snr_sim.view.view import view_of
from snr_sim.web.timeline import inputs_in

from .fuzz_parsers import in_file, parsers, short_trace, trials


@pytest.fixture(scope="module")
def trace(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("run") / "trace.jsonl"
    run_recorded(prepare(Request("lander_vertical")), path)
    return short_trace(path.read_bytes())


def check(count: int, trace: bytes, is_of_interest: Callable[[str], bool]) -> None:
    tried = islice(trials(parsers({"lander": trace}), 0), count)
    faults = [
        f"{name}: {fault}; zlib.decompress(b64decode({base64.b64encode(zlib.compress(data))[:20_000]!r}))"
        for name, data, fault in tried
        if is_of_interest(fault)
    ]
    assert not faults, "\n".join(faults)


@pytest.mark.slow
def test_500_mutated_inputs_are_parsed_or_refused(trace: bytes) -> None:
    check(500, trace, lambda fault: bool(fault) and not fault.startswith("time"))


@pytest.mark.nightly(minutes=5)
def test_20_000_mutated_inputs_are_parsed_or_refused_in_little_time(trace: bytes) -> None:
    check(20_000, trace, bool)


def test_damaged_name_of_an_input_is_left_out_of_a_timeline(tmp_path: Path) -> None:
    lines = [b'{"kind":"input","type":"store_page","name":"%s",' % name for name in (b"depth", b"\\ud800", b"a\tb")]
    (tmp_path / "trace.jsonl").write_bytes(b"\n".join([*lines, b""]))
    assert inputs_in(tmp_path / "trace.jsonl") == ["depth"]


@pytest.mark.slow
def test_view_of_a_damaged_scene_names_it(trace: bytes) -> None:
    with pytest.raises(TraceError, match="the scene in its header is damaged"):
        in_file("trace.jsonl", view_of)(trace.replace(b'"triangles":[[', b'"triangles":[[99999', 1))
