"""Random and mutated input to every parser of bytes from outside: the wire, files of other people, the browser.

    python tests/fuzz_parsers.py lander=runs/RUN/trace.jsonl --minutes 60 [--seed N] [--only trace]

Each input must be parsed, or refused with one of the parser's own errors, within a bounded CPU time and memory for its
size. What is found is printed and kept, with its seed. The ordinary suite runs a fraction of this
(test_parsers.py), and each input that was once found.
"""

from __future__ import annotations

import argparse
import io
import random
import sys
import tempfile
import time
import traceback
import tracemalloc
from collections.abc import Callable, Iterator
from contextlib import redirect_stderr, redirect_stdout, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from snr_sim import Page
from snr_sim.behaviors.language import parse as parse_lrp
from snr_sim.behaviors.reader import MAX_CHARACTERS
from snr_sim.cli.trace import trace as snr_trace
from snr_sim.console.commands import TABLE
from snr_sim.console.parsing import parse as parse_command
from snr_sim.console.wire import decode_request, decode_response
from snr_sim.devices.wire import (
    json_frames,
    lease_messages,
    mcu_frames,
    mcu_messages,
    sbp_frames,
    vesc_frames,
    vesc_messages,
)
from snr_sim.devices.wire.nmea import NmeaLines, checksum
from snr_sim.devices.wire.sbp_messages import decode as decode_sbp
from snr_sim.grading.lab.verdicts import SubmissionError
from snr_sim.grading.remote import protocol
from snr_sim.learning.discretiser import Discretiser
from snr_sim.learning.q_table import QTable
from snr_sim.links.frames import encode_frame
from snr_sim.links.messages import (
    Auth,
    Bye,
    HelloMessage,
    Ping,
    Pong,
    RefusedMessage,
    decode_message,
    decode_page,
    encode_message,
)
from snr_sim.links.session import Session, SessionConfig
from snr_sim.prelude.errors import SnrError
from snr_sim.prelude.values import decode_value, encode_value
from snr_sim.recording.compare_runs import compare_runs
from snr_sim.recording.folder import trace_warnings
from snr_sim.recording.page_reader import PageReader
from snr_sim.recording.reader import read_trace
from snr_sim.recording.sources import read_kept_files
from snr_sim.scenario.replay_files import files_of_replay
from snr_sim.view.picture import draw_run
from snr_sim.view.view import view_of
from snr_sim.web.messages import decode_from_page
from snr_sim.web.timeline import RecordedTimeline
from tests.slowness import slowness

MAX_CPU_S_PER_100_KB = 0.1  # times are those of an AMD EPYC
MIN_CPU_S = 0.05  # an input of any size may take this long: the first calls fill caches
MAX_MEMORY_FACTOR = 30.0  # an empty list is three bytes of JSON and 56 of memory
MIN_MEMORY_BYTES = 4 << 20
PICTURE_BYTES = 16 << 20  # 9 MB for a valid trace, too: the canvas
MAX_BYTES = 120_000


@dataclass(frozen=True)
class Parser:
    """A function of bytes, valid inputs of it, and the exceptions that refuse an input."""

    parse: Callable[[bytes], object]
    seeds: list[bytes]
    refusals: tuple[type[Exception], ...] = (SnrError,)
    weight: float = 1.0
    max_bytes: int = MAX_BYTES
    max_cpu_s: float = MIN_CPU_S
    min_memory_bytes: int = MIN_MEMORY_BYTES


# -- inputs -----------------------------------------------------------------------------------------------------------

TOKENS = [
    *(b"", b"\0", b"\xff", b"\xed\xa0\x80", b"\n", b"\r\n", b" ", b"\t", b"9" * 30, b"9" * 400, b"a" * 300, b"0" * 64),
    *(
        b"\x1b[2J",
        "é𝕊".encode(),
        b" a",
        b"if ",
        b"not ",
        b"*47\r\n",
        b"\xa1",
        b"\0\0",
        b"\x02\x01",
        b"PK\x03\x04",
        b'"',
    ),
    *rb"""\ \u0024 \ud800 $ , [ ] { } [[ [] [], {} {}, ( ) ((( : * # ; ' ''' 0 1, -1 1e400 -0 1.5, 0.1 NaN Infinity
    null true {"$":"float","v":"nan"} {"$":"tuple","v":[ {"$":"int","v":"0x {"$":"dict","v":[ {"$":"bytes","v":"
    {"$":"array","dtype":"float64","shape":[ {"$":"object","type":"a.B","fields":{}} {"a": "a":1, "\ a- -> := [x x.y (a
    lambda: $GPGGA, ../ /etc/ 1e300,""".split(),
]


