"""Hints for Python's own errors: the nearest existing name, the available alternatives, or the usual fix.

Python shows its own "Did you mean" only with a traceback, and for different errors in each version. These hints are
the same in all versions.
"""

from __future__ import annotations

import ast
import builtins
import difflib
import inspect
import linecache
import logging
import re
import sys
from collections.abc import Callable, Iterable, Mapping
from enum import EnumMeta
from types import ModuleType, TracebackType
from typing import Any

from snr_sim.prelude.errors import suggest

_UNKNOWN = object()
_BOTH_SIDES = "check the types of both sides; convert text from outside with float(...) first."
NEAR_ATTRIBUTE = 0.65  # so that self.logger is near self.log
_NEAR_PACKAGE = 0.6  # so that snr, as the thesis has it, is near snr_sim
_PACKAGES = ("snr_sim", "numpy", "scipy", "matplotlib", "pymunk", "mujoco", "gymnasium")


def hint(error: BaseException, trace: TracebackType | None) -> str:
    """Return one fix to try, or an empty text if no hint is better than the error's message.

    Args:
        error: not an snr_sim error.
        trace: traceback of the line to fix, the innermost one of student code.
    """
    if _source(trace).lstrip().startswith("raise"):
        return ""  # that line raises the error itself, with its author's message
    words = next((words for kind, words in _WORDS.items() if isinstance(error, kind)), "")
    try:
        return words if isinstance(words, str) else words(error, trace)
    except Exception:  # a student's own __dir__ or __eq__ may raise: report the error without a hint
        return ""


def error_message(error: BaseException) -> str:
    """Return an error's message without paths of installed files.

    >>> error_message(ImportError("cannot import name 'x' from 'y' (/usr/lib/y.py)"))
    "cannot import name 'x' from 'y'"
    """
    if isinstance(error, SyntaxError):
        return error.msg
    return re.sub(r" \((/|[A-Z]:)[^()]*\.py\)", "", str(error)) if isinstance(error, ImportError) else str(error)


def _of_syntax(error: Any, _trace: object) -> str:
    message = error.msg or ""
    if isinstance(error, IndentationError):
        return "give it as many spaces as the other lines of its block have; four more after a line that ends in ':'."
    if (error.text or "").lstrip().startswith("else if"):
        return "write elif, in one word."
    if "expected ':'" in message:
        return "end the line with a colon: def, class, if, else, for, while, try and with need one."
    if "never closed" in message or "unmatched" in message or "does not match" in message:
        return "count the brackets: each one that is opened is closed, by one of its kind."
    if re.search("[\u2018\u2019\u201c\u201d\u00ab\u00bb]", message):
        return "write straight quotes, \" or ': these are of a text program or a web page."
    if "unterminated" in message:
        return "end the text with the same quotes that it begins with."
    return "look at this line and at the end of the one before: a missing bracket, comma, colon or quote."


def _of_import(error: Any, _trace: object) -> str:
    if "circular import" in str(error):
        return "the two files import each other: move what both need into a third file, and import that in both."
    found = re.search(r"cannot import name '([^']*)' from '([^']*)'", str(error))
    if found is not None:
        return near(found[1], _public(sys.modules.get(found[2]))) or "look for its name: README.md."
    name = str(error.name or "")
    if close := near(name, _PACKAGES, _NEAR_PACKAGE) or near(name, sys.stdlib_module_names):
        return close
    return f"a file {name.partition('.')[0]}.py beside yours, its name spelt alike; a package is installed with pip."


def _of_name(error: Any, trace: TracebackType | None) -> str:
    found = re.search(r"'(\w+)'", str(error))
    if trace is None or found is None:
        return ""
    if isinstance(error, UnboundLocalError) and found[1] in trace.tb_frame.f_globals:
        return f"keep it in the component, as self.{found[1]}, set in __init__: a name that a function sets is its own."
    if isinstance(error, UnboundLocalError):
        return f'give {found[1]} a value on each way that leads to this line; a text has quotes: "{found[1]}".'
    return about_name(found[1], _names(trace), trace.tb_frame.f_locals.get("self"))


