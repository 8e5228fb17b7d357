"""Detection of calls that make a handler non-deterministic: to the clock, random numbers, files or the network.

While a replay is checked, a profiler inspects every call into C (`sys.setprofile`), and an audit hook every file,
thread, process and socket that is opened. A call is reported with the student's line that caused it, also through
Python code in between, such as `uuid.uuid4`.
"""

from __future__ import annotations

import _thread
import datetime
import functools
import gc
import os
import random
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType, FunctionType
from typing import Any, ParamSpec, TypeVar

from snr_sim.core.machine import EventMachine
from snr_sim.core.source_location import is_student_file, short_path

P = ParamSpec("P")
R = TypeVar("R")
_CLOCK_HINT = "self.get_time_s() is the node's time, and repeats"
_RANDOM_HINT = "self.rng is the component's own chance, and repeats"
_READ_HINT = "read it in the factory or in a Loop, so that it does not change between runs"
_LOOP_HINT = "do it in a Loop, which brings the answer in as an input"
_THREAD = ("starting a thread", "a Loop is the way for work of its own; it is recorded")
_THREAD_STARTERS = ("start_new_thread", "start_joinable_thread")

# Functions in C: how a student writes the call, and what to do instead.
_CALLS: dict[Any, tuple[str, str]] = {
    **{
        getattr(time, name + unit): (f"time.{name}{unit}()", _CLOCK_HINT)
        for name in ("time", "monotonic", "perf_counter", "process_time", "thread_time")
        for unit in ("", "_ns")
    },
    **{
        getattr(time, name): (f"time.{name}()", _CLOCK_HINT)
        for name in ("localtime", "gmtime", "ctime", "strftime", "sleep")
    },
    **{getattr(datetime.datetime, name): (f"datetime.{name}()", _CLOCK_HINT) for name in ("now", "today", "utcnow")},
    datetime.date.today: ("date.today()", _CLOCK_HINT),
    random.random: ("random.random()", _RANDOM_HINT),
    random.getrandbits: ("random.getrandbits()", _RANDOM_HINT),
    **{getattr(os, name): (f"os.{name}()", _RANDOM_HINT) for name in ("urandom", "getrandom") if hasattr(os, name)},
    # Python 3.11 has no audit event for it.
    **{getattr(_thread, name): _THREAD for name in _THREAD_STARTERS if hasattr(_thread, name)},
}
_EVENTS = {
    **{f"_thread.{name}": _THREAD for name in _THREAD_STARTERS},
    "subprocess.Popen": ("starting a process", _LOOP_HINT),
    "os.system": ("starting a process", _LOOP_HINT),
    "socket.connect": ("opening a connection", _LOOP_HINT),
}
# The functions of the module `random` share one generator; some cache a number and draw only every other time.
_RANDOM = {
    function.__code__: f"random.{name}()"
    for name, function in vars(random.Random).items()
    if isinstance(function, FunctionType) and not name.startswith("_") and name not in ("seed", "getstate", "setstate")
}
_SHARED = random.random.__self__  # type: ignore[attr-defined]
_RANDOM_GLOBALS = vars(random)
_RANDOM_SEED = random.Random.seed.__code__
_RANDOM_MADE = random.Random.__init__.__code__
_NUMPY_LEGACY = (
    *("rand", "randn", "randint", "random", "random_sample", "choice", "normal", "uniform", "standard_normal"),
    *("shuffle", "permutation", "seed", "exponential", "poisson", "binomial", "beta", "gamma"),
)
# Calls from these modules do not affect a handler's result: a log line's time, a traceback's source line.
_HARMLESS = ("logging", "traceback", "linecache", "warnings", "tokenize")
# Files may be read while a robot is assembled; in a handler or `begin` their content may differ each time.
_HANDLING = (EventMachine.execute_next.__code__, EventMachine.begin_component.__code__)


@dataclass(frozen=True)
class NondeterministicCall:
    """A student's line that makes an outside call."""

    file: str
    line: int
    what: str
    hint: str

    def __str__(self) -> str:
        return f"{self.file}, line {self.line}: {self.what} does not repeat; {self.hint}."


