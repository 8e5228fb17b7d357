"""Random input of every kind to a console: bytes at the port, lines, JSON values, sequences of valid commands.

    python tests/console/fuzz_console.py --count 1000000 [--seed N] [--only lines]

The node is a real one. After every input: the node runs unless a command ended it, a rejected input has changed
nothing, the answer is bounded. At the end: it handles a task, has the same components, and neither memory nor any
table in it has grown beyond its limit. The ordinary suite runs a fraction of this (test_fuzz.py).
"""

from __future__ import annotations

import argparse
import logging
import random
import socket
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import msgspec

from snr_sim import CommandReceiverFactory, Config, ConsoleClient, Node, SimClock, Task, TaskType, tasks
from snr_sim.console.command_receiver import LINES_AT_ONCE, LINES_PER_S, MAX_OUTPUT_BYTES, ConsoleProtocol
from snr_sim.console.commands import TABLE
from snr_sim.console.formatting import MAX_TEXT_CHARS
from snr_sim.console.parsing import CommandResult
from snr_sim.console.session import MAX_NEW_NAMES, ConsoleSession
from snr_sim.console.wire import PURPOSE, CommandMessage, CompleteMessage, decode_response, encode_request
from snr_sim.links.frames import HEADER_BYTES, MAX_FRAME_BYTES, encode_frame
from snr_sim.links.security import as_secret
from snr_sim.links.session import Session as WireSession
from snr_sim.links.session import SessionConfig
from snr_sim.links.token_bucket import TokenBucket
from snr_sim.prelude.errors import SnrError
from snr_sim.prelude.values import encode_value
from snr_sim.testing.function_components import FunctionEndpointFactory, FunctionLoopFactory

TOKEN = "a token of at least sixteen bytes"
KEYS = ("depth_m", "engine", "beat", "link_topside", "k1", "k2", "reload", "_prev", "depth_m_prev")
NAMES = ("start", "stop", "part", "failing", "ticker", "all", "node_core", "add_component", "remove_component")
WORDS = (
    *TABLE, *KEYS, *NAMES, *(kind.value for kind in TaskType), "components", "pages", "links", "loops", "profiler",
    "datastore", "NaN", "Infinity", "null", "true", "1e400", "-0", "1.5", "[]", "{}", '""', '"', "[", "]", "{", "}",
    "\\", '"\\', '"\\ud800"', "__class__", "{'a': 1}", "\x00", "\x1b[2J", "\n", "\u2028", "\ud800", "𝕊", "é" * 50,
)  # fmt: skip
MAX_MEMORY_MB = 60.0  # maximum growth of the process after the warm-up


class Errors(logging.Handler):
    """Collects errors logged by the node and the console."""

    def __init__(self) -> None:
        super().__init__(logging.ERROR)
        self.records: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.records.append(f"{record.getMessage()} {record.exc_info}")


class FailingFactory(FunctionEndpointFactory):
    """Makes its endpoint once; a reload fails, and keeps the endpoint."""

    made = 0

    def get(self, parent: Node) -> Any:
        self.made += 1
        if self.made > 1:
            raise ValueError("once is enough")
        return super().get(parent)