def about_name(name: str, known: Iterable[str], owner: object = None) -> str:
    """Return a fix for an undefined name; `owner` is the `self` of its function."""
    if name in ("exit", "quit"):
        return "leave it out: a file ends by itself, and a component ends the run with tasks.terminate('why')."
    if name in _public(sys.modules.get("snr_sim")):
        return f"add at the top: from snr_sim import {name}."
    if owner is not None and name in dir(owner):
        return f"did you mean self.{name}?"
    close = near(name, (one for one in known if not one.startswith("_")))
    return close or f'give {name} a value before this line, or import it; a text has quotes: "{name}".'


def _of_attribute(error: Any, trace: TracebackType | None) -> str:
    node = _node(trace)
    owner = _value(node.value, trace) if isinstance(node, ast.Attribute) else _UNKNOWN
    myself = {} if trace is None else getattr(trace.tb_frame.f_locals.get("self"), "__dict__", {})
    parent = myself.get("parent")
    if "parent" in myself and f"'{type(parent).__name__}' object" in str(error) and not hasattr(parent, "get_page"):
        return "self.parent is the component's node: give your own attribute another name."
    if trace is not None and isinstance(node, ast.Attribute) and "'super' object" in str(error):
        kind = type(trace.tb_frame.f_locals.get("self")).__name__
        return f"leave it out: what {kind} builds on has no {node.attr}, so there is nothing to call before yours."
    if owner is None or "'NoneType' object" in str(error):
        return _about_none(node)
    if owner is _UNKNOWN or not isinstance(node, ast.Attribute):
        return ""
    if isinstance(owner, Mapping) and node.attr in owner:
        return f'a page is a dict: {ast.unparse(node.value)}["{node.attr}"].'
    if isinstance(owner, EnumMeta):
        return suggest(node.attr, owner.__members__)
    close = near(node.attr, _public(owner), NEAR_ATTRIBUTE)
    if close:
        return close
    if node.attr == "factory" and isinstance(owner, type):
        return f"name the class that it builds on: class {owner.__name__}(Endpoint)."
    if ast.unparse(node.value) == "self.factory":
        return f"set it in factories(), before the factory is returned: made.{node.attr} = ..."
    if isinstance(node.value, ast.Name) and node.value.id == "self":
        if "TaskType." in _source(trace):
            return f"define it in the class: def {node.attr}(self, task, task_id): ..."
        return f"set it in __init__, before it is used: {ast.unparse(node)} = ..."
    return suggest(node.attr, _public(owner), "it has")


def _of_key(error: Any, trace: TracebackType | None) -> str:
    owner = _indexed(trace)
    if isinstance(owner, Mapping):
        return suggest(str(error.args[0] if error.args else ""), map(str, owner), "its keys are")
    return "look up what keys it has: print(list(...)); or ask with .get(key), which gives None."


def _of_index(_error: Any, trace: TracebackType | None) -> str:
    owner = _indexed(trace)
    if isinstance(owner, (list, tuple, str)):
        has = f"it has {len(owner)}, so 0 to {len(owner) - 1}" if owner else "it is empty"
        return f"{has}: test len(...) before."
    return "test len(...) before."


