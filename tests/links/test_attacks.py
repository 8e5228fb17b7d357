"""A pilot over real sockets, at 50 Hz from its own process, while programs attack the same port."""

from __future__ import annotations

import itertools
import os
import socket
import ssl
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

from snr_sim import Config, Node, SocketsPair, Task, TaskType, Tls, tasks
from snr_sim.links.tcp_server import MAX_NEWCOMERS, MAX_PEERS
from snr_sim.testing.function_components import FunctionEndpointFactory, FunctionLoopFactory

from .attackers import KINDS, SECRET

HERE = "127.0.0.1"
LIMIT_S = 60.0
ATTACK_S = 2.0
WORST_GAP_S = 0.25
HANDLER_S = 100e-6  # time to handle an accepted page of an attacker
MAX_GROWTH_BYTES = 300e6  # 60 peers may each have a frame of 1 MiB here, which takes more as Python objects


class Robot:
    """A node with a server, in this process."""

    def __init__(self, **options: Any) -> None:
        self.pair = SocketsPair((HERE, 0), name="t", secret=SECRET, **options)
        self.came: list[tuple[float, int]] = []
        handlers: dict[Any, Any] = {(TaskType.store_page, "stick"): self._steer, (TaskType.store_page, "other"): _work}
        photos = FunctionLoopFactory(lambda loop: loop.store_data("photo", "x" * 100_000), rate_hz=20.0, name="camera")
        server = self.pair.server("photo", accept=["stick", "other"])
        self.node = Node("robot", Config(factories={"robot": [server, FunctionEndpointFactory(handlers), photos]}))
        self.thread = threading.Thread(target=self.node.loop, daemon=True)
        self.thread.start()
        until(lambda: self.pair.port)

    def _steer(self, task: Task, task_id: Any) -> None:
        self.came.append((time.monotonic(), task.val_list[0].data))

    def worst_gap_s(self, begun_s: float, ended_s: float) -> float:
        moments_s = [moment_s for moment_s, _ in self.came if begun_s <= moment_s <= ended_s]
        return max(later_s - one_s for one_s, later_s in itertools.pairwise([begun_s, *moments_s, ended_s]))

    def end(self) -> None:
        self.node.enqueue_input(tasks.terminate("the test is over"), "test")
        self.thread.join(LIMIT_S)


def _work(task: Task, task_id: Any) -> None:
    end_s = time.perf_counter() + HANDLER_S
    while time.perf_counter() < end_s:
        pass


def until(is_so: Callable[[], Any]) -> None:
    give_up_s = time.monotonic() + LIMIT_S
    while not is_so():
        assert time.monotonic() < give_up_s
        time.sleep(0.01)


def program(name: str, *arguments: object, **options: Any) -> subprocess.Popen[str]:
    command = [sys.executable, str(Path(__file__).with_name(name)), *map(str, arguments)]
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, **options)


@contextmanager
def attack(kind: str, port: int) -> Iterator[None]:
    attacker = program("attackers.py", kind, port)
    assert attacker.stdout is not None
    try:
        assert attacker.stdout.readline() == "begins\n"
        yield
        assert attacker.poll() is None, "the attacker has given up"
    finally:
        attacker.kill()
        attacker.communicate()


def memory_bytes() -> int:
    pages = int(Path("/proc/self/statm").read_text().split()[1]) if sys.platform == "linux" else 0
    return pages * os.sysconf("SC_PAGE_SIZE")


@pytest.mark.nightly
@pytest.mark.wall_clock
@pytest.mark.parametrize("kind", KINDS)
def test_pilot_over_real_sockets_waits_a_quarter_second_at_most(kind: str) -> None:
    robot = Robot()
    pilot = program("pilot.py", robot.pair.port)
    link: Any = robot.node.components["link_t"]
    until(lambda: len(robot.came) > 25)
    memory = memory_bytes()
    max_streams = 0
    with attack(kind, robot.pair.port):
        begun_s = time.monotonic()
        while (ended_s := time.monotonic()) < begun_s + ATTACK_S:
            max_streams = max(max_streams, len(link.transport.streams))
            time.sleep(0.05)
    grown = memory_bytes() - memory
    output, _ = pilot.communicate("", LIMIT_S)
    stored, sent, dropped, unsent = map(int, output.split())
    until(lambda: len(robot.came) >= sent)
    gap_s = robot.worst_gap_s(begun_s, ended_s)
    print(f"{kind}: {1000 * gap_s:.0f} ms, {grown / 1e6:.0f} MB more")
    robot.end()
    assert robot.node.inbox.failure is None
    assert link.failures == 0
    assert gap_s <= WORST_GAP_S
    assert grown < MAX_GROWTH_BYTES
    assert max_streams <= MAX_PEERS + MAX_NEWCOMERS + 1
    assert stored == sent + dropped + unsent
    first = 1 + dropped  # pages stored before the pilot was connected
    assert [number for _, number in robot.came] == list(range(first, first + sent))  # each once and in order


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["half-open connections", "storm of connections", "wrong secrets"])
def test_pilot_from_the_attackers_address_is_served_during_an_attack(kind: str) -> None:
    robot = Robot()
    with attack(kind, robot.pair.port):
        pilot = program("pilot.py", robot.pair.port)
        until(lambda: len(robot.came) > 25)
        pilot.communicate("", LIMIT_S)
    robot.end()


@pytest.mark.slow
@pytest.mark.parametrize("how", ["stalls", "is nonsense", "stops halfway"])
def test_failed_tls_handshake_does_not_delay_other_clients(files: dict[str, str], how: str) -> None:
    tls = Tls(certificate=files["robot_cert"], key=files["robot_key"], authority=files["authority"])
    robot = Robot(tls=tls)
    held: list[socket.socket] = []
    hello = ssl.MemoryBIO()
    with suppress(ssl.SSLWantReadError):
        tls.client_context().wrap_bio(ssl.MemoryBIO(), hello, server_hostname=HERE).do_handshake()
    payloads = {"stalls": b"", "is nonsense": b"\x16\x03\x01\x00\x05hello" * 20, "stops halfway": hello.read()}
    for _ in range(2 * MAX_NEWCOMERS):
        held.append(socket.create_connection((HERE, robot.pair.port), LIMIT_S))
        held[-1].sendall(payloads[how])
    link: Any = robot.node.components["link_t"]
    begun_s = time.monotonic()
    pilot = Node(
        "pilot",
        Config(
            factories={
                "pilot": [
                    robot.pair.client("stick"),
                    FunctionLoopFactory(lambda loop: loop.store_data("stick", 1), rate_hz=50.0),
                ]
            }
        ),
    )
    thread = threading.Thread(target=pilot.loop, daemon=True)
    thread.start()
    until(lambda: len(robot.came) > 25)
    print(f"{how}: served after {robot.came[0][0] - begun_s:.3f} s")
    pilot.enqueue_input(tasks.terminate("the test is over"), "test")
    thread.join(LIMIT_S)
    robot.end()
    for sock in held:
        sock.close()
    assert link.failures == 0
