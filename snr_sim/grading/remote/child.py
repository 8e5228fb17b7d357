"""What runs in a student's process: it reads the student's files, calls what it is asked to, and says what came.

It holds no hidden case, no seed and no secret, and its word is taken for nothing but the student's answers.
What the student prints goes elsewhere than what it answers.
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

from snr_sim.core.blame import describe_error, place_of, put_place_first
from snr_sim.grading.remote.child_values import NoValue, encode_plain, short
from snr_sim.grading.remote.protocol import PIPES, Answer, Said, decode_ask, encode
from snr_sim.grading.remote.sent_code import SentCode
from snr_sim.grading.sandbox.child_limits import (
    TookTooLong,
    become,
    bound_time,
    end_with_parent,
    heed_time,
    limit,
    refuse_company,
)
from snr_sim.prelude.errors import SnrError, nearest
from snr_sim.prelude.values import decode_value
from snr_sim.scenario import library

_CHUNK = 1 << 16  # much more would be given to the system and taken back at each read
_NEWLINE = 10
_FIRST_PRIVATE_FD = 200


class CallArgs(msgspec.Struct, frozen=True):
    """Which function of which file is called with what."""

    file: str
    function: str
    args: msgspec.Raw


class HostArgs(msgspec.Struct, frozen=True):
    """Which class of the kit or the lab is made, with the student's module first."""

    file: str
    host: SentCode
    args: msgspec.Raw


class ParseArgs(msgspec.Struct, frozen=True):
    """Which parser of the kit or the lab reads what."""

    parser: SentCode
    data: bytes


class Child:
    """The verbs that a student's process knows."""

    def __init__(self) -> None:
        self._modules: dict[str, ModuleType] = {}
        self._hosts: list[Any] = []
        self.verbs: dict[str, Callable[[msgspec.Raw], bytes]] = {
            "hello": lambda raw: b"%d" % os.getuid() if hasattr(os, "getuid") else b"0",
            "call": self.call,
            "host": self.host,
            "ask": self.ask,
            "parse": self.parse,
        }
        self.step = ""
        self.component = ""

    def module(self, file: str) -> ModuleType:
        """Returns a file of the student's as a module; it is read once."""
        module = self._modules.get(file)
        if module is None:
            before, self.step = self.step, "load"
            module = self._modules[file] = library.load_program(file)
            self.step = before
        return module

    def call(self, raw: msgspec.Raw) -> bytes:
        """Calls a function; returns what it returns."""
        args = _decode_call(raw)
        function = function_of(self.module(args.file), args.function)
        values = decode_value(bytes(args.args))
        returned = self._called(f"{args.function}(...)", function, values)
        return encode_plain(returned, f"{args.function}(...)", function)

    def host(self, raw: msgspec.Raw) -> bytes:
        """Makes an object of the kit's or the lab's around the student's module; returns its number."""
        args = _decode_host(raw)
        kind = args.host.received()
        module = self.module(args.file)
        self._hosts.append(self._called(f"{args.file} was prepared", kind, [module, *decode_value(bytes(args.args))]))
        return b"%d" % (len(self._hosts) - 1)

    def parse(self, raw: msgspec.Raw) -> bytes:
        """Apply a parser of the kit or the lab to what a student wrote; nothing of it runs."""
        args = _decode_parse(raw)
        parser = args.parser.received()
        return encode_plain(parser(args.data), args.parser.name, parser)

    def ask(self, raw: msgspec.Raw) -> bytes:
        """Calls a method of such an object; returns what it returns."""
        number, method, *values = decode_value(bytes(raw))
        function = getattr(self._hosts[number], method)
        return encode_plain(self._called(f"{method}(...)", function, values), f"{method}(...)", function)

    def _called(self, what: str, function: Callable[..., Any], values: list[Any]) -> Any:
        try:
            return function(*values)
        except SnrError:
            raise
        except TypeError as error:
            if error.__traceback__ is not None and error.__traceback__.tb_next is None:  # it was never entered
                place = place_of(function)
                where = f"{place}\n  " if place is not None else ""
                raise SnrError(
                    f"{where}TypeError: {error}\n  while {what} was called with {len(values)} values"
                ) from None
            raise


def function_of(module: ModuleType, name: str) -> Callable[..., Any]:
    """Returns a function of the student's.

    Raises:
        SnrError: there is none of that name.
    """
    function = getattr(module, name, None)
    file = Path(str(module.__file__)).name
    if function is None:
        has = [known for known, value in vars(module).items() if callable(value) and known[:1] != "_"]
        raise SnrError(f"{file} has no function `{name}`.", fix=nearest(name, has))
    if not callable(function):
        raise SnrError(f"{file}: `{name}` is {short(function)}, not a function.", fix=f"def {name}(...):")
    return function  # type: ignore[no-any-return]