def mutated(rng: random.Random, seeds: list[bytes], max_bytes: int) -> bytes:
    """Return a valid input with some changes, or one with a part of it repeated up to `max_bytes`."""
    data = bytearray(rng.choice(seeds))
    for _ in range(rng.choice((0, 1, 1, 2, 4, 10))):
        at = rng.randrange(len(data) + 1)
        match rng.randrange(8):
            case 0 if data:
                data[at % len(data)] = rng.randrange(256)
            case 1:
                data[at:at] = rng.choice(TOKENS)
            case 2:
                del data[at : at + rng.choice((1, 2, 10, 100))]
            case 3:
                data[at:at] = data[at : at + rng.choice((1, 5, 40, 400))]
            case 4:
                other = rng.choice(seeds)
                start = rng.randrange(len(other) + 1)
                data[at:] = other[start:]
            case 5:
                data[at : at + rng.randrange(6)] = rng.choice(TOKENS)
            case 6:
                data[at:at] = rng.randbytes(rng.randrange(20))
            case _:
                data = _number_changed(rng, data, at)
    if rng.random() < 0.3:
        at, end = sorted((rng.randrange(len(data) + 1), rng.randrange(len(data) + 1)))
        unit = bytes(data[at:end][:200]) if rng.random() < 0.4 else b"".join(rng.choices(TOKENS, k=rng.randrange(1, 4)))
        if unit:
            count = min(rng.choice((10, 100, 1000, max_bytes)), max_bytes // len(unit) + 1)
            data[at : at if rng.random() < 0.5 else end] = unit * count
            if rng.random() < 0.3:  # closed again
                closing = {b"["[0]: b"]", b"{"[0]: b"}", b"("[0]: b")"}
                data[at + len(unit) * count : at + len(unit) * count] = (
                    b"".join(closing[c] for c in reversed(unit) if c in closing) * count
                )
    return bytes(data[:max_bytes])


def _number_changed(rng: random.Random, data: bytearray, at: int) -> bytearray:
    digits = next((i for i in range(at, len(data)) if 48 <= data[i] < 58), None)
    if digits is None:
        return data
    end = next((i for i in range(digits, len(data)) if not 48 <= data[i] < 58), len(data))
    new = rng.choice(
        (b"0", b"-1", b"1e9", b"1e308", b"-1e308", b"99999999999", b"18446744073709551616", b'"x"', b"null")
    )
    return data[:digits] + new + data[end:]


# -- parsers ----------------------------------------------------------------------------------------------------------


def _session(is_server: bool, secret: bytes | None = None) -> Callable[[bytes], object]:
    def parse(data: bytes) -> object:
        session = Session(SessionConfig("here", is_server, secret), 0.0, nonce=b"n" * 16)
        for i, start in enumerate(range(0, len(data), 8192)):
            session.receive(data[start : start + 8192], 0.1 * i)
            session.take_output()
        return session.reason

    return parse


def _frames(data: bytes) -> object:
    reader = mcu_frames.McuFrames()
    return [reader.feed(data[i : i + 1000]) for i in range(0, len(data), 1000)]


def _nmea(data: bytes) -> object:
    reader = NmeaLines()
    return [reader.feed(data[i : i + 100]) for i in range(0, len(data), 100)]


def _vesc(data: bytes) -> object:
    reader, codec = vesc_frames.VescFrames(), vesc_messages.VescCodec("seed", 228.0)
    pieces = (data[i : i + 100] for i in range(0, len(data), 100))
    return [codec.decode(one) for i, piece in enumerate(pieces) for one in reader.feed(piece, i * 0.01)]


def _sbp(data: bytes) -> object:
    reader = sbp_frames.SbpFrames()
    pieces = (data[i : i + 100] for i in range(0, len(data), 100))
    return [decode_sbp(one) for i, piece in enumerate(pieces) for one in reader.feed(piece, i * 0.01)]


def _json_devices(data: bytes) -> object:
    return json_frames.JsonFrames().feed(data, 0.0), json_frames.JsonLines().feed(data)


def _sentence(body: bytes) -> bytes:
    return b"$%s*%02X\r\n" % (body, checksum(body))


def _nmea_fields(data: bytes) -> object:
    """Parse sentences whose check sums are right."""
    return _nmea(b"".join(_sentence(line.replace(b"*", b"")) for line in data.split(b"\n")))


def _mcu_bodies(data: bytes) -> object:
    """Parse frames whose check sums are right."""
    bodies = [body for body in data.split(b"\xfe\xfe") if body]
    sealed = [body + mcu_frames.crc_hqx(body, 0).to_bytes(2, "big") for body in bodies]
    return _frames(b"".join(mcu_frames.cobs.encode(one) + b"\0" for one in sealed))


def _maestro(data: bytes) -> object:
    from snr_sim.devices.pwm.maestro import Maestro

    maestro = Maestro(lambda: _Port(data), iter(range(10**6)).__next__, 8, sleep=lambda _: None)
    maestro.open()
    return None


class _Port:
    name = "port"

    def __init__(self, data: bytes) -> None:
        self._pieces = iter([b"", *(data[i : i + 2] for i in range(0, len(data), 2))])

    def read(self) -> bytes:
        return next(self._pieces, b"")

    def write(self, data: bytes) -> None:
        pass

    def wait(self, seconds: float) -> bool:
        return False

    def close(self) -> None:
        pass


def _lrp(data: bytes) -> object:
    return parse_lrp(data.decode(errors="replace"))


def in_file(name: str, use: Callable[[Path], object]) -> Callable[[bytes], object]:
    """Return a parser of bytes from one of files in a folder."""
    folder = Path(tempfile.mkdtemp(prefix="fuzz_"))

    def parse(data: bytes) -> object:
        path = folder / name
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(data)
        for one in folder.glob("*.rrd"):
            one.unlink()
        return use(path)

    return parse


def _run_of(path: Path) -> object:
    """Use a trace as `snr trace` and `snr replay` do before they ask."""
    with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
        snr_trace(path, "", "", "", False)
    trace = read_trace(path)
    return trace_warnings(trace), files_of_replay(trace)


def _pages_of(path: Path) -> object:
    with PageReader(path) as reader:
        return list(reader), reader.warnings


def _timeline(path: Path) -> object:
    timeline = RecordedTimeline(path, "")
    try:
        timeline.read_all()
        return [timeline.state_at(t_s) for t_s in (0.0, 0.5 * timeline.until_s, timeline.until_s)]
    finally:
        timeline.close()


def _picture(path: Path) -> object:
    trace = read_trace(path)
    return draw_run(trace.header, trace.records, path.with_suffix(".png"), "held", None, True, {}, "")


def _compare(path: Path) -> object:
    trace = read_trace(path)
    return compare_runs(trace, trace)


def _table_seed() -> bytes:
    grid = Discretiser(("altitude_m", "speed_mps"), ((1.0, 2.0), (0.0,)))
    path = Path(tempfile.mkdtemp(prefix="fuzz_")) / "q.npz"
    QTable(grid, ["off", "on"], environment="x").save(path)
    return path.read_bytes()


def parsers(traces: dict[str, bytes]) -> dict[str, Parser]:
    """Return all parsers by name. `traces` are valid ones: of a dive or a landing, and of a machine."""
    pages = [
        Page("depth", data, "urov_node", 0.25).serialize()
        for data in (
            {"depth_m": 1.5, "ok": True, "words": ["a", None], "none": {}},
            [float("nan"), (1, 2), b"abc", {1: 2, (3, 4): 5}, 2**63],
            np.arange(6.0).reshape(2, 3),
            np.arange(300),
            [[]] * 10,
        )
    ]
    hello = encode_message(HelloMessage("snr", 2, "there", "0" * 32, "pages", False, 1 << 20))
    auth_hello = encode_message(HelloMessage("snr", 2, "there", "0" * 32, "pages", True, 1 << 20))
    controls = [*map(encode_message, (Ping(1.0), Pong(0.0), Bye("x"), Auth("0" * 64), RefusedMessage("no")))]
    json_errors = (SnrError, msgspec.MsgspecError, UnicodeDecodeError, RecursionError)
    framed = [b"".join(map(encode_frame, (hello, *pages, *controls))), b"".join(map(encode_frame, (hello, *pages)))]
    mcu = [
        mcu_messages.Hello(7), mcu_messages.SetWidths(7, 1, 2, 3, 4, (1500.0,) * 8), mcu_messages.Arm(7),
        mcu_messages.Ident(0, 7, 1, (1, 2), 8, 1100.0, 1500.0, 1900.0, 25.0, *(1,) * 6, "m328p", "board"),
        mcu_messages.Telemetry(
            1, 7, 3, 9, mcu_messages.McuState.ARMED, mcu_messages.McuFault(0), mcu_messages.ResetCause(1), 5, 0, 1, 2,
            (1500.0,) * 8,
        ),
        mcu_messages.CommandAck(2, 7, 3, mcu_messages.AckResult.DONE),
    ]  # fmt: skip
    bodies = [mcu_frames.cobs.decode(mcu_frames.encode(one)[:-1])[:-2] for one in mcu]
    nmea = [
        b"GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,",
        b"GPRMC,123519,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W",
    ]
    codec = vesc_messages.VescCodec("seed", 228.0)
    values = vesc_messages.MotorValues(1.0, 0.5, 0.2, 3.0, 24.0, 9.0, 40.0, "none")
    vesc = [values, vesc_messages.Firmware(2, 18, "60", bytes(12)), vesc_messages.Subscription("wheelLF")]
    sbp = [sbp_frames.SbpFrame(kind, bytes(size)) for kind, size in ((0x020A, 34), (0x020E, 22), (0x0208, 15))]
    lamp = {"lamp": 70, "list": [1.5, {"on": True}]}
    web: list[Any] = [
        {"kind": "edit", "number": 7, "text": "(machine dora ...", "base_sha256": "9" * 64},
        {"kind": "set", "path": "dora.side", "value": 1},
        {"kind": "do", "what": "pause"},
        {"kind": "give", "signal": "halt"},
        {"kind": "show", "t_s": 3.25},
        {"kind": "why", "machine": "dora", "transition": "bump", "from_s": 10.0, "until_s": 12.0},
    ]
    lrp = [path.read_bytes() for path in sorted(Path("robots").glob("*/controllers/*.lrp"))]
    lines = [b"show depth_m\n", b'store k1 {"a": [1, 2]}', b"watch depth_m 2", b"reload part", b"pages", b"dump x y z"]
    found = {
        "decode_value": Parser(decode_value, [encode_value(Page.deserialize(one).data) for one in pages]),
        "decode_page": Parser(decode_page, pages, json_errors),
        "decode_message": Parser(decode_message, [hello, *controls, *pages], json_errors),
        "session": Parser(_session(True), framed),
        "session_client": Parser(_session(False), framed),
        "session_secret": Parser(_session(True, b"s" * 16), [encode_frame(auth_hello) + encode_frame(controls[3])]),
        "console_request": Parser(
            decode_request, [b'{"$":"command","number":1,"line":"pages"}', *controls], json_errors
        ),
        "console_reply": Parser(
            decode_response,
            [b'{"$":"reply","number":1,"text":"x","data":[1,2],"is_error":false,"about":""}'],
            json_errors,
        ),
        "console_line": Parser(lambda data: parse_command(TABLE, data.decode(errors="replace")), lines),
        "lease": Parser(
            lease_messages.CODEC.decode, [lease_messages.CODEC.encode(lease_messages.Lease(1, [1500.0], 1.0, 0.2))]
        ),
        "mcu": Parser(_frames, [b"".join(map(mcu_frames.encode, mcu))]),
        "mcu_bodies": Parser(_mcu_bodies, [b"\xfe\xfe".join(bodies)]),
        "nmea": Parser(_nmea, [b"".join(map(_sentence, nmea))]),
        "nmea_fields": Parser(_nmea_fields, [b"\n".join(nmea)]),
        "vesc": Parser(_vesc, [b"".join(vesc_frames.encode(codec.encode(one)) for one in vesc)]),
        "sbp": Parser(_sbp, [b"".join(map(sbp_frames.encode, sbp))]),
        "json_devices": Parser(_json_devices, [json_frames.encode_frame(lamp) * 3, json_frames.encode_line(lamp) * 3]),
        "maestro": Parser(_maestro, [b"\0\0\0\0" + b"\x70\x2e" * 10 + b"\x20\0" + b"\x70\x17" * 8], weight=0.3),
        "web": Parser(decode_from_page, [msgspec.json.encode(one) for one in web], json_errors),
        "answer": Parser(
            protocol.decode_response, [b'{"n":7,"value":[1500,1550],"cpu_s":0.1}'], (SnrError, SubmissionError)
        ),
        "lrp": Parser(_lrp, lrp, weight=3.0, max_bytes=MAX_CHARACTERS, max_cpu_s=0.2, min_memory_bytes=8 << 20),
        "policy": Parser(in_file("q.npz", QTable.load), [_table_seed()]),
        "sources": Parser(
            in_file("sources/files.jsonl", lambda path: read_kept_files(path.parent.parent)),
            [b'{"path":"/home/x/mine.py","sha256":"%s","mark":"ab"}\n' % (b"0" * 64)],
        ),
        "recording": Parser(
            in_file("pages.jsonl", _pages_of),
            [
                b'{"$":"start","node":"a_node"}\n' + b"\n".join(pages),
                b'{"key":"a","data":NaN,"origin":"n","created_at_s":1}',
            ],
        ),
    }
    for name, data in traces.items():
        found[f"trace_{name}"] = Parser(in_file("trace.jsonl", _run_of), [data], weight=3.0)
        found[f"pages_{name}"] = Parser(in_file("trace.jsonl", _pages_of), [data])
        found[f"timeline_{name}"] = Parser(in_file("trace.jsonl", _timeline), [data])
        found[f"compare_{name}"] = Parser(in_file("trace.jsonl", _compare), [data], max_cpu_s=0.5)
        found[f"view_{name}"] = Parser(in_file("trace.jsonl", view_of), [data], max_cpu_s=1.0)
        found[f"picture_{name}"] = Parser(
            in_file("trace.jsonl", _picture), [data], weight=0.1, max_cpu_s=4.0, min_memory_bytes=PICTURE_BYTES
        )
    return found


def short_trace(data: bytes, lines: int = 60) -> bytes:
    """Return the beginning of a trace, which can be read like the whole."""
    return b"".join(data.splitlines(keepends=True)[:lines])


# -- trial ------------------------------------------------------------------------------------------------------------


def fault_of(parser: Parser, data: bytes, is_measured: bool) -> str:
    """Return what is wrong with how a parser handles this input, or an empty text."""
    if is_measured:
        tracemalloc.start()
    begun_s = time.thread_time()
    try:
        parser.parse(data)
    except parser.refusals:
        pass
    except Exception as error:
        where = traceback.extract_tb(error.__traceback__)[-1]
        return f"{type(error).__name__} at {Path(where.filename).name}:{where.lineno}: {str(error)[:200]}"
    finally:
        used_s = time.thread_time() - begun_s
        peak = tracemalloc.get_traced_memory()[1] if is_measured else 0
        tracemalloc.stop()
    if is_measured:  # then its time says nothing
        limit = max(parser.min_memory_bytes, MAX_MEMORY_FACTOR * len(data))
        return f"memory: {peak} bytes" if peak > limit else ""
    limit_s = slowness() * (parser.max_cpu_s + MAX_CPU_S_PER_100_KB * len(data) / 1e5)
    for _ in range(2 if used_s > limit_s else 0):  # the input, or a computer that was slow for a moment?
        begun_s = time.thread_time()
        with suppress(*parser.refusals):
            parser.parse(data)
        used_s = min(used_s, time.thread_time() - begun_s)
    return f"time: {used_s:.2f} s of {limit_s:.2f}" if used_s > limit_s else ""


def trials(all_parsers: dict[str, Parser], seed: int) -> Iterator[tuple[str, bytes, str]]:
    """Yield the name, the input and the fault of each trial, endlessly."""
    rng = random.Random(seed)
    names = list(all_parsers)
    weights = [all_parsers[name].weight for name in names]
    while True:
        (name,) = rng.choices(names, weights)
        parser = all_parsers[name]
        data = (
            rng.randbytes(rng.choice((1, 20, 1000)))
            if rng.random() < 0.02
            else mutated(rng, parser.seeds, parser.max_bytes)
        )
        yield name, data, fault_of(parser, data, rng.random() < 0.1)


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("traces", nargs="+", help="NAME=FILE: valid traces")
    options.add_argument("--minutes", type=float, default=1.0)
    options.add_argument("--seed", type=int, default=0)
    options.add_argument("--only", default="")
    options.add_argument("--keep", default="found", help="folder for the inputs that are found")
    given = options.parse_args()
    named = dict(one.split("=") for one in given.traces)
    chosen = parsers({name: short_trace(Path(path).read_bytes()) for name, path in named.items()})
    chosen = {name: one for name, one in chosen.items() if given.only in name}
    for name, parser in chosen.items():
        for data in parser.seeds:
            if fault := fault_of(parser, data, False):
                print(f"{name}, a seed: {fault}")
    until_s, count, seen = time.monotonic() + 60.0 * given.minutes, 0, {}
    Path(given.keep).mkdir(exist_ok=True)
    for name, data, fault in trials(chosen, given.seed):
        count += 1
        if fault:
            kind = (name, fault.partition(": ")[0])
            seen[kind] = seen.get(kind, 0) + 1
            if seen[kind] <= 3:
                path = Path(given.keep) / f"{name}-{len(seen)}-{seen[kind]}"
                path.write_bytes(data)
                print(f"{name} ({len(data)} bytes, {path}): {fault}", flush=True)
        if time.monotonic() > until_s:
            break
    print(count, "inputs", {" ".join(kind): number for kind, number in seen.items()})
    sys.exit(bool(seen))


if __name__ == "__main__":
    main()
