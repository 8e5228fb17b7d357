"""Lanes of the tests: what a test needs decides when it runs (CONTRIBUTING.md, "Lanes").

A test without a marker is in the lane `fast`: virtual time only, no process, no port, no real wait. A guard fails a
fast test that starts a process, opens a port or waits. `slow`, `wall_clock` and `nightly` are set by markers.
A plain `pytest` runs `fast` (pyproject.toml); `pytest -m slow` and so on run the others.
"""

from __future__ import annotations

import gc
import signal
import sys
import time
from collections.abc import Generator
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parent
LANES = ("nightly", "wall_clock", "slow")
# A test that uses one of these fixtures starts compilers, emulators, sandboxes or warm interpreters.
SLOW_FIXTURES = {"emulators", "sandbox", "docker", "warm", "type_page"}
MAX_WAIT_S = 1.0  # of a thread that is neither on a core nor in the queue for one, beyond what disks may take
MAX_WAIT_SHARE = 0.1  # of its time on a core, of a property with 500 examples
DISK_WAIT_S = 0.002  # what a busy disk may take each time: some tests write a file thousands of times
MAX_ID = 100  # characters of a text in the name of a test
REST = """\
That was the fast lane. The rest:
  python -m pytest -n auto -m slow    processes, signals, sandboxes, emulators, trainings, notebooks
  python -m pytest -m wall_clock      threads and processes measured by the wall clock, one at a time
  .ci/nightly                         other Pythons, hundreds of seeds, long fuzzing"""


def lane_of(item: pytest.Item) -> str:
    """Return the one lane a test is in: of several markers, the lane that runs least often."""
    marked = {mark.name for mark in item.iter_markers()}
    for lane in (*LANES, "fast"):
        if lane in marked:
            return lane
    return "slow" if uses_slow_fixture(item) else "fast"


def uses_slow_fixture(item: pytest.Item) -> bool:
    """Return whether a test uses processes by a fixture; it is slow, unless a marker says fast."""
    return bool(SLOW_FIXTURES & set(getattr(item, "fixturenames", ())))


def minutes_of(item: pytest.Item) -> float:
    """Return how long a test takes by its own mark, `nightly(minutes=...)`, or 0."""
    marks = [mark.kwargs.get("minutes", 0.0) for mark in item.iter_markers("nightly")]
    return float(max(marks, default=0.0))


def longest_first(items: list[pytest.Item], workers: int) -> list[pytest.Item]:
    """Return the order in which each worker begins with its share of the longest tests: it gets an equal part."""
    ordered = sorted(items, key=minutes_of, reverse=True)
    if not ordered or not minutes_of(ordered[0]):
        return items
    return [item for worker in range(workers) for item in ordered[worker::workers]]


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Put every test into one lane before `-m` selects; leave out nightly and wall_clock unless `-m` names them."""
    asked = config.option.markexpr
    kept: list[pytest.Item] = []
    left_out: list[pytest.Item] = []
    for item in items:
        lane = lane_of(item)
        if not item.get_closest_marker(lane):
            item.add_marker(lane)
        is_kept = not asked or lane in asked or lane in ("fast", "slow")
        (kept if is_kept else left_out).append(item)
    items[:] = longest_first(kept, getattr(config, "workerinput", {}).get("workercount", 1))
    if left_out:
        config.hook.pytest_deselected(items=left_out)


def pytest_make_parametrize_id(val: object) -> str | None:
    """Shorten a long text; older versions of pytest take it whole, also one of 100 MB, in each line of a report."""
    return repr(val[:MAX_ID])[1:-1] if isinstance(val, str) and len(val) > MAX_ID else None


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Leave out of garbage collections what lives to the end: tests and modules, 300 000 objects.

    To look through them each time took a third of the CPU time of the tests that read traces.
    """
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()
        gc.collect()
        gc.freeze()


@pytest.hookimpl(wrapper=True)
def pytest_terminal_summary(
    terminalreporter: pytest.TerminalReporter, config: pytest.Config
) -> Generator[None, None, None]:
    """Print how to run the other lanes after a run of the fast one."""
    yield
    if config.option.markexpr == "fast" and not config.option.collectonly:
        terminalreporter.write_line(REST)