_printed = sys.stdout  # the student may put something else in its place


def main(
    line: int,
    limits: tuple[int, int, int, int],
    is_alone: bool,
    user: int | None,
    walls: tuple[int, tuple[str, ...], str, str] | None = None,
) -> None:
    """Answers until nobody asks any more. Does not return.

    Args:
        line: the file descriptor of the conversation, or `PIPES`.
        limits: seconds of CPU time, bytes of memory, bytes of a file, open files.
        is_alone: whether nobody else runs as its user, so that it may start nothing.
        user: whom to become, if the process is root's and in a sandbox.
        walls: of a process that confines itself.
    """
    asks, answers = _line_of_pipes() if line == PIPES else _line_of_socket(line)
    if user is not None:
        become(user)
    if walls is not None:
        from snr_sim.grading.sandbox.confinement import (  # here and below: at home nothing of it is needed
            Walls,
            confine,
        )

        confine(Walls(*walls), answers)
    elif line != PIPES and not is_alone:  # bubblewrap does the same for a sandbox
        end_with_parent()  # a worker that is killed cannot end its program, which may be in a loop without an end
    limit(limits, is_alone)
    if is_alone:  # the last wall, behind which no limit needs to be set any more
        from snr_sim.grading.sandbox import seccomp

        seccomp.install(seccomp.allowing(seccomp.machine_here(), os.getpid()))
    _printed.reconfigure(line_buffering=True, errors="backslashreplace")  # type: ignore[union-attr]
    refuse_company()
    heed_time()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    child = Child()
    for asked in _lines(asks):
        _say(answers, _answer(child, asked))
    os._exit(0)


def _line_of_socket(line: int) -> tuple[int, int]:
    """Return the descriptor to read from and to write to: a high one, which no program meets by accident."""
    import fcntl  # not on Windows

    private = fcntl.fcntl(line, fcntl.F_DUPFD_CLOEXEC, _FIRST_PRIVATE_FD)
    os.close(line)
    return private, private


def _line_of_pipes() -> tuple[int, int]:
    """Return the descriptors to read from and to write to; what is printed goes to stderr from here on."""
    asks, answers = os.dup(0), os.dup(1)
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)
    os.dup2(2, 1)
    return asks, answers


def _answer(child: Child, asked: bytes) -> bytes:
    ask = decode_ask(asked)
    child.step, child.component = ask.do, ""
    try:
        bound_time(ask.cpu_s)
        try:
            verb = child.verbs.get(ask.do)
            if verb is None:
                verb = node_verbs(child)[ask.do]
            value = verb(ask.args)
        finally:
            bound_time(0.0)
    except BaseException as error:
        heed_time()
        return encode(Answer(ask.n, error=_said(child, ask.do, error)))
    return b'{"n":%d,"value":%b}' % (ask.n, value)


def node_verbs(child: Child) -> dict[str, Callable[[msgspec.Raw], bytes]]:
    """Returns the child's verbs with those about nodes, which take long to import and many checks do not need."""
    from snr_sim.grading.remote.node_verbs import NodeVerbs

    NodeVerbs(child)
    return child.verbs


def _said(child: Child, do: str, error: BaseException) -> Said:
    if isinstance(error, NoValue):
        return Said(child.step, _text(str(error.args[0])), component=child.component, is_value=True)
    while_what = f"while it was asked to {do}" if do not in ("ask", "call") else "while the lab tried your file"
    if isinstance(error, TookTooLong):
        return Said("slow", _text(describe_error(error, while_what).replace("TookTooLong: ", "")), "", child.component)
    if isinstance(error, SnrError):
        put_place_first(error)
        return Said(child.step, _text(error.message), _text(error.fix), child.component, is_refused=True)
    return Said(child.step, _text(describe_error(error, while_what)), component=child.component)


def _text(said: str) -> str:
    """Returns what can be written as UTF-8: half a character, in an exception's text, cannot."""
    return said.encode(errors="backslashreplace").decode()


def _lines(fd: int) -> Any:
    rest = b""
    while True:
        data = os.read(fd, _CHUNK)
        if not data:
            return
        rest = rest + data if rest else data
        if rest[-1] == _NEWLINE:  # the grader asks one thing at a time
            line, rest = rest, b""
            yield line


def _say(fd: int, line: bytes) -> None:
    with suppress(OSError, ValueError):  # it is the student's to close
        _printed.flush()
    line += b"\n"
    sent = os.write(fd, line)
    while sent < len(line):
        line = line[sent:]
        sent = os.write(fd, line)


_decode_call = msgspec.json.Decoder(CallArgs).decode
_decode_parse = msgspec.json.Decoder(ParseArgs).decode
_decode_host = msgspec.json.Decoder(HostArgs).decode
