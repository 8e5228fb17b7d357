"""Main loop of a student's process: reads the student's files, makes the requested calls and sends their results.

It holds no hidden case, no seed and no secret. The grader trusts nothing from it but the student's answers.
The student's output is a stream separate from the answers.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import ModuleType
from typing import Any

import msgspec

from snr_sim.core.source_location import describe_error, location_of, prepend_location
from snr_sim.grading.remote import protocol
from snr_sim.grading.remote.child_values import UnsendableValueError, encode_plain, short
from snr_sim.grading.sandbox import child_limits
from snr_sim.prelude.errors import SnrError, suggest
from snr_sim.prelude.values import decode_value
from snr_sim.scenario import library

_CHUNK = 1 << 16  # larger buffers would be allocated and freed at each read
_NEWLINE = 10
_FIRST_PRIVATE_FD = 200


class Child:
    """The verbs that a student's process knows."""

    def __init__(self) -> None:
        self._modules: dict[str, ModuleType] = {}
        self._hosts: list[Any] = []
        verbs = (self.hello, self.call, self.host, self.ask, self.parse)
        self.verbs: dict[str, Callable[[Any], bytes]] = {verb.__name__: verb for verb in verbs}
        self.step: str = ""  # the verb, or "load" while a file is read

    def module(self, file: str) -> ModuleType:
        """Return a file of the student's as a module; it is read once."""
        module = self._modules.get(file)
        if module is None:
            before, self.step = self.step, "load"
            module = self._modules[file] = library.load_program(file)
            self.step = before
        return module

    def hello(self, do: protocol.Hello) -> bytes:
        """Return which user's this process is."""
        return b"%d" % os.getuid() if hasattr(os, "getuid") else b"0"

    def call(self, do: protocol.Call) -> bytes:
        """Call a function; return its result."""
        return self._call(function_of(self.module(do.file), do.function), do.function, do.args)

    def host(self, do: protocol.MakeObject) -> bytes:
        """Create an object of snr_sim or the lab around the student's module; return its number."""
        kind, module = do.host.load(), self.module(do.file)
        self._hosts.append(_called(f"{do.file} was prepared", kind, [module, *decode_value(bytes(do.args))]))
        return b"%d" % (len(self._hosts) - 1)

    def parse(self, do: protocol.Parse) -> bytes:
        """Apply a parser of snr_sim or the lab to a student's file; nothing of it runs."""
        parser = do.parser.load()
        return encode_plain(parser(do.data), do.parser.name, parser)

    def ask(self, do: protocol.AskObject) -> bytes:
        """Call a method of such an object; return its result."""
        return self._call(getattr(self._hosts[do.number], do.method), do.method, do.args)

    def _call(self, function: Callable[..., Any], name: str, args: msgspec.Raw) -> bytes:
        returned = _called(f"{name}(...)", function, decode_value(bytes(args)))
        return encode_plain(returned, f"{name}(...)", function)


def _called(what: str, function: Callable[..., Any], values: list[Any]) -> Any:
    try:
        return function(*values)
    except SnrError:
        raise
    except TypeError as error:
        if error.__traceback__ is not None and error.__traceback__.tb_next is None:  # it was never entered
            place = location_of(function)
            where = f"{place}\n  " if place is not None else ""
            raise SnrError(f"{where}TypeError: {error}\n  while {what} was called with {len(values)} values") from None
        raise


def function_of(module: ModuleType, name: str) -> Callable[..., Any]:
    """Return a function of the student's; raise SnrError if there is none of that name."""
    function = getattr(module, name, None)
    file = Path(str(module.__file__)).name
    if function is None:
        has = [known for known, value in vars(module).items() if callable(value) and known[:1] != "_"]
        raise SnrError(f"{file} has no function `{name}`.", fix=suggest(name, has))
    if not callable(function):
        raise SnrError(f"{file}: `{name}` is {short(function)}, not a function.", fix=f"def {name}(...):")
    return function  # type: ignore[no-any-return]


_printed = sys.stdout  # the student may replace it


