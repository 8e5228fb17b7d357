"""The schema of traces: every line of every kind of run is valid, and what it refuses the reader refuses, too."""

import json
import re
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from snr_sim import Config, SimClock, SimRunner, TaskType
from snr_sim.links.memory import MemoryLink
from snr_sim.prelude.errors import ComponentFailedError, SnrError, ValueEncodingError
from snr_sim.prelude.task import KINDS
from snr_sim.prelude.values import decode_value
from snr_sim.recording.reader import Trace, read_trace
from snr_sim.recording.records import Record, encode_record
from snr_sim.recording.replay import replay_node
from snr_sim.recording.trace import FILE_NAME, TraceWriter
from snr_sim.scenario.program import program_header
from snr_sim.testing.function_components import FunctionEndpointFactory, FunctionLoopFactory

Validator = Callable[..., Callable[[Any], bool]]

UNUSUAL: list[Any] = [
    float("nan"), -0.0, 2**70, (1, {2, "three"}), {5: "five", "$": 6}, b"\x00\xff", "Grüße\u2028\n",
    np.eye(2), np.array([np.inf, 1], np.float32), np.arange(300), np.array([1j]), np.int8(-3), np.array(["ab"]),
    object(), ValueError("no data"),
]  # fmt: skip


def lines_of(path: Path) -> list[bytes]:
    """The lines of a trace, without their ends."""
    return path.read_bytes().split(b"\n")[:-1]


def check(validator: Validator, path: Path) -> None:
    """Each line is valid. Of lines that differ in nothing but the digits of their numbers, one is looked at."""
    is_valid = validator("trace")
    shapes = {line if b"b64" in line else re.sub(rb"\d+", b"1", line): line for line in lines_of(path)}
    assert [line for line in shapes.values() if not is_valid(json.loads(line))] == []


def record(path: Path, roles: dict[str, list[Any]], links: Any = ()) -> Path:
    config = Config(factories=roles)
    clock = SimClock()
    writer = TraceWriter(path / FILE_NAME, program_header(list(roles), config, __file__, clock))
    try:
        SimRunner(config, clock=clock, recorder=writer, links=links, until_s=0.35).run()
    finally:
        writer.close()
    return writer.path


def clock_loop(key: str = "time") -> FunctionLoopFactory:
    return FunctionLoopFactory(lambda loop: loop.store_data(key, loop.get_time_s()), key)


@pytest.mark.parametrize(
    ("scenario", "controller"),
    [
        ("lander_vertical", "coast"),
        ("lander_vertical", "optimal"),
        ("lander_low_gate", "optimal"),
        ("lander_pad", "pad"),
        ("lander_rough", "pad"),
    ],
)
def test_every_line_of_a_run_is_valid(
    validator: Validator, record_scenario: Callable[..., Trace], scenario: str, controller: str
) -> None:
    check(validator, record_scenario(scenario, controller).path)


def unusual() -> dict[str, list[Any]]:
    def begin(part: Any) -> None:
        for i, value in enumerate(UNUSUAL):
            part.store_data(f"value{i}", value)

    return {"r": [FunctionEndpointFactory(begin=begin), clock_loop()]}


def test_every_line_of_a_run_with_unusual_values_is_valid(validator: Validator, tmp_path: Path) -> None:
    check(validator, record(tmp_path, unusual()))


def raising(error: BaseException) -> dict[str, list[Any]]:
    def on_time(task: Any, task_id: Any) -> None:
        raise error

    return {"r": [clock_loop(), FunctionEndpointFactory({(TaskType.process_data, "time"): on_time})]}


@pytest.mark.parametrize("error", [ValueError("by the student"), KeyboardInterrupt()])
def test_every_line_of_a_run_that_failed_or_was_interrupted_is_valid(
    validator: Validator, tmp_path: Path, error: BaseException
) -> None:
    with suppress(ComponentFailedError, KeyboardInterrupt):
        record(tmp_path, raising(error))
    assert b'"kind":"error"' in (tmp_path / FILE_NAME).read_bytes()
    check(validator, tmp_path / FILE_NAME)