class Subject:
    """A real node in lock step, run by hand, with its invariants."""

    def __init__(self) -> None:
        self.started = 0
        handlers = {(TaskType.event, "start"): self._start, (TaskType.process_data, "depth_m"): lambda *_: None}

        self.clock = SimClock()
        factories = [
            FunctionEndpointFactory(handlers),
            FailingFactory({(TaskType.event, "stop"): lambda *_: None}, "failing"),
            FunctionLoopFactory(lambda loop: loop.store_data("beat", loop.get_time_s()), rate_hz=10.0),
        ]
        self.node = Node("urov", Config(factories={"urov": factories}), clock=self.clock)
        self.node.begin()
        self.clock.run_next()
        self.node.run_ready()
        self._new_names: set[str] = set()
        self.session = self.new_session()
        self.errors = Errors()
        logging.getLogger("snr").addHandler(self.errors)

    def new_session(self) -> ConsoleSession:
        return ConsoleSession(self.node, TABLE, new_names=self._new_names)

    def _start(self, task: Task, task_id: Any) -> None:
        self.started += 1

    def settle(self) -> None:
        self.node.run_ready()

    def close(self) -> None:
        """Check the invariants at the end."""
        node = self.node
        assert self.errors.records == [], self.errors.records[:3]
        if not node.is_terminated:
            before = self.started
            assert not self.new_session().execute("task start").is_error
            self.settle()
            assert self.started == before + 1
        assert set(node.components) == {"node_core", "part", "failing", "ticker"}
        assert len(node.datastore.pages) <= MAX_NEW_NAMES + 10
        assert sum(map(len, node.machine.lookup.seen_tasks().values())) <= 3 * MAX_NEW_NAMES
        assert len(node.notes) < 100
        assert len(node.datastore.missed) < 10
        logging.getLogger("snr").removeHandler(self.errors)
        with suppress(SnrError):
            node.end()

    def line(self, line: str) -> CommandResult:
        """Execute a line, and check the invariants of any line."""
        node, waiting, stored = self.node, len(self.node.inbox.waiting), self.node.datastore.stored
        answer = self.session.execute(line)
        assert len(answer.text) <= MAX_TEXT_CHARS + 100
        assert answer.text.replace("\n", "").isprintable() or answer.is_error, answer.text[:100]
        brought = len(node.inbox.waiting) - waiting
        assert brought <= (not answer.is_error), f"{line[:100]!r} was refused and did something"
        assert node.datastore.stored == stored
        was_over = node.is_terminated
        self.settle()
        if node.is_terminated and not was_over:
            assert {"exit", "terminate"} & set(line.split()), f"{line[:100]!r} has ended the node"
        if self.session.is_waiting:
            assert self.session.outcome(0.0) is not None
        return answer


def fuzz_lines(rng: random.Random, count: int) -> None:
    """Send words, known and unknown, in any order, with letters changed."""
    subject = Subject()
    for _ in range(count):
        line = "".join(rng.choice(WORDS) + rng.choice(("", " ", " ", " ", "\t")) for _ in range(rng.randrange(1, 7)))
        if rng.random() < 0.6:
            line = f"{rng.choice(tuple(TABLE))} {line}"
        if rng.random() < 0.2:
            line = valid_command(rng)
        if rng.random() < 0.5:
            line = mutated_text(rng, line)
        if rng.random() < 0.1:
            subject.session.complete(line)
        subject = after(subject, subject.line(line))
    subject.close()


def fuzz_values(rng: random.Random, count: int) -> None:
    """Store JSON values of any shape and depth, whole and damaged, and send them with events."""
    subject = Subject()
    for _ in range(count):
        text = msgspec.json.encode(value(rng, rng.choice((1, 3, 6)))).decode()
        if rng.random() < 0.1:
            text = rng.choice(("[", '{"a":')) * rng.randrange(40) + text
        if rng.random() < 0.4:
            text = mutated_text(rng, text)
        command = rng.choice(("store depth_m", "task start", "task event start", "task store_page k1"))
        answer = subject.line(f"{command} {text}")
        if not answer.is_error and rng.random() < 0.2:
            assert not subject.line("dump depth_m" if subject.node.get_data("depth_m") is not None else "list").is_error
        subject = after(subject, answer)
    subject.close()


def fuzz_commands(rng: random.Random, count: int) -> None:
    """Send valid commands in any order: all are executed, and all results are bounded."""
    subject = Subject()
    subject.line("store depth_m 1.0")
    now_s = 0.0
    for _ in range(count):
        command = valid_command(rng)
        answer = subject.line(command)
        assert not answer.is_error or command.split()[0] in ("unwatch", "watch", "reload"), f"{command}: {answer.text}"
        now_s += 0.05
        for change in subject.session.changes(now_s):
            assert change.about
        if rng.random() < 0.01:
            subject.session = subject.new_session()
        if rng.random() < 0.01 and subject.clock.next_s is not None:
            subject.clock.run_next()
            subject.settle()
    subject.close()


def fuzz_bytes(rng: random.Random, count: int) -> None:
    """Send bytes to a node's end: invalid data, damaged greetings, and damaged commands after a valid greeting."""
    subject = Subject()
    now_s, has_token, protocol = 0.0, False, None
    token_bucket = TokenBucket(LINES_PER_S, LINES_AT_ONCE)
    for _ in range(count):
        if protocol is None or protocol.is_over:
            has_token = rng.random() < 0.5
            is_greeted = rng.random() < 0.8
            protocol, far = line_to(subject, token_bucket, now_s, has_token, is_greeted)
        data = some_bytes(rng)
        if has_token and is_greeted and len(data) >= HEADER_BYTES and rng.random() < 0.9:
            data = far.seal(data)  # a console with the token sends invalid data
        protocol.receive(data, now_s)
        now_s += rng.choice((0.0, 0.2, 1.0))
        protocol.work(now_s)
        assert protocol.wire.is_up or not subject.node.inbox.waiting, "an unauthenticated client changed the node"
        assert len(protocol.output) <= MAX_OUTPUT_BYTES + MAX_FRAME_BYTES
        subject.settle()
        assert not subject.node.is_terminated
        if rng.random() < 0.5:
            protocol.output.clear()  # the console reads
    subject.close()