def main(
    line: int,
    limits: tuple[int, int, int, int],
    is_alone: bool,
    user: int | None,
    confinement: tuple[int, list[str], str, str] | None = None,
) -> None:
    """Answer requests until the grader closes the line. Does not return.

    Args:
        line: the file descriptor of the conversation, or `PIPES`.
        limits: seconds of CPU time, bytes of memory, bytes of a file, open files.
        is_alone: whether no other process runs as its user, so that it may start none.
        user: user id to change to, if the process is root's and in a sandbox.
        confinement: of a process that confines itself: see `confine`.
    """
    asks, answers = _line_of_pipes() if line == protocol.PIPES else _line_of_socket(line)
    if user is not None:
        child_limits.drop_privileges(user)
    if confinement is not None:
        from snr_sim.grading.sandbox.confinement import confine  # here and below: not needed without isolation

        confine(answers, *confinement)
    elif line != protocol.PIPES and not is_alone:  # bubblewrap does the same for a sandbox
        child_limits.end_with_parent()  # a worker that is killed cannot end its program, which may never end
    child_limits.limit(limits, is_alone)
    child_limits.start_timer()
    if is_alone:  # the last wall, behind which no limit needs to be set any more
        from snr_sim.grading.sandbox import seccomp

        seccomp.install(seccomp.system_call_filter(seccomp.current_machine(), os.getpid()))
    _printed.reconfigure(line_buffering=True, errors="backslashreplace")  # type: ignore[union-attr]
    child_limits.forbid_threads()
    child_limits.install_timer_handler()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    child = Child()
    for asked in _lines(asks):
        _send(answers, _answer(child, asked))
    os._exit(0)


def _line_of_socket(line: int) -> tuple[int, int]:
    """Return the descriptor to read from and to write to: a high one, which no program hits by accident."""
    import fcntl  # not on Windows

    private = fcntl.fcntl(line, fcntl.F_DUPFD_CLOEXEC, _FIRST_PRIVATE_FD)
    os.close(line)
    return private, private


def _line_of_pipes() -> tuple[int, int]:
    """Return the descriptors to read from and to write to; from here on prints go to stderr."""
    asks, answers = os.dup(0), os.dup(1)
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)
    os.dup2(2, 1)
    return asks, answers


def _answer(child: Child, asked: bytes) -> bytes:
    ask = protocol.decode_request(asked)
    name = str(ask.verb.__struct_config__.tag)
    child.step = name
    try:
        child_limits.limit_cpu_time(ask.cpu_s)
        try:
            verb = child.verbs.get(name) or node_verbs(child)[name]
            value = verb(ask.verb)
        finally:
            child_limits.limit_cpu_time(0.0)
    except BaseException as error:
        child_limits.install_timer_handler()
        return protocol.encode(protocol.CallResponse(ask.n, error=_failure(child, name, error)))
    return b'{"n":%d,"value":%b}' % (ask.n, value)


def node_verbs(child: Child) -> dict[str, Callable[[Any], bytes]]:
    """Return the child's verbs with those about nodes, which take long to import and many checks do not need."""
    from snr_sim.grading.remote.child_node import NodeVerbs

    child.verbs |= NodeVerbs(child.module).verbs
    return child.verbs


def _failure(child: Child, do: str, error: BaseException) -> protocol.RemoteFailure:
    if isinstance(error, UnsendableValueError):
        return protocol.RemoteFailure(child.step, _text(str(error.args[0])), is_value=True)
    while_what = f"while it was asked to {do}" if do not in ("ask", "call") else "while the lab tried your file"
    if isinstance(error, child_limits.CpuTimeExceeded):
        return protocol.RemoteFailure("slow", _text(describe_error(error, while_what).replace("CpuTimeExceeded: ", "")))
    if isinstance(error, SnrError):
        prepend_location(error)
        return protocol.RemoteFailure(child.step, _text(error.message), _text(error.fix), is_refused=True)
    return protocol.RemoteFailure(child.step, _text(describe_error(error, while_what)))


def _text(text: str) -> str:
    """Return a text with lone surrogates escaped, since UTF-8 cannot encode them; an exception's text may have some."""
    return text.encode(errors="backslashreplace").decode()


def _lines(fd: int) -> Any:
    rest = b""
    while data := os.read(fd, _CHUNK):
        rest = rest + data if rest else data
        if rest[-1] == _NEWLINE:  # the grader asks one thing at a time
            line, rest = rest, b""
            yield line


def _send(fd: int, line: bytes) -> None:
    with suppress(OSError, ValueError):  # it is the student's to close
        _printed.flush()
    line += b"\n"
    while line := line[os.write(fd, line) :]:
        pass
