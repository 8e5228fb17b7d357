"""ZenohCallbacks, with sessions without peers, and their purpose: programs that end immediately."""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from typing import Any

import pytest

from snr_sim.links.zenoh_link import ZenohCallbacks

zenoh = pytest.importorskip("zenoh")  # part of snr_sim[dev]

pytestmark = pytest.mark.slow

# Declared on a daemon thread, as links do. Ends while the thread of a callback is about to end: without the last
# line, Python 3.11 aborts four of five such programs.
PROGRAM = """
import threading
import zenoh
from snr_sim.links.zenoh_link import ZenohCallbacks

config = zenoh.Config()
config.insert_json5("scouting/multicast/enabled", "false")
config.insert_json5("listen/endpoints", "[]")
callbacks = ZenohCallbacks()
session = zenoh.open(config)

def declare():
    for number in range(400):
        session.declare_subscriber(f"a/{number}", callbacks.make(zenoh.handlers.Callback, lambda sample: None))

thread = threading.Thread(target=declare, daemon=True)
thread.start()
thread.join()
session.close()
assert callbacks.wait(30.0)
"""


@pytest.fixture
def session() -> Any:
    config = zenoh.Config()
    config.insert_json5("scouting/multicast/enabled", "false")
    config.insert_json5("listen/endpoints", "[]")
    with zenoh.open(config) as session:
        yield session


def test_wait_returns_after_the_last_call_of_every_callback(session: Any) -> None:
    callbacks, calls, threads = ZenohCallbacks(), [], set()
    is_called = threading.Event()

    def called(sample: Any) -> None:
        threads.add(threading.current_thread())
        is_called.set()
        time.sleep(0.3)
        calls.append(str(sample.key_expr))

    for name in "ab":
        session.declare_subscriber(name, callbacks.make(zenoh.handlers.Callback, called))
        session.put(name, b"")
    assert is_called.wait(10.0)
    assert not callbacks.wait(0.01)  # no callback ends before the session does
    session.close()
    assert callbacks.wait(10.0)
    assert sorted(calls) == ["a", "b"]
    assert len(threads) == 2
    assert not any(thread.is_alive() for thread in threads)


def test_queries_that_are_over_are_not_kept(session: Any) -> None:
    callbacks = ZenohCallbacks()
    for _ in range(20):
        session.get("nobody", callbacks.make(zenoh.handlers.Callback, lambda reply: None), timeout=0.01)
        assert callbacks.wait(10.0)
    assert len(callbacks._ending) == 1


def test_wait_without_callbacks_returns_at_once() -> None:
    assert ZenohCallbacks().wait(0.0)


def test_programs_that_end_at_once_are_not_aborted() -> None:
    for _ in range(5):
        ended = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True)
        assert ended.returncode == 0, ended.stderr