def line_to(
    subject: Subject, token_bucket: TokenBucket, now_s: float, has_token: bool, is_greeted: bool
) -> tuple[ConsoleProtocol, WireSession]:
    """Return a node's end of a new connection, and the console's, after their greeting if `is_greeted`."""
    secret = as_secret(TOKEN) if has_token else None
    near = ConsoleProtocol(
        SessionConfig("urov_node", True, secret, PURPOSE), subject.new_session(), now_s, token_bucket
    )  # fmt: skip
    far = WireSession(SessionConfig("console", False, secret, PURPOSE), now_s, decode_response)
    if is_greeted:
        for _ in range(3):
            near.receive(b"".join(map(far.seal, far.take_output())), now_s)
            far.receive(bytes(near.output), now_s)
            near.output.clear()
        assert near.wire.is_up
    return near, far


def some_bytes(rng: random.Random) -> bytes:
    """Return a read from a hostile console: frames, valid and invalid, split anywhere."""
    data = b"".join(frame(rng) for _ in range(rng.randrange(1, 4)))
    if rng.random() < 0.5:
        data = mutated_bytes(rng, data)
    return data[: rng.randrange(len(data) + 1)] if rng.random() < 0.3 else data


def frame(rng: random.Random) -> bytes:
    """Return one message, valid or invalid."""
    kind = rng.randrange(8)
    number = rng.choice((1, 0, -1, 2**63, 7))
    if kind < 3:
        with suppress(msgspec.ValidationError, OverflowError, UnicodeEncodeError):
            return encode_request((CommandMessage if kind else CompleteMessage)(number, valid_command(rng)))
    if kind == 3:
        return rng.randbytes(rng.randrange(64))
    if kind == 4:
        tag = rng.choice(("hello", "auth", "ping", "pong", "bye", "refused", "command", "complete", "page", "reply"))
        fields = {name: value(rng, 2) for name in rng.sample(("protocol", "stamp_s", "reason", "line", "number"), 3)}
        return encode_frame(msgspec.json.encode({"$": tag, **fields}))
    if kind == 5:
        return encode_frame(rng.choice((b"", b"null", b"[" * 3000, b'{"$":"command"}', b'["task"]', b"\xff\xfe")))
    if kind == 6:
        return encode_frame(b'{"$":"ping","stamp_s":%d}' % rng.randrange(1000)) * rng.randrange(30)
    return rng.choice((b"GET / HTTP/1.1\r\n\r\n", b"\xff\xff\xff\xff", b"\x00\x00\x00", b"\x80\x04\x95"))


def fuzz_port(rng: random.Random, count: int) -> None:
    """Do the same over real sockets, with several unauthenticated clients at a time; then serve an honest console."""
    console, done = CommandReceiverFactory(0), threading.Event()
    part = FunctionEndpointFactory({(TaskType.event, "start"): lambda *_: done.set()})
    errors = Errors()
    logging.getLogger("snr").addHandler(errors)
    node = Node("urov", Config(factories={"urov": [console, part]}))
    thread = threading.Thread(target=node.loop)
    thread.start()
    while not console.port:
        time.sleep(0.001)
    address, open_lines = ("127.0.0.1", console.port), []
    for _ in range(count):
        with suppress(OSError):
            if len(open_lines) < 12:
                open_lines.append(socket.create_connection(address, 5.0))
            sock = rng.choice(open_lines)
            sock.setblocking(False)
            sock.send(some_bytes(rng))
            if rng.random() < 0.3:
                sock.recv(1 << 16)
        if open_lines and rng.random() < 0.5:
            open_lines.pop(rng.randrange(len(open_lines))).close()
    for sock in open_lines:
        sock.close()
    with ConsoleClient(address) as client:
        client.wait_until_up(30.0)
        assert not client.ask("task start").is_error
        assert done.wait(30.0)
    node.enqueue_input(tasks.terminate("enough"), "fuzz")
    thread.join(30.0)
    assert node.exit_reason == "enough"
    logging.getLogger("snr").removeHandler(errors)
    assert errors.records == [], errors.records[:3]


