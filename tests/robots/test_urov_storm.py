"""A vehicle under load: clients flood its port, a proxy delays and corrupts data, a hundred pilots are killed.

The vehicle's program must survive, and every page must be accounted for.
"""

import json
import random
import select
import signal
import socket
import subprocess
import sys
import threading
import time
from collections import defaultdict
from contextlib import ExitStack, suppress
from itertools import cycle, pairwise
from pathlib import Path
from typing import Any

import pytest

from snr_sim.recording.reader import read_trace
from snr_sim.recording.records import PageRecord
from snr_sim.recording.trace import FILE_NAME

HERE = "127.0.0.1"
TIMEOUT_S = 60.0
LINKS = Path(__file__).parents[1] / "links"
KILLS = 100
CORRUPTED = 0.3  # of the connections
MAX_DELAY_S = 0.03
# Kinds of attackers.py, each for so long.
FLOODS = ("storm of connections", "random bytes", "half-open connections", "wrong secrets", "replayed greetings")
FLOOD_S = 3.0


class Proxy:
    """Proxy that forwards bytes in pieces and late; in some connections it changes, adds, repeats or drops some.

    `corrupted` counts the connections with corrupted bytes.
    """

    def __init__(self, port: int, seed: int) -> None:
        self._to, self._rng = port, random.Random(seed)
        self._listener = socket.create_server((HERE, 0))
        self.port: int = self._listener.getsockname()[1]
        self.corrupted = 0
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self) -> None:
        with suppress(OSError):
            while True:
                near, _ = self._listener.accept()
                is_corrupted = self._rng.random() < CORRUPTED
                # After the greeting, so that each corrupts an established session.
                at = self._rng.randrange(600, 6000) if is_corrupted else None
                rng = random.Random(self._rng.random())
                threading.Thread(target=self._carry, args=(near, at, rng), daemon=True).start()

    def _carry(self, near: socket.socket, at: int | None, rng: random.Random) -> None:
        passed = 0
        with suppress(OSError), near, socket.create_connection((HERE, self._to), TIMEOUT_S) as far:
            while True:
                readable, _, _ = select.select([near, far], [], [], TIMEOUT_S)
                for sock in readable:
                    data = sock.recv(rng.randrange(1, 2000))
                    if not data:
                        return
                    time.sleep(rng.uniform(0.0, MAX_DELAY_S))
                    if sock is near:
                        passed += len(data)
                        if at is not None and passed >= at:
                            data, at = self._corrupt(data, rng), None
                            self.corrupted += 1
                    (far if sock is near else near).sendall(data)

    def _corrupt(self, data: bytes, rng: random.Random) -> bytes:
        place = rng.randrange(len(data))
        bit = bytes([data[place] ^ 1 << rng.randrange(8)])
        return rng.choice(
            [
                data[:place] + bit + data[place + 1 :],
                data[:place] + rng.randbytes(rng.randrange(1, 500)) + data[place:],
                data + data,
                data[:place] + data[place + 1 :],
            ]
        )

    def close(self) -> None:
        self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()


def start(*words: object, **more: Any) -> subprocess.Popen[str]:
    return subprocess.Popen([sys.executable, *map(str, words)], stdout=subprocess.PIPE, text=True, **more)


@pytest.fixture
def port() -> int:
    with socket.socket() as free:
        free.bind((HERE, 0))
        number: int = free.getsockname()[1]
        return number


def flood(port: int, is_over: threading.Event) -> None:
    for kind in cycle(FLOODS):
        attacker = start(LINKS / "attackers.py", kind, port)
        is_over.wait(FLOOD_S)
        status = attacker.poll()
        attacker.kill()
        attacker.communicate()
        assert status is None, f"{kind}: the attacker has given up"
        if is_over.is_set():
            return


@pytest.mark.nightly(minutes=1)
def test_vehicle_survives_storm_and_counts_every_page(tmp_path: Path, port: int) -> None:
    secret = tmp_path / "secret"
    secret.write_text("a secret of 16 bytes or more")
    options = [f"--option=port={port}", f"--option=secret={secret}"]
    vehicle = start(
        "-m", "snr_sim", "run", "urov_teleop", "--role", "urov", "--json", "--no-rrd", "--out", tmp_path / "urov",
        *options, stderr=subprocess.PIPE, cwd=tmp_path,
    )  # fmt: skip
    is_over = threading.Event()
    with ExitStack() as stack:
        stack.callback(vehicle.kill)
        proxy = Proxy(port, 1)
        stack.callback(proxy.close)
        flooding = threading.Thread(target=flood, args=(port, is_over))
        stack.callback(flooding.join)
        stack.callback(is_over.set)
        flooding.start()
        pilots = start(Path(__file__).with_name("storm_pilots.py"), proxy.port, KILLS, 7)
        stack.callback(pilots.kill)
        result = json.loads(pilots.communicate(timeout=240.0)[0])
        is_over.set()
        assert vehicle.poll() is None, vehicle.communicate()
        vehicle.send_signal(signal.SIGINT)
        out, complaints = vehicle.communicate(timeout=TIMEOUT_S)
    assert (json.loads(out)["outcome"], vehicle.returncode) == ("interrupted", 1), complaints
    assert "Traceback" not in complaints

    (path,) = (tmp_path / "urov").glob(f"*/{FILE_NAME}")
    pages = [json.loads(bytes(record.values))[0] for record in read_trace(path).records if type(record) is PageRecord]
    came: dict[str, list[int]] = defaultdict(list)
    for page in pages:
        if page["key"] == "controls":
            came[page["origin"].removesuffix("_node")].append(page["data"]["number"])
    states = [page["data"] for page in pages if page["key"] == "link_tether"]
    print(f"{len(came)} pilots, {sum(map(len, came.values()))} pages, {proxy.corrupted} corrupted: {states[-1]}")
    assert states[-1]["received"] == sum(map(len, came.values()))
    assert states[-1]["failures"] == 0
    assert len(came) > KILLS // 2
    for name, numbers in came.items():
        assert all(earlier < later for earlier, later in pairwise(numbers)), name  # each once and in order
        assert numbers[-1] <= result["stored"][name]
    torn = [name for name, numbers in came.items() if len(numbers) <= numbers[-1] - numbers[0]]
    assert len(torn) <= proxy.corrupted  # what went with a connection that was closed; of all others none is missing
    assert proxy.corrupted > KILLS // 20
    last = result["last"]
    assert last["sent"] + last["dropped"] + last["unsent"] == result["stored"]["last"]
    assert last["dropped"] + last["sent"] >= len(came["last"]) > 0