def _of_type(error: Any, trace: TracebackType | None) -> str:
    message, node = str(error), _node(trace)
    if "NoneType" in message:
        return _about_none(node)
    is_made = isinstance(node, ast.Call) and callable(getattr(_value(node.func, trace), "factory", None))
    if isinstance(node, ast.Call) and is_made and trace is not None and trace.tb_frame.f_code.co_name != "get":
        return f"{ast.unparse(node.func)}.factory(): the node makes the component."
    if message.startswith("FactoryOfClass.__call__() takes") and isinstance(node, ast.Call):
        return f"{ast.unparse(node.func)}(name, ...): settings have names, as hover=0.3."
    if node is None and "__init__() takes" in message:  # the library has made a component
        return "def __init__(self, factory, parent, name):, and in it: super().__init__(factory, parent, name)."
    if "missing" in message and "required positional argument" in message and isinstance(node, ast.Call):
        line = _source(trace)
        if "task_handlers" in line or "TaskType." in line:
            name = ast.unparse(node.func)
            return f"leave out the brackets: {name}, not {ast.unparse(node)}; the node calls the handler itself."
        if message.startswith(("Endpoint.__init__", "Loop.__init__")) and not is_made:
            return "super().__init__(factory, parent, name)."
        return f"give them: {ast.unparse(node.func)}{_signature(_value(node.func, trace))}."
    if "object.__init__() takes" in message:
        return "name the class that it builds on: class Mine(Endpoint), class MyFactory(EndpointFactory)."
    if "object is not subscriptable" in message and isinstance(node, ast.Subscript):
        what, part = ast.unparse(node.value), ast.unparse(node.slice)
        is_method = "method' object" in message
        if "'Page' object" in message:
            return f"a page has its data in data: {what}.data[{part}]."
        return (
            f"call it, with round brackets: {what}({part})." if is_method else f"leave out [{part}]: it has no parts."
        )
    if "object of type 'Page' has no" in message:
        return "a page has its data in data: page.data."
    unexpected = re.search(r"unexpected keyword argument '(\w+)'", message)
    if unexpected is not None and isinstance(node, ast.Call) and (known := _parameters(_value(node.func, trace))):
        return suggest(unexpected[1], known, "it takes")
    if "positional argument" in message or "keyword argument" in message:
        return "compare the call with the def: as many arguments, in this order, after self."
    if "not callable" in message:
        return _about_call(node, trace)
    if "unsupported operand" in message:
        return _about_operands(message, node)
    if "not supported between" in message or "must be real number" in message:
        return _BOTH_SIDES
    if "format" in message:
        return "a % mark takes a value of its kind, such as a field of a page; f'{value}' takes any."
    return ""


def _about_call(node: ast.expr | None, trace: TracebackType | None) -> str:
    """Return the fix for a call of what cannot be called."""
    if isinstance(node, ast.Call):
        what, value = ast.unparse(node.func), _value(node.func, trace)
        if isinstance(value, Mapping) and len(node.args) == 1:
            return f"a page is a dict, with square brackets: {what}[{ast.unparse(node.args[0])}]."
        if isinstance(value, logging.LoggerAdapter | logging.Logger):
            return f"name the level: {what}.info(...), or warning, or error."
    return "leave out the brackets behind it, or look whether its name has been given to something else."


def _about_operands(message: str, node: ast.expr | None) -> str:
    """Return the fix for an operator whose operands do not fit."""
    if "for ^" in message:
        return "a power is written with two stars: a ** 2."
    kinds = re.search(r"'([^']*)' and '([^']*)'", message)
    if kinds is not None and isinstance(node, ast.BinOp):
        for kind, side in zip(kinds.groups(), (node.left, node.right), strict=True):
            if kind in ("method", "function", "builtin_function_or_method"):
                return f"call it, with round brackets: {ast.unparse(side)}()."
    return _BOTH_SIDES


def _about_none(node: ast.expr | None) -> str:
    inner = node.value if isinstance(node, (ast.Subscript, ast.Attribute)) else None
    what = ast.unparse(inner) if isinstance(inner, (ast.Name, ast.Attribute)) else "page"
    taken = f"page = {ast.unparse(inner)}; " if isinstance(inner, ast.Call) else ""
    return f"test it first, for a page that was never stored is None: {taken}if {what} is None: return None."