def test_every_line_of_a_run_of_two_nodes_is_valid(validator: Validator, tmp_path: Path) -> None:
    link = MemoryLink(["a"], "one", "two", latency_s=0.01)
    path = record(tmp_path, {"one": [clock_loop("a")], "two": [clock_loop("b")]}, [link])
    assert {json.loads(line).get("node") for line in lines_of(path)} >= {"one_node", "two_node"}
    check(validator, path)


def test_every_record_of_replay_is_valid(tmp_path: Path) -> None:
    replay = replay_node(read_trace(record(tmp_path, unusual())), "r", Config(factories=unusual()))
    assert replay.is_identical
    decode = msgspec.json.Decoder(Record).decode
    assert all(decode(encode_record(one)) == one for one in replay.records)


# What the schema refuses the reader refuses, and the other way round


def damaged(value: Any, at_root: bool = True) -> Iterator[tuple[str, Any]]:
    """Yields a JSON value with each of its fields taken out or of another type, and objects with one more."""
    if isinstance(value, dict):
        yield "one more", value | {"more": 1}
        for key, item in value.items():
            yield f"no {key}", {name: other for name, other in value.items() if name != key}
            for how, other in damaged(item, at_root=False):
                yield f"{key} {how}", value | {key: other}
    elif isinstance(value, list):
        yield "longer", [*value, value[-1] if value else "x"]
        yield "shorter", value[:-1]
        for i, item in enumerate(value[:3]):
            for how, other in damaged(item, at_root=False):
                yield f"[{i}] {how}", [*value[:i], other, *value[i + 1 :]]
    if not at_root:
        for other in (None, True, -1, 1.5, "x", [], {}, {"$": "x"}):
            yield f"is {other}", other


@pytest.fixture(scope="module")
def samples(tmp_path_factory: pytest.TempPathFactory) -> list[bytes]:
    """A short trace with at least one line of each kind."""
    path = tmp_path_factory.mktemp("samples")
    with suppress(ComponentFailedError):
        record(path, raising(ValueError("by the student")))
    lines = lines_of(path / FILE_NAME)
    end = json.loads(lines.pop())
    truth = {"kind": "truth", "seq": end["seq"], "t": 0.1, "poses": {"module": [0.0] * 7}, "vectors": {"up": [1.0] * 6}}
    truth["values"] = {"altitude_m": 1.0}
    brought = next(one for one in map(json.loads, lines) if one["kind"] == "input")
    repeat = {"kind": "repeat", "seq": end["seq"] + 1, "t": 0.1, "node": "r_node", "source": "link_r"}
    repeat |= {"cause": brought["seq"], "index": 0}
    end["seq"] += 2
    return [*lines, *(json.dumps(one).encode() for one in (truth, repeat, end))]


def reads(path: Path, lines: list[bytes]) -> bool:
    """Whether a trace of these lines can be read, with all values in it."""
    path.write_bytes(b"".join(line + b"\n" for line in lines))
    try:
        trace = read_trace(path)
        for one in trace.records:
            fields = json.loads(encode_record(one))
            returned = [*fields.get("returned", []), *(task for by in fields.get("handled", []) for task in by[2])]
            for values in (fields.get("values") if fields["kind"] != "truth" else [], *(task[2] for task in returned)):
                decode_value(json.dumps(values), KINDS)
    except SnrError as error:
        assert isinstance(error, ValueEncodingError) or str(path) in str(error)
        return False
    return True


@pytest.mark.parametrize(
    "kind", ["trace", "header", "begin", "input", "repeat", "task", "page", "truth", "error", "end"]
)
def test_reader_and_schema_reject_the_same_damage(
    validator: Validator, samples: list[bytes], tmp_path: Path, kind: str
) -> None:
    is_valid = validator("trace")
    places = [place for place, line in enumerate(samples) if json.loads(line)["kind"] == kind]
    place = max(places, key=lambda place: len(samples[place]))  # the one with most in it
    assert reads(tmp_path / FILE_NAME, samples)
    refused = 0
    for how, line in damaged(json.loads(samples[place])):
        lines = [*samples[:place], json.dumps(line).encode(), *samples[place + 1 :]]
        is_read = reads(tmp_path / FILE_NAME, lines)
        assert is_read == is_valid(line), (how, line)
        refused += not is_read
    assert refused > 20