# Random values


def value(rng: random.Random, depth: int) -> Any:
    """Return a JSON value."""
    kind = rng.randrange(8 if depth else 6)
    if kind == 6:
        return [value(rng, depth - 1) for _ in range(rng.randrange(5))]
    if kind == 7:
        return {rng.choice(("a", "$", "key", "v", "é", "")): value(rng, depth - 1) for _ in range(rng.randrange(5))}
    numbers = (0, -1, 2**63, -(2**63), 2**64 - 1, 1e308, -0.0, 5e-324)
    return (None, True, rng.choice(numbers), rng.random(), "x" * rng.randrange(20), "tuple float é \x1b \u2028")[kind]


def valid_command(rng: random.Random) -> str:
    """Return a command that does not end the node."""
    if rng.random() < 0.02:  # it reads this file again, which takes 40 ms
        return rng.choice(("reload part", "reload ticker", "reload failing", "reload all", "task reload part"))
    key = rng.choice(("depth_m", "k1", "k2", "engine"))
    return rng.choice(
        (
            "help", "help task", "list", "list pages", "list loops", "dump", "dump loops", "dump profiler",
            "dump links", "dump depth_m", f"watch {key}", "unwatch", f"unwatch {key}", "task start", "task event stop",
            "task process_data depth_m",
            f"store {key} {encode_value(rng.random()).decode()}", f"task start {rng.randrange(9)} [1, 2]",
            f'store link_topside {{"up": true, "age_s": {rng.random()}, "dropped": 0, "rtt_s": null}}',
            f"store {key} {msgspec.json.encode(value(rng, 3)).decode()}",
        )
    )  # fmt: skip


def mutated_text(rng: random.Random, text: str) -> str:
    """Return the text with parts changed."""
    for _ in range(rng.randrange(1, 4)):
        i = rng.randrange(len(text) + 1)
        text = rng.choice(
            (
                text[:i] + text[i + 1 :],
                text[:i] + chr(rng.choice((rng.randrange(128), rng.randrange(0x110000)))) + text[i:],
                text[:i] + text[i:] * 2 if len(text) < 2000 else text[:i],
                text[i:] + text[:i],
                text[:i] + rng.choice(WORDS) + text[i:],
            )
        )
    return text


def mutated_bytes(rng: random.Random, data: bytes) -> bytes:
    """Return the bytes with parts changed."""
    changed = bytearray(data)
    for _ in range(rng.randrange(1, 4)):
        if changed:
            changed[rng.randrange(len(changed))] = rng.randrange(256)
    return bytes(changed)


def after(subject: Subject, answer: CommandResult) -> Subject:
    """Return the same node, or a new one if a command has ended it."""
    if not subject.node.is_terminated:
        return subject
    subject.close()
    return Subject()


# Each fuzzer's fraction of all inputs.
FUZZERS: dict[str, tuple[Callable[[random.Random, int], None], float]] = {
    "bytes": (fuzz_bytes, 0.3),
    "lines": (fuzz_lines, 0.3),
    "values": (fuzz_values, 0.2),
    "commands": (fuzz_commands, 0.19),
    "port": (fuzz_port, 0.01),
}


def resident_mb() -> float:
    """Return the resident memory of the process."""
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * 4096 / 1e6


def main() -> None:
    """Run all fuzzers, and print their durations."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", choices=list(FUZZERS))
    options = parser.parse_args()
    begun_s = time.monotonic()
    for name, (fuzz, share) in FUZZERS.items():
        if options.only not in (None, name):
            continue
        count = int(options.count * share)
        fuzz(random.Random(options.seed), max(1, count // 20))  # fills caches, and the memory that Python keeps
        before_mb, start_s = resident_mb(), time.monotonic()
        fuzz(random.Random(options.seed + 1), count)
        grown_mb = resident_mb() - before_mb
        print(f"{name:<10} {count:>8} inputs  {time.monotonic() - start_s:6.1f} s  {grown_mb:+6.1f} MB", flush=True)
        assert grown_mb < MAX_MEMORY_MB, "memory has grown"
    print(f"all well, {time.monotonic() - begun_s:.0f} s")


if __name__ == "__main__":
    sys.exit(main())