# The first matching class is used.
_WORDS: dict[type[BaseException], str | Callable[[Any, TracebackType | None], str]] = {
    SyntaxError: _of_syntax,
    ImportError: _of_import,
    NameError: _of_name,
    AttributeError: _of_attribute,
    KeyError: _of_key,
    IndexError: _of_index,
    TypeError: _of_type,
    ZeroDivisionError: "a divisor other than 0: test it before you divide, and decide what holds then.",
    FileNotFoundError: "look at its path: it counts from the folder in which you started the program.",
    AssertionError: "print the values in this line before it: what it asserts is false.",
    EOFError: "leave input() out: a run reads no keyboard; what comes from outside is a page or an event.",
    RecursionError: "a function calls itself without an end: return before that in some case.",
    NotImplementedError: "write that method in the class; its name has to be spelt like this.",
    ValueError: lambda error, trace: (
        "this has no value for every number, as the root of a negative one: test it before."
        if "math domain" in str(error)
        else "look at the value that is named: it has the right kind, and cannot be used for this."
    ),
}


def near(name: str, known: Iterable[str], cutoff: float = 0.7) -> str:
    """Return a question that offers the nearest name, or an empty text; `known` may be too long to list."""
    close = difflib.get_close_matches(name, sorted(known), n=1, cutoff=cutoff)
    return f"did you mean '{close[0]}'?" if close else ""


def _parameters(function: Any) -> list[str]:
    try:
        return [name for name in inspect.signature(function).parameters if name != "self"]
    except (TypeError, ValueError):
        return []


def _signature(function: Any) -> str:
    try:
        return f"({', '.join(_parameters(function))})" if _parameters(function) else str(inspect.signature(function))
    except (TypeError, ValueError):
        return "(...) takes the arguments in its def"


def _public(owner: object) -> list[str]:
    names = [*vars(owner)] if isinstance(owner, ModuleType) else dir(owner)
    if isinstance(owner, ModuleType) and owner.__name__.startswith("snr_sim."):  # without what it imports
        names = [name for name in names if getattr(getattr(owner, name), "__module__", "") == owner.__name__]
    return [name for name in {*names, *getattr(owner, "__all__", ())} if not name.startswith("_")]


def _names(trace: TracebackType) -> dict[str, Any]:
    return {**vars(builtins), **trace.tb_frame.f_globals, **trace.tb_frame.f_locals}


def _indexed(trace: TracebackType | None) -> Any:
    """Return the value whose index or key failed."""
    node = _node(trace)
    return _value(node.value, trace) if isinstance(node, ast.Subscript) else _UNKNOWN


def _source(trace: TracebackType | None) -> str:
    """Return the source line that failed, if Python knows it."""
    if trace is None:
        return ""
    return linecache.getline(trace.tb_frame.f_code.co_filename, trace.tb_lineno)


def _node(trace: TracebackType | None) -> ast.expr | None:
    """Return the expression that failed, if it is on one line."""
    if trace is None:
        return None
    line, last_line, first, last = list(trace.tb_frame.f_code.co_positions())[trace.tb_lasti // 2]
    if line is None or line != last_line or first is None:
        return None
    text = linecache.getline(trace.tb_frame.f_code.co_filename, line).encode()[first:last].decode(errors="replace")
    try:
        return ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError):
        return None


def _value(node: ast.expr, trace: TracebackType | None) -> Any:
    """Return the value of a name, or of its attribute, at the line that failed, without executing anything."""
    match node:
        case ast.Name(id=name) if trace is not None:
            return _names(trace).get(name, _UNKNOWN)
        case ast.Attribute(value=owner, attr=name):
            found = inspect.getattr_static(_value(owner, trace), name, _UNKNOWN)
            return _UNKNOWN if hasattr(found, "__get__") and not inspect.isfunction(found) else found
        case ast.Call(func=ast.Attribute(value=owner, attr="get_data"), args=[ast.Constant(value=str(key))]):
            node_of_it = getattr(_value(owner, trace), "parent", None)
            page = getattr(getattr(node_of_it, "datastore", None), "pages", {}).get(key)
            return None if page is None else page.data
    return _UNKNOWN