class FastLaneGuard:
    """Finds what a fast test must not do. An audit hook cannot be removed, so there is one for the whole session."""

    PROCESSES = ("subprocess.Popen", "os.fork", "os.forkpty", "os.posix_spawn", "os.system")
    # Of libraries that ask for the processor, or a computer's fonts, when they are first imported, in whichever test.
    ALLOWED_PROCESSES = ("uname", "lscpu", "fc-list")
    SOCKETS = ("socket.bind", "socket.connect")
    THREADS = ("_thread.start_new_thread", "_thread.start_joinable_thread")  # audited from Python 3.12 on
    # Of the recorder and its listener, of the handling of signals, of the watchdogs, and of prompt_toolkit; loops
    # have threads on the wall clock only.
    ALLOWED_THREADS = (
        "trace-flusher", "trace-listener", "wake_up", "watchdog", "slow start", "output", "patch-stdout-flush-thread",
    )  # fmt: skip

    def __init__(self) -> None:
        self.is_active = False
        self.found: list[str] = []
        sys.addaudithook(self._on_event)

    def _on_event(self, event: str, args: tuple[Any, ...]) -> None:
        if not self.is_active:
            return
        if event in self.PROCESSES and args[:1] not in [(name,) for name in self.ALLOWED_PROCESSES]:
            self.found.append(f"{event} {args[0]!r:.60}")
        # The address of a network socket is a tuple; that of a Unix socket, which needs no port, is a string.
        elif event in self.SOCKETS and isinstance(args[1], tuple):
            self.found.append(f"{event} {args[1]}")
        elif event in self.THREADS:
            thread = getattr(args[0], "__self__", None)
            name = getattr(thread, "name", "a thread")
            # matplotlib logs a warning from a timer while it lists the computer's fonts, once for each new home.
            is_font_timer = getattr(getattr(thread, "function", None), "__module__", "") == "matplotlib.font_manager"
            if name not in self.ALLOWED_THREADS and not is_font_timer:
                self.found.append(f"{event} {name}")


def blocked_s() -> float:
    """Return how long this thread has waited for anything but a core, up to a constant; 0 where that is unknown.

    A share of its time on a core is taken off: a test that takes half a minute at night waits for memory, too.

    Each time that it gave up its core, `DISK_WAIT_S` is taken off.
    """
    try:
        with open("/proc/thread-self/schedstat") as file:
            on_core_ns, in_queue_ns, _ = map(int, file.read().split())
    except OSError:
        return 0.0
    import resource  # there is none on every system, but on each that has the file above

    waits = resource.getrusage(resource.RUSAGE_THREAD).ru_nvcsw
    allowed_s = MAX_WAIT_SHARE * on_core_ns * 1e-9 + DISK_WAIT_S * waits
    return time.monotonic() - (on_core_ns + in_queue_ns) * 1e-9 - allowed_s


def signal_handlers() -> dict[str, object]:
    """Return what this process does at signals that end it: a handler that one test leaves can end a later one."""
    numbers = [
        getattr(signal, name)
        for name in ("SIGINT", "SIGTERM", "SIGALRM", "SIGVTALRM", "SIGPROF")
        if hasattr(signal, name)
    ]
    handlers: dict[str, object] = {number.name: signal.getsignal(number) for number in numbers}
    for timer in ("ITIMER_REAL", "ITIMER_PROF"):
        if hasattr(signal, timer):
            handlers[timer] = signal.getitimer(getattr(signal, timer)) != (0.0, 0.0)
    return handlers


GUARD = FastLaneGuard()
HANDLERS: dict[str, object] = {}  # as they were before the first test


def pytest_collection_finish() -> None:
    """Remember what happens at signals."""
    HANDLERS.update(signal_handlers())


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, object, object]:
    """Fail a fast test of the project that starts a process, opens a port or waits in real time."""
    is_fast = item.get_closest_marker("fast") is not None and not uses_slow_fixture(item)
    is_guarded = is_fast and item.path.is_relative_to(ROOT / "tests")
    GUARD.found, GUARD.is_active, began_s = [], is_guarded, blocked_s()
    try:
        result = yield
    finally:
        GUARD.is_active = False
    waited_s = blocked_s() - began_s
    if is_guarded and waited_s > MAX_WAIT_S:
        GUARD.found.append(f"it waited for {waited_s:.2f} s of real time")
    if is_guarded and GUARD.found:
        found = "; ".join(GUARD.found[:3])
        pytest.fail(
            f"A test of the fast lane has no process, thread or port, and does not wait: {found}. "
            "Mark it with @pytest.mark.slow.",
            pytrace=False,
        )
    return result


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown(item: pytest.Item) -> Generator[None, object, object]:
    """Fail a test of the project that leaves a handler or a timer of a signal behind."""
    result = yield
    left = [name for name, handler in signal_handlers().items() if handler != HANDLERS[name]]
    if left and item.path.is_relative_to(ROOT / "tests"):
        HANDLERS.update(signal_handlers())  # it is this test's fault, and no other's
        pytest.fail(f"The test left a handler or a timer behind: {', '.join(left)}.", pytrace=False)
    return result