class _CallWatcher:
    """Collects outside calls; each line once."""

    def __init__(self) -> None:
        self.calls: dict[tuple[str, int], NondeterministicCall] = {}
        self._is_student = functools.cache(is_student_file)
        # The frames that started the watch: a call stack that leads only to them does not belong to a component. Kept
        # as objects, because the id of a freed frame may be reused; they keep all their variables alive.
        self.callers = set(_stack(sys._getframe()))

    def on_profile(self, frame: FrameType, event: str, called: Any) -> None:
        """Check a call into C."""
        if event == "c_call":
            try:
                found = _CALLS.get(called)
            except TypeError:
                return  # unhashable, so it cannot be one of the watched functions
            if found is not None:
                self.report(frame, *found)
        # By globals first, as each look at a frame's code is an audit event: those calls were half of a replay's time.
        elif event == "call" and frame.f_globals is _RANDOM_GLOBALS:
            if frame.f_code is _RANDOM_SEED and frame.f_locals.get("a") is None:
                caller, what = frame.f_back, "random.seed()"
                if caller is not None and caller.f_code is _RANDOM_MADE:
                    caller, what = caller.f_back, "random.Random()"
                self.report(caller, what, _RANDOM_HINT)
            elif frame.f_code in _RANDOM and frame.f_locals.get("self") is _SHARED:
                self.report(frame.f_back, _RANDOM[frame.f_code], _RANDOM_HINT)

    def on_audit(self, event: str, args: tuple[Any, ...]) -> None:
        """Check an event of Python's audit hooks."""
        frame = sys._getframe(2)
        if event == "open":
            path, mode, flags = args
            is_reading = "r" in mode or "+" in mode if mode else not (flags or 0) & (os.O_WRONLY | os.O_RDWR)
            if not (is_reading and isinstance(path, (str, bytes))):
                return
            if any(one.f_code in _HANDLING for one in _stack(frame)):
                self.report(frame, f"reading {short_path(os.fsdecode(path))}", _READ_HINT)
        else:
            self.report(frame, *_EVENTS[event])

    def report(self, innermost: FrameType | None, what: str, hint: str) -> None:
        """Store the call if a student's line caused it."""
        through = ""
        for frame in _stack(innermost):
            if frame in self.callers:
                return
            if any(frame.f_code is getattr(callback, "__code__", None) for callback in gc.callbacks):
                return  # the garbage collector runs at any line; some tools time it
            file = frame.f_code.co_filename
            if self._is_student(file):
                shown = f"{through} ({what})" if through else what
                call = NondeterministicCall(short_path(file), frame.f_lineno, shown, hint)
                self.calls.setdefault((file, frame.f_lineno), call)  # the first call of a line is reported
                return
            module = str(frame.f_globals.get("__name__", ""))
            if "importlib" in file or module.partition(".")[0] in _HARMLESS:
                return  # an import reads files and random numbers, but with the same result each time
            through = f"{module}.{frame.f_code.co_qualname.removesuffix('.__init__')}()"


def _stack(frame: FrameType | None) -> Iterator[FrameType]:
    """Yield a frame, its caller, and so on."""
    while frame is not None:
        yield frame
        frame = frame.f_back


def unwatched(function: Callable[P, R]) -> Callable[P, R]:
    """Decorate a function that replays call between handlers: no call below it is a component's."""

    @functools.wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        watcher = sys.getprofile()
        if watcher is None:
            return function(*args, **kwargs)
        sys.setprofile(None)
        try:
            return function(*args, **kwargs)
        finally:
            sys.setprofile(watcher)

    return call


_current: _CallWatcher | None = None
_is_hooked = False


def _hook(event: str, args: tuple[Any, ...]) -> None:
    if _current is not None and (event == "open" or event in _EVENTS):
        _current.on_audit(event, args)


@contextmanager
def detect_nondeterminism() -> Iterator[dict[tuple[str, int], NondeterministicCall]]:
    """Watch this thread within the block; yield the calls found so far."""
    global _current, _is_hooked
    if not _is_hooked:
        sys.addaudithook(_hook)  # permanent: Python cannot remove a hook, so `_current` switches it
        _is_hooked = True
    watcher = _CallWatcher()
    before = sys.getprofile()
    numpy_before = _wrap_numpy(watcher)
    _current = watcher
    sys.setprofile(watcher.on_profile)
    try:
        yield watcher.calls
    finally:
        sys.setprofile(before)
        watcher.callers.clear()
        _current = None
        for name, function in numpy_before.items():
            setattr(sys.modules["numpy"].random, name, function)


def _wrap_numpy(watcher: _CallWatcher) -> dict[str, Any]:
    """Wrap the functions of numpy's global generator, which the profiler does not see."""
    try:
        import numpy  # before the student's file does, which is read only after this
    except ImportError:
        return {}
    before = {name: getattr(numpy.random, name) for name in _NUMPY_LEGACY}
    for name, function in before.items():
        setattr(numpy.random, name, functools.partial(_report_and_call, watcher, name, function))
    return before


def _report_and_call(watcher: _CallWatcher, name: str, function: Any, /, *args: Any, **kwargs: Any) -> Any:
    watcher.report(sys._getframe(1), f"numpy.random.{name}()", _RANDOM_HINT)
    return function(*args, **kwargs)
